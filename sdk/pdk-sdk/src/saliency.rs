//! Saliency methods: components that say which pixels matter to a driver.

use pdk_ops::Frame;
use pdk_seed::{Key, Random};

use crate::error::{Error, Result};

/// Says how much each part of a frame matters.
///
/// The map depends on the frame, the parameters and the key in the context alone, so that it can be made for any frame on its
/// own. The model whose view it shows is among the parameters.
pub trait Saliency: Send {
    /// Width and height of the map of a frame of this size: as large as the frame by default, and never larger.
    ///
    /// # Errors
    /// If the method cannot use frames of this size.
    fn map_size(&mut self, width: usize, height: usize) -> Result<[usize; 2]> {
        Ok([width, height])
    }

    /// Writes a value from 0 (does not matter) to 1 (matters most) for each part of the frame. `out` has the size that
    /// [`map_size`](Saliency::map_size) tells, covers the whole frame, and starts out with unspecified values, all of which have
    /// to be written.
    ///
    /// # Errors
    /// If the method cannot use the frame.
    fn map(&mut self, frame: Frame<'_>, cx: &MapContext<'_>, out: HeatmapMut<'_>) -> Result<()>;
}

/// What a saliency method knows besides the frame.
#[derive(Debug, Clone, Copy)]
pub struct MapContext<'a> {
    /// The number of the frame in its sequence, from 0.
    pub frame_index: u64,
    /// Simulation time in seconds since the start of the sequence.
    pub time: f64,
    /// The vehicle's speed in metres per second, if it is known.
    pub speed: Option<f64>,
    /// Whether the frame is of a recording and may come again, so that what took long to compute is worth keeping.
    pub recorded: bool,
    /// The key that all random numbers of this instance come from.
    pub key: &'a Key,
}

impl<'a> MapContext<'a> {
    /// A context of which no more is known.
    pub fn new(frame_index: u64, time: f64, key: &'a Key) -> Self {
        Self { frame_index, time, speed: None, recorded: false, key }
    }

    /// Random numbers that are drawn anew for every frame. Every call starts the stream from its beginning.
    pub fn frame_random(&self) -> Random {
        self.key.frame(self.frame_index)
    }

    /// Random numbers that are the same for all frames of a sequence. Every call starts the stream from its beginning.
    pub fn sequence_random(&self) -> Random {
        self.key.sequence()
    }
}

/// A writable map of one number a part of the frame, row by row without gaps.
pub struct HeatmapMut<'a> {
    values: &'a mut [f32],
    width: usize,
}

impl<'a> HeatmapMut<'a> {
    /// A map over `values`.
    ///
    /// # Errors
    /// If the number of values is not `width * height`, or zero.
    pub fn new(values: &'a mut [f32], width: usize, height: usize) -> Result<Self> {
        if values.is_empty() || width.checked_mul(height) != Some(values.len()) {
            return Err(Error::new(format!("{} values cannot hold a {width}x{height} map", values.len())));
        }
        Ok(Self { values, width })
    }

    /// Values in a row.
    pub fn width(&self) -> usize {
        self.width
    }

    /// Rows.
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
