//! Decodes PNG, with all of its checksums.

use std::borrow::Cow;
use std::io::Cursor;

use image::metadata::Orientation;
use image::{DynamicImage, ImageBuffer};
use pdk_sdk::error::Place;
use pdk_sdk::prelude::*;
use png::{BitDepth, ColorType, DecodeOptions, Decoder, Info, Limits, OutputInfo, Reader, Transformations};

use crate::size::check_size;

/// What is said of a file that cannot be read.
pub const DAMAGED: &str = "it is damaged";
/// What a file begins with.
const SIGNATURE: &[u8] = b"\x89PNG\r\n\x1a\n";
/// The parts of a file that make the picture, or the pictures of an animation.
const OF_PICTURES: [&[u8; 4]; 8] = [b"IHDR", b"PLTE", b"tRNS", b"IDAT", b"IEND", b"acTL", b"fcTL", b"fdAT"];

/// A file of which the head was read.
pub type PngReader<'a> = Reader<Cursor<&'a [u8]>>;

/// A file of which the head was read, and how many bytes its pixels have.
fn read(bytes: &[u8]) -> Result<(PngReader<'_>, usize)> {
    read_with(bytes, Transformations::EXPAND)
}

/// As [`read`], with what is done to the pixels.
pub fn read_with(bytes: &[u8], transformations: Transformations) -> Result<(PngReader<'_>, usize)> {
    let mut options = DecodeOptions::default();
    options.set_ignore_checksums(false);
    // Of no use here, and they may be compressed a thousand times.
    options.set_ignore_text_chunk(true);
    options.set_ignore_iccp_chunk(true);
    let mut decoder = Decoder::new_with_options(Cursor::new(bytes), options);
    let info = decoder.read_header_info().place(DAMAGED)?;
    check_size(info.width, info.height)?;
    let bytes = info.raw_bytes().saturating_mul(4).max(1 << 24);
    decoder.set_limits(Limits { bytes });
    decoder.set_transformations(transformations);
    let reader = decoder.read_info().place(DAMAGED)?;
    let length = reader.output_buffer_size().ok_or_else(|| Error::new("it is damaged: it has no size"))?;
    Ok((reader, length))
}

fn orientation(reader: &PngReader<'_>) -> Orientation {
    let exif = reader.info().exif_metadata.as_ref();
    let orientation = exif.and_then(|exif: &Cow<'_, [u8]>| Orientation::from_exif_chunk(exif));
    orientation.unwrap_or(Orientation::NoTransforms)
}

/// Reads all pictures of an animation and the checksums of their pixels, which its decoder does not look at.
///
/// # Errors
/// If it is damaged or too large.
pub fn check_animation(bytes: &[u8]) -> Result<()> {
    let (mut reader, length) = read_with(bytes, Transformations::IDENTITY)?;
    let mut pixels = vec![0; length];
    for _ in 0..pictures(reader.info()) {
        let frame = reader.next_frame(&mut pixels).place(DAMAGED)?;
        check_indexes(&reader, &frame, &pixels)?;
    }
    reader.finish().place(DAMAGED)
}

/// How many pictures there are.
fn pictures(info: &Info<'_>) -> u64 {
    let animated = info.animation_control.map_or(1, |animation| animation.num_frames);
    // The picture for those that know nothing of animations may be one of its own.
    let apart = info.animation_control.is_some() && info.frame_control.is_none();
    u64::from(animated) + u64::from(apart)
}

/// Refuses what is more than one picture.
pub fn check_still(reader: &PngReader<'_>) -> Result<()> {
    match pictures(reader.info()) {
        0 | 1 => Ok(()),
        count => Err(Error::new(format!(
            "it is an animation of {count} pictures where one is expected; save the one that is meant as a PNG of its own"
        ))),
    }
}

/// Refuses a picture that names colors which its palette does not have. Its decoder takes black for them.
fn check_indexes(reader: &PngReader<'_>, frame: &OutputInfo, pixels: &[u8]) -> Result<()> {
    if frame.color_type != ColorType::Indexed {
        return Ok(());
    }
    let colors = reader.info().palette.as_ref().map_or(0, |palette| palette.len() / 3);
    let bits = frame.bit_depth as usize;
    for row in pixels[..frame.buffer_size()].chunks_exact(frame.line_size) {
        for x in 0..frame.width as usize {
            let shift = 8 - bits - x * bits % 8;
            let index = usize::from(row[x * bits / 8] >> shift) & ((1 << bits) - 1);
            if index >= colors {
                return Err(Error::new(format!(
                    "it is damaged: a pixel has color {index} of a palette of {colors}"
                )));
            }
        }
    }
    Ok(())
}

/// As [`check_indexes`], for the first picture of a file.
fn check_palette(bytes: &[u8], reader: &PngReader<'_>) -> Result<()> {
    if reader.info().color_type != ColorType::Indexed {
        return Ok(());
    }
    let (mut reader, length) = read_with(bytes, Transformations::IDENTITY)?;
    let mut pixels = vec![0; length];
    let frame = reader.next_frame(&mut pixels).place(DAMAGED)?;
    check_indexes(&reader, &frame, &pixels)
}

/// Decodes a file. The orientation is returned beside the picture.
pub fn decode(bytes: &[u8]) -> Result<(DynamicImage, Orientation)> {
    let (mut reader, length) = read(bytes)?;
    check_still(&reader)?;
    check_palette(bytes, &reader)?;
    let mut pixels = vec![0; length];
    let (color, depth) = reader.output_color_type();
    let frame = reader.next_frame(&mut pixels).place(DAMAGED)?;
    // The checksum of the pixels stands behind them.
    reader.finish().place(DAMAGED)?;
    pixels.truncate(frame.buffer_size());
    let (width, height) = (frame.width, frame.height);
    let orientation = orientation(&reader);
    let words =
        || pixels.chunks_exact(2).map(|pair| u16::from_be_bytes([pair[0], pair[1]])).collect::<Vec<u16>>();
    let image: Option<DynamicImage> = match (color, depth) {
        (ColorType::Grayscale, BitDepth::Sixteen) => {
            ImageBuffer::from_raw(width, height, words()).map(DynamicImage::ImageLuma16)
        }
        (ColorType::GrayscaleAlpha, BitDepth::Sixteen) => {
            ImageBuffer::from_raw(width, height, words()).map(DynamicImage::ImageLumaA16)
        }
        (ColorType::Rgb, BitDepth::Sixteen) => {
            ImageBuffer::from_raw(width, height, words()).map(DynamicImage::ImageRgb16)
        }
        (ColorType::Rgba, BitDepth::Sixteen) => {
            ImageBuffer::from_raw(width, height, words()).map(DynamicImage::ImageRgba16)
        }
        (ColorType::Grayscale, _) => {
            ImageBuffer::from_raw(width, height, pixels).map(DynamicImage::ImageLuma8)
        }
        (ColorType::GrayscaleAlpha, _) => {
            ImageBuffer::from_raw(width, height, pixels).map(DynamicImage::ImageLumaA8)
        }
        (ColorType::Rgb, _) => ImageBuffer::from_raw(width, height, pixels).map(DynamicImage::ImageRgb8),
        (ColorType::Rgba, _) => ImageBuffer::from_raw(width, height, pixels).map(DynamicImage::ImageRgba8),
        // Palettes were expanded.
        (ColorType::Indexed, _) => None,
    };
    let image = image.ok_or_else(|| Error::new("it is damaged: it has fewer pixels than its size says"))?;
    Ok((image, orientation))
}

/// Decodes a file into a frame, if it is one of its size that needs no more; whether it was. If not, the frame may hold anything.
pub fn decode_into(bytes: &[u8], into: &mut FrameMut<'_>) -> Result<bool> {
    let (mut reader, length) = read(bytes)?;
    let (size, kind) = (reader.info().size(), reader.output_color_type());
    if (size.0 as usize, size.1 as usize) != (into.width(), into.height())
        || kind != (ColorType::Rgb, BitDepth::Eight)
        // These take a closer look.
        || reader.info().color_type == ColorType::Indexed
        || pictures(reader.info()) > 1
    {
        return Ok(false);
    }
    let Some(pixels) = into.contiguous_mut().filter(|pixels| pixels.len() == length) else {
        return Ok(false);
    };
    let frame = reader.next_frame(pixels).place(DAMAGED)?;
    // The checksum of the pixels stands behind them, and there may be something that says how the picture is to be turned.
    reader.finish().place(DAMAGED)?;
    Ok((frame.width, frame.height) == size && orientation(&reader) == Orientation::NoTransforms)
}

/// A PNG file without all that is not part of its pictures: texts and color profiles, which a decoder would expand to any size.
///
/// # Errors
/// If it is cut off.
pub fn without_texts(bytes: &[u8]) -> Result<Vec<u8>> {
    let cut_off = || Error::new("it is cut off: the end of the PNG is missing");
    let mut rest = bytes.strip_prefix(SIGNATURE).ok_or_else(cut_off)?;
    let mut kept = SIGNATURE.to_vec();
    loop {
        let (head, _) = rest.split_first_chunk::<8>().ok_or_else(cut_off)?;
        let [a, b, c, d, name @ ..] = head;
        // Length, name and checksum.
        let length = (u32::from_be_bytes([*a, *b, *c, *d]) as usize).saturating_add(12);
        let (chunk, behind) = rest.split_at_checked(length).ok_or_else(cut_off)?;
        if OF_PICTURES.contains(&name) {
            kept.extend_from_slice(chunk);
        }
        if name == b"IEND" {
            return Ok(kept);
        }
        rest = behind;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The checksum of a chunk (ISO 3309), bit by bit.
    fn crc(bytes: &[u8]) -> u32 {
        !bytes.iter().fold(!0, |crc: u32, &byte| {
            (0..8).fold(crc ^ u32::from(byte), |crc, _| {
                (crc >> 1) ^ (0xedb8_8320 & (!(crc & 1)).wrapping_add(1))
            })
        })
    }

    /// An animation of two pictures, and where the chunk with the pixels of each begins.
    fn animation() -> (Vec<u8>, [usize; 2]) {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 8, 6);
        encoder.set_color(ColorType::Rgb);
        encoder.set_animated(2, 0).unwrap();
        let mut writer = encoder.write_header().unwrap();
        for picture in 0..2 {
            writer.write_image_data(&[picture * 90; 8 * 6 * 3]).unwrap();
        }
        writer.finish().unwrap();
        let at = |name: &[u8]| bytes.windows(4).position(|four| four == name).unwrap() - 4;
        let places = [at(b"IDAT"), at(b"fdAT")];
        (bytes, places)
    }

    /// A picture of 8 x 2 with this many bits a pixel, of which each has this color of a palette of three.
    fn with_palette(depth: BitDepth, index: u8) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 8, 2);
        encoder.set_color(ColorType::Indexed);
        encoder.set_depth(depth);
        encoder.set_palette(vec![10, 20, 30, 40, 50, 60, 70, 80, 90]);
        let mut writer = encoder.write_header().unwrap();
        let bits = depth as usize;
        let byte = (0..8 / bits).fold(0, |byte: u8, place| byte | index << (place * bits));
        writer.write_image_data(&vec![byte; 2 * bits]).unwrap();
        writer.finish().unwrap();
        bytes
    }

    #[test]
    fn a_color_that_the_palette_does_not_have_is_refused() {
        for (depth, last) in [(BitDepth::Two, 3), (BitDepth::Four, 15), (BitDepth::Eight, 255)] {
            let (picture, _) = decode(&with_palette(depth, 2)).unwrap();
            assert_eq!(picture.to_rgb8().get_pixel(7, 1).0, [70, 80, 90]);
            for index in [3, last] {
                let bytes = with_palette(depth, index);
                for error in [decode(&bytes).map(drop).unwrap_err(), check_animation(&bytes).unwrap_err()] {
                    let expected = format!("it is damaged: a pixel has color {index} of a palette of 3");
                    assert_eq!(error.to_string(), expected);
                }
            }
        }
    }

    #[test]
    fn an_animation_is_not_one_picture() {
        let (whole, _) = animation();
        let error = decode(&whole).map(drop).unwrap_err().to_string();
        assert!(error.starts_with("it is an animation of 2 pictures where one is expected"), "{error}");
    }

    #[test]
    fn the_checksums_of_all_pictures_of_an_animation_count() {
        let (whole, places) = animation();
        check_animation(&whole).unwrap();
        for place in places {
            let mut bytes = whole.clone();
            let length = u32::from_be_bytes(bytes[place..place + 4].try_into().unwrap()) as usize;
            // The last byte of the chunk is the last of the checksum of its pixels. That of the chunk is right.
            bytes[place + 8 + length - 1] ^= 1;
            let sum = crc(&bytes[place + 4..place + 8 + length]).to_be_bytes();
            bytes[place + 8 + length..place + 12 + length].copy_from_slice(&sum);
            let error = check_animation(&bytes).unwrap_err().to_string();
            assert!(error.starts_with(DAMAGED), "{error}");
        }
        assert!(check_animation(&whole[..whole.len() - 30]).is_err());
    }
}
