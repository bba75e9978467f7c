//! Tests of files that ask for more than they are worth: each is refused in one sentence, at once and in little memory.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::Command;

use image::{ImageFormat, RgbImage};

use crate::clip::{Clip, some_pictures};
use crate::stand_in::within;

/// The sentence with which a clip is refused, when its content is looked at and when it is decoded.
fn refusal(path: &Path) -> String {
    let clip = Clip::Path(path.to_owned());
    within(120, move || {
        let hash = clip.hash().err();
        let error = some_pictures(&clip, 5).err().unwrap_or_else(|| panic!("{clip} is decoded")).to_string();
        assert!(hash.is_none_or(|hash| hash.to_string() == error));
        error
    })
}

fn file(folder: &Path, name: &str, bytes: &[u8]) -> PathBuf {
    let path = folder.join(name);
    std::fs::write(&path, bytes).unwrap();
    path
}

/// A GIF with one frame, as large as the two sizes say.
fn gif(screen: [u16; 2], frame: [u16; 2]) -> Vec<u8> {
    let le = |sizes: [u16; 2]| sizes.map(u16::to_le_bytes).concat();
    let colours = [0, 200, 30, 20, 20, 20];
    let mut bytes =
        [b"GIF89a", &le(screen)[..], &[0x80, 0, 0], &colours, b",\0\0\0\0", &le(frame), &[0]].concat();
    // Two colours; clear, one pixel, end.
    bytes.extend_from_slice(&[2, 2, 0x44, 1, 0, b';']);
    bytes
}

const LIMIT: &str = "pictures may have 64 megapixels and sides of 16384; scale it down, or raise the limit with PDK_MEGAPIXELS";

#[test]
fn a_picture_that_says_it_is_as_large_as_the_world_is_not_believed() {
    let folder = tempfile::tempdir().unwrap();
    let small = Clip::Path(file(folder.path(), "small.gif", &gif([1, 1], [1, 1])));
    assert_eq!(some_pictures(&small, 5).unwrap().len(), 1);
    for (screen, frame) in [([65_535; 2], [65_535; 2]), ([65_535; 2], [1, 1]), ([16_384, 4097], [1, 1])] {
        let said = refusal(&file(folder.path(), "a.gif", &gif(screen, frame)));
        assert_eq!(said, format!("it is {} x {}, and {LIMIT}", screen[0], screen[1]));
    }
    let said = refusal(&file(folder.path(), "a.gif", &gif([4, 4], [65_535; 2])));
    assert!(said.starts_with("its pictures are too large") || said.starts_with("it is damaged"), "{said}");
    for format in [ImageFormat::Png, ImageFormat::Bmp, ImageFormat::Jpeg] {
        let path = folder.path().join(format.extensions_str()[0]);
        RgbImage::new(20_000, 2).save_with_format(&path, format).unwrap();
        assert!(refusal(&path).ends_with(LIMIT), "{format:?}: {}", refusal(&path));
        // In a folder of pictures too.
        let pictures = tempfile::tempdir().unwrap();
        let name = format!("a.{}", format.extensions_str()[0]);
        std::fs::copy(&path, pictures.path().join(&name)).unwrap();
        let said = refusal(pictures.path());
        assert!(
            said.starts_with(&format!("its picture `{name}`: it is 20000 x 2, and")) && said.ends_with(LIMIT),
            "{said}"
        );
    }
}

#[test]
fn pictures_of_the_largest_size_are_clips() {
    let folder = tempfile::tempdir().unwrap();
    let path = file(folder.path(), "a.gif", &gif([16_384, 4096], [1, 1]));
    let pictures = some_pictures(&Clip::Path(path), 1).unwrap();
    assert_eq!((pictures[0].width, pictures[0].height), (16_384, 4096));
}

#[test]
fn an_irregular_file_is_not_waited_for() {
    let folder = tempfile::tempdir().unwrap();
    let fifo = |path: PathBuf| {
        assert!(Command::new("mkfifo").arg(&path).status().unwrap().success());
        path
    };
    let said = refusal(&fifo(folder.path().join("fifo.mp4")));
    assert_eq!(said, "it is a pipe, and only regular files are read; name a file");
    let zero = folder.path().join("zero.mp4");
    std::os::unix::fs::symlink("/dev/zero", &zero).unwrap();
    assert_eq!(refusal(&zero), "it is a device, and only regular files are read; name a file");
    let pictures = tempfile::tempdir().unwrap();
    fifo(pictures.path().join("a.png"));
    let said = refusal(pictures.path());
    assert_eq!(said, "its picture `a.png`: it is a pipe, and only regular files are read; name a file");
}

#[test]
fn a_file_that_is_too_large_is_not_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("huge.mkv");
    File::create(&path).unwrap().set_len(5 << 30).unwrap();
    assert_eq!(
        refusal(&path),
        "it has 5.0 GiB, and a clip may have 4 GiB; cut it shorter, or compress it more"
    );
    let path = file(folder.path(), "huge.jpg", b"\xff\xd8\xff\xe0");
    File::options().append(true).open(&path).unwrap().set_len(600 << 20).unwrap();
    assert_eq!(
        refusal(&path),
        "it has more than 512 MiB, and the file of a still picture may not have; scale it down"
    );
}

#[test]
fn the_files_that_once_asked_for_17_gigabytes_are_refused() {
    let data = std::env::var_os("PDK_TEST_DATA")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../../shared"), PathBuf::from);
    for (name, sentence) in [
        ("gif_65535.gif", "it is 65535 x 65535, and"),
        ("samples_2e32.mp4", "it is damaged: its index claims 42949"),
    ] {
        let path = data.join("attacks").join(name);
        if !path.is_file() {
            eprintln!("skipped: no {}; PDK_TEST_DATA can name the folder", path.display());
            continue;
        }
        assert!(refusal(&path).starts_with(sentence), "{}", refusal(&path));
    }
}
