//! Pictures that the tests make themselves.

use std::path::Path;

use image::{Rgb, RgbImage};

/// A picture of a road, roughly: sky, ground, a bright line and some texture.
pub fn road(width: u32, height: u32, shift: u32) -> RgbImage {
    RgbImage::from_fn(width, height, |x, y| {
        let texture = ((x * 7 + y * 13 + shift * 5) % 31) as u8;
        let line = width / 2 + shift % 9 + y / 4;
        match (y > height / 2, x.abs_diff(line) < 3) {
            (false, _) => Rgb([120, 160 + texture / 2, 230]),
            (true, true) => Rgb([240, 235, 200 + texture]),
            (true, false) => Rgb([70 + texture, 75 + texture, 80]),
        }
    })
}

/// Writes [`road`] in the format that the name says.
///
/// # Panics
/// If it cannot be written.
pub fn write(path: &Path, width: u32, height: u32) {
    road(width, height, 0).save(path).unwrap();
}

/// The content of a file, cut off in the middle.
///
/// # Panics
/// If it cannot be read.
pub fn cut(path: &Path) {
    let bytes = std::fs::read(path).unwrap();
    std::fs::write(path, &bytes[..bytes.len() / 2]).unwrap();
}
