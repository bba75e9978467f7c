//! Clips that ffmpeg wrote with each coding of colours: eight squares of 32 x 32 pixels, in two rows.

use std::path::{Path, PathBuf};

use openh264::OpenH264API;
use openh264::encoder::{Encoder, EncoderConfig, MatrixCoefficients, VuiConfig};
use openh264::formats::YUVSlices;
use pdk_sdk::ops::yuv::{Coding, Matrix};
use pdk_sdk::prelude::*;

use crate::{Opened, Reader, Stream, Writer, Yuv420};

const COLOURS: [[u8; 3]; 8] =
    [[255, 0, 0], [0, 255, 0], [0, 0, 255], [255; 3], [0; 3], [64; 3], [128; 3], [200, 120, 40]];
const CODINGS: [(&str, Matrix, bool); 4] = [
    ("bt601", Matrix::Bt601, false),
    ("bt601_full", Matrix::Bt601, true),
    ("bt709", Matrix::Bt709, false),
    ("bt709_full", Matrix::Bt709, true),
];

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("fixtures").join(name).with_extension("mp4")
}

fn rgb(picture: &Yuv420) -> FrameBuf {
    let mut rgb = FrameBuf::new(picture.width, picture.height);
    picture.to_rgb(rgb.as_mut());
    rgb
}

/// The middles of the squares.
fn assert_squares(frame: &FrameBuf, most: u8, name: &str) {
    for (number, wanted) in COLOURS.iter().enumerate() {
        let found = frame.as_ref().pixel(32 * (number % 4) + 16, 32 * (number / 4) + 16);
        assert!(
            found.iter().zip(wanted).all(|(a, b)| a.abs_diff(*b) <= most),
            "{name}: {found:?} {wanted:?}"
        );
    }
}

#[test]
fn clips_of_each_coding_have_the_colours_that_were_drawn() {
    let folder = tempfile::tempdir().unwrap();
    for (name, matrix, full_range) in CODINGS {
        let mut reader = Reader::open_file(&fixture(name)).unwrap();
        let mut picture = Yuv420::default();
        let copy = folder.path().join(name).with_extension("mp4");
        let mut writer = Writer::create(&copy, 128, 64, 10.0).unwrap();
        for _ in 0..2 {
            assert!(reader.next(&mut picture).unwrap());
            assert_eq!(picture.coding, Coding { matrix, full_range }, "{name}");
            assert_squares(&rgb(&picture), 2, name);
            writer.push(rgb(&picture).as_ref()).unwrap();
            let mut brought = picture.clone();
            brought.to_bt601();
            assert_eq!(brought.coding, Coding::default());
            assert_squares(&rgb(&brought), 3, name);
        }
        writer.finish().unwrap();
        // What is written has the colours that were read, whatever they were coded by.
        assert!(Reader::open_file(&copy).unwrap().next(&mut picture).unwrap());
        assert_eq!(picture.coding, Coding::default());
        assert_squares(&rgb(&picture), 6, name);
    }
}

#[test]
fn another_matrix_is_left_to_ffmpeg_by_its_name() {
    let error = Reader::open_file(&fixture("bt2020")).err().unwrap().to_string();
    assert!(error.starts_with("it is H.264 whose matrix of colours is that of BT.2020, but"), "{error}");
    assert!(error.contains("-vf scale=out_color_matrix=bt601:out_range=tv"), "{error}");
    let path = fixture("bt2020");
    let size = std::fs::metadata(&path).unwrap().len();
    let opened = Reader::open(Box::new(std::fs::File::open(&path).unwrap()), size, false).unwrap();
    assert!(matches!(opened, Opened::OtherCodec(_)));
}

/// A key frame of one colour, as a stream has it.
fn units(vui: Option<VuiConfig>) -> Vec<u8> {
    let config = EncoderConfig::new();
    let config = vui.into_iter().fold(config, EncoderConfig::vui);
    let mut encoder = Encoder::with_api_config(OpenH264API::from_source(), config).unwrap();
    let (luma, chroma) = ([128; 64 * 64], [[100; 32 * 32], [160; 32 * 32]]);
    let source = YUVSlices::new((&luma, &chroma[0], &chroma[1]), (64, 64), (64, 32, 32));
    encoder.encode(&source).unwrap().to_vec()
}

#[test]
fn pictures_of_a_stream_have_the_coding_that_it_names() {
    let mut stream = Stream::new().unwrap();
    let mut picture = Yuv420::default();
    let bt709 = |full_range| Coding { matrix: Matrix::Bt709, full_range };
    for (vui, coding) in [
        (None, Coding::default()),
        (Some(VuiConfig::bt709()), bt709(false)),
        (Some(VuiConfig::bt709().full_range(true)), bt709(true)),
        (Some(VuiConfig::bt601()), Coding::default()),
        (Some(VuiConfig::bt601().full_range(true)), Coding { matrix: Matrix::Bt601, full_range: true }),
    ] {
        stream.decode(&units(vui), &mut picture).unwrap();
        assert_eq!(picture.coding, coding);
    }
    let other = VuiConfig::bt709().matrix_coefficients(MatrixCoefficients::Bt2020Ncl);
    let error = stream.decode(&units(Some(other)), &mut picture).unwrap_err().to_string();
    assert_eq!(
        error,
        "it is H.264 whose matrix of colours is that of BT.2020, and only the matrices of BT.601 and BT.709 are read; encode the topic \
         again with one of them"
    );
}
