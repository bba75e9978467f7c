//! Dataset readers: components that read recorded frames with their ground truth.

use pdk_ops::FrameBuf;

use crate::error::Result;

/// Reads the frames of a recording, in any order.
pub trait Dataset: Send {
    /// The number of frames.
    fn len(&self) -> usize;

    /// Whether there are none.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The name of a frame, as it is reported; also where the frame itself cannot be read.
    fn name(&self, index: usize) -> String;

    /// Reads a frame.
    ///
    /// # Errors
    /// If this frame cannot be read; the run counts it, names it and goes on with the next.
    fn read(&mut self, index: usize) -> Result<Entry>;
}

/// A recorded frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// The image.
    pub frame: FrameBuf,
    /// The recorded steering, -1 to 1.
    pub steering: f64,
    /// The recorded throttle, -1 to 1.
    pub throttle: f64,
    /// Seconds since the first frame.
    pub time: f64,
}
