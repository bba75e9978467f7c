//! Pictures for people: labelled sheets, strips and short clips of what perturbations do.

use std::path::Path;

use image::{Rgb, RgbImage, imageops};
use pdk_sdk::error::{Error, Result};
use pdk_sdk::file;
use pdk_sdk::prelude::FrameBuf;

use crate::text::{self, LINE_HEIGHT};

/// White paper.
pub const PAPER: Rgb<u8> = Rgb([255, 255, 255]);

/// Pixels between pictures.
pub const GAP: u32 = 6;

/// A frame at another width, with the aspect it has; smoothed where it shrinks.
pub fn scaled(frame: &FrameBuf, width: u32) -> RgbImage {
    let image = to_image(frame);
    let height =
        (f64::from(image.height()) * f64::from(width) / f64::from(image.width())).round().max(1.0) as u32;
    match (image.width(), image.height()) == (width, height) {
        true => image,
        false => imageops::resize(&image, width, height, imageops::FilterType::Triangle),
    }
}

/// A frame as an image.
pub fn to_image(frame: &FrameBuf) -> RgbImage {
    let (width, height) = (frame.width() as u32, frame.height() as u32);
    RgbImage::from_raw(width, height, frame.data().to_vec()).unwrap_or_else(|| RgbImage::new(width, height))
}

/// An image as a frame.
///
/// # Errors
/// If it has no pixels.
pub fn to_frame(image: RgbImage) -> Result<FrameBuf> {
    let (width, height) = (image.width() as usize, image.height() as usize);
    FrameBuf::from_vec(image.into_raw(), width, height).map_err(Error::new)
}

/// A picture over another one of the same width.
pub fn stacked(above: &RgbImage, below: &RgbImage) -> RgbImage {
    let mut both = RgbImage::from_pixel(above.width(), above.height() + below.height(), PAPER);
    imageops::replace(&mut both, above, 0, 0);
    imageops::replace(&mut both, below, 0, i64::from(above.height()));
    both
}

/// Pictures of one size side by side.
///
/// # Errors
/// If there are none.
pub fn row(pictures: &[RgbImage]) -> Result<RgbImage> {
    let first = pictures
        .first()
        .ok_or_else(|| Error::new("there are no pictures to put side by side; name at least one image"))?;
    let count = pictures.len() as u32;
    let mut row = RgbImage::from_pixel(first.width() * count + GAP * (count - 1), first.height(), PAPER);
    for (position, picture) in pictures.iter().enumerate() {
        imageops::replace(&mut row, picture, i64::from((first.width() + GAP) * position as u32), 0);
    }
    Ok(row)
}

/// A block of a sheet: a label over a row of pictures.
pub struct Block {
    /// The label.
    pub label: String,
    /// The row of pictures.
    pub row: RgbImage,
}

/// Blocks of equal size under a heading, top to bottom in this many columns.
///
/// # Errors
/// If there are none.
pub fn sheet(heading: &str, blocks: &[Block], columns: u32) -> Result<RgbImage> {
    const MARGIN: u32 = 16;
    let first = blocks.first().ok_or_else(|| Error::new("there is nothing to show on the sheet"))?;
    let columns = columns.clamp(1, blocks.len() as u32);
    let rows = (blocks.len() as u32).div_ceil(columns);
    let (block_width, block_height) = (first.row.width(), first.row.height() + LINE_HEIGHT + GAP);
    let top = MARGIN + LINE_HEIGHT + GAP;
    let width = MARGIN * 2 + columns * block_width + (columns - 1) * MARGIN;
    let mut sheet = RgbImage::from_pixel(width, top + rows * block_height + MARGIN, PAPER);
    text::draw(&mut sheet, MARGIN, MARGIN, heading);
    for (position, block) in blocks.iter().enumerate() {
        let (column, line) = (position as u32 / rows, position as u32 % rows);
        let (x, y) = (MARGIN + column * (block_width + MARGIN), top + line * block_height);
        text::draw(&mut sheet, x, y, &block.label);
        imageops::replace(&mut sheet, &block.row, i64::from(x), i64::from(y + LINE_HEIGHT));
    }
    Ok(sheet)
}

/// Writes an endless GIF.
///
/// # Errors
/// If it cannot be encoded or written.
pub fn write_clip(path: &Path, frames: Vec<RgbImage>, frames_per_second: u32) -> Result<()> {
    use image::codecs::gif::{GifEncoder, Repeat};
    let text = |error: image::ImageError| Error::new(error.to_string());
    let written = file::write_with(path, |file| {
        let mut encoder = GifEncoder::new_with_speed(file, 10);
        encoder.set_repeat(Repeat::Infinite).map_err(text)?;
        for frame in frames {
            let delay = image::Delay::from_numer_denom_ms(1000, frames_per_second.max(1));
            let rgba = image::DynamicImage::from(frame).into_rgba8();
            encoder.encode_frame(image::Frame::from_parts(rgba, 0, 0, delay)).map_err(text)?;
        }
        Ok(())
    });
    written.map_err(|error: Error| error.at(format_args!("cannot write {}", path.display())))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_fill_columns_from_the_top() {
        let picture = |grey| RgbImage::from_pixel(10, 8, Rgb([grey; 3]));
        let block =
            |grey| Block { label: "label".into(), row: row(&[picture(grey), picture(grey)]).unwrap() };
        let sheet = sheet("heading", &[block(10), block(20), block(30)], 2).unwrap();
        let first_row = 16 + LINE_HEIGHT + GAP + LINE_HEIGHT;
        assert_eq!(sheet.get_pixel(16, first_row), &Rgb([10; 3]));
        assert_eq!(sheet.get_pixel(16, first_row + 8 + LINE_HEIGHT + GAP), &Rgb([20; 3]));
        assert_eq!(sheet.get_pixel(16 + 26 + 16, first_row), &Rgb([30; 3]));
    }

    #[test]
    fn a_picture_stands_over_another_one() {
        let picture = |grey, height| RgbImage::from_pixel(3, height, Rgb([grey; 3]));
        let both = stacked(&picture(9, 1), &picture(0, 1));
        assert_eq!((both.width(), both.height()), (3, 2));
        assert_eq!((both.get_pixel(2, 0), both.get_pixel(2, 1)), (&Rgb([9; 3]), &Rgb([0; 3])));
    }

    #[test]
    fn an_empty_sheet_is_an_error() {
        assert!(sheet("heading", &[], 2).is_err());
        assert!(row(&[]).is_err());
    }
}
