//! Saliency methods: components that say which pixels matter to a driver.

use pdk_ops::Frame;

use crate::error::{Error, Result};

/// Says how much each pixel of a frame matters.
pub trait Saliency: Send {
    /// Writes a value from 0 (does not matter) to 1 (matters most) for each pixel. `out` is as large as `frame`.
    ///
    /// # Errors
    /// Where the method cannot use the frame.
    fn map(&mut self, frame: Frame<'_>, out: HeatmapMut<'_>) -> Result<()>;
}

/// A writable map of one number a pixel, row by row without gaps.
pub struct HeatmapMut<'a> {
    values: &'a mut [f32],
    width: usize,
}

impl<'a> HeatmapMut<'a> {
    /// A map over `values`.
    ///
    /// # Errors
    /// Where the number of values is not `width * height`.
    pub fn new(values: &'a mut [f32], width: usize, height: usize) -> Result<Self> {
        if width == 0 || values.len() != width * height {
            return Err(Error::new(format!("{} values cannot hold a {width}x{height} map", values.len())));
        }
        Ok(Self { values, width })
    }

    /// Width in pixels.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Height in pixels.
    pub fn height(&self) -> usize {
        self.values.len() / self.width
    }

    /// All values.
    pub fn values_mut(&mut self) -> &mut [f32] {
        self.values
    }

    /// The values of row `y`.
    pub fn row_mut(&mut self, y: usize) -> &mut [f32] {
        &mut self.values[y * self.width..(y + 1) * self.width]
    }
}
