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

    /// Where in its recording a frame lies, as far as that is known without its picture. A driver that remembers earlier frames begins
    /// anew where numbers or times jump.
    fn position(&self, index: usize) -> Position {
        Position { part: 0, number: index as u64, time: f64::NAN }
    }
}

/// Where in its recording a frame lies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Position {
    /// The part of the recording that the frame belongs to, such as a drive of its own: frames of two parts do not follow each other.
    pub part: u64,
    /// Its number in that part, as it was recorded: frames that are missing leave a gap.
    pub number: u64,
    /// Seconds since the first frame; not a number if it is not known.
    pub time: f64,
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
