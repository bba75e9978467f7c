//! Which part of a frame the network sees.

use pdk_sdk::error::{Error, Result};
use pdk_sdk::prelude::Frame;

/// A length along an axis: pixels or a share.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Length {
    /// Pixels.
    Pixels(usize),
    /// A share of the axis.
    Share(f64),
}

impl Length {
    /// In pixels of an axis of this length; shares are rounded to the nearest pixel.
    fn of(self, axis: usize) -> usize {
        match self {
            Self::Pixels(pixels) => pixels,
            Self::Share(share) => (share * axis as f64 + 0.5) as usize,
        }
    }
}

/// What the network sees of a frame.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub enum Region {
    /// All of it.
    #[default]
    Whole,
    /// What is left between these lengths, cut off at the left, the top, the right and the bottom.
    Crop([Length; 4]),
    /// What lies between these edges: left, top, right and bottom, counted from the left and the top.
    Edges([Length; 4]),
}

/// A part of a frame in pixels.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Part {
    /// The first column.
    pub left: usize,
    /// The first row.
    pub top: usize,
    /// Columns.
    pub width: usize,
    /// Rows.
    pub height: usize,
}

impl Region {
    /// The part of a frame of this size.
    ///
    /// # Errors
    /// If nothing is left of it, or the region reaches beyond it.
    pub fn part(&self, width: usize, height: usize) -> Result<Part> {
        let [left, top, right, bottom] = match self {
            Self::Whole => [0, 0, width, height],
            Self::Crop([left, top, right, bottom]) => {
                let (right, bottom) = (right.of(width), bottom.of(height));
                [left.of(width), top.of(height), width.saturating_sub(right), height.saturating_sub(bottom)]
            }
            Self::Edges([left, top, right, bottom]) => {
                [left.of(width), top.of(height), right.of(width), bottom.of(height)]
            }
        };
        if left >= right || top >= bottom || right > width || bottom > height {
            let field = if matches!(self, Self::Crop(_)) { "crop" } else { "region" };
            return Err(Error::new(format!(
                "its `{field}` leaves columns {left} to {right} and rows {top} to {bottom} of a frame of {width}x{height} pixels; \
                 correct it, or set `frame` to the size that it is meant for"
            )));
        }
        Ok(Part { left, top, width: right - left, height: bottom - top })
    }
}

impl Part {
    /// The part as a frame, without copying it.
    ///
    /// # Errors
    /// If it lies outside.
    pub fn of<'a>(&self, frame: Frame<'a>) -> Result<Frame<'a>> {
        let start = self.top * frame.stride() + self.left * 3;
        let bytes = frame.data().get(start..).unwrap_or_default();
        Frame::with_stride(bytes, self.width, self.height, frame.stride())
            .map_err(|error| Error::new(error.to_string()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use Length::{Pixels, Share};

    #[test]
    fn pixels_and_shares_leave_the_same_part() {
        let part = Part { left: 0, top: 60, width: 320, height: 75 };
        let crop = Region::Crop([Pixels(0), Pixels(60), Pixels(0), Pixels(25)]);
        let shares = Region::Crop([Share(0.0), Share(0.375), Share(0.0), Share(0.15625)]);
        let edges = Region::Edges([Pixels(0), Pixels(60), Pixels(320), Pixels(135)]);
        for region in [crop, shares, edges] {
            assert_eq!(region.part(320, 160).unwrap(), part, "{region:?}");
        }
        let error = crop.part(80, 85).unwrap_err().to_string();
        assert!(
            error.starts_with("its `crop` leaves columns 0 to 80 and rows 60 to 60 of a frame of 80x85"),
            "{error}"
        );
        assert!(edges.part(300, 160).is_err());
    }

    #[test]
    fn a_part_is_a_view_of_the_frame() {
        let bytes: Vec<u8> = (0..4 * 3 * 3).collect();
        let frame = Frame::new(&bytes, 4, 3).unwrap();
        let part = Part { left: 1, top: 1, width: 3, height: 2 }.of(frame).unwrap();
        assert_eq!(part.row(0), &bytes[15..24]);
        assert_eq!(part.pixel(2, 1), [33, 34, 35]);
    }
}
