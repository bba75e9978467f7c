//! What the checks of several kinds use.

use pdk_ops::FrameBuf;

use crate::config::Config;
use crate::error::{Error, Result};

/// Makes an instance from parameters.
pub type Make<'a, T> = &'a mut dyn FnMut(&Config) -> Result<Box<T>>;

/// Frame sizes that find most mistakes: a single pixel, odd sizes, a usual one.
pub(crate) const SIZES: [(usize, usize); 4] = [(1, 1), (3, 2), (33, 17), (160, 120)];

/// A frame of one grey.
pub fn even_frame(grey: u8, width: usize, height: usize) -> FrameBuf {
    let mut frame = FrameBuf::new(width, height);
    frame.as_mut().rows_mut().for_each(|row| row.fill(grey));
    frame
}

/// A frame with some structure: a gradient, an edge and texture.
pub fn sample_frame(width: usize, height: usize) -> FrameBuf {
    let mut frame = FrameBuf::new(width, height);
    let mut view = frame.as_mut();
    for y in 0..height {
        for x in 0..width {
            let edge = if x > width / 2 { 60 } else { 0 };
            let texture = ((x * 7 + y * 13) % 31) as u8;
            let shade = (y * 150 / height.max(1)) as u8;
            view.set_pixel(x, y, [shade + edge + texture / 2, shade / 2 + texture, 200 - shade + texture]);
        }
    }
    frame
}

/// Whether a rule holds; if not, with this sentence.
pub(crate) fn ensure(holds: bool, sentence: impl FnOnce() -> String) -> Result<()> {
    if holds { Ok(()) } else { Err(Error::new(sentence())) }
}
