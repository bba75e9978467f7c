//! Dataset readers: components that read recorded frames with their ground truth.

use pdk_ops::FrameBuf;

use crate::error::Result;

/// Reads the frames of a recording, in any order.
///
/// What a reader does not recognise as its format it rejects with [`ErrorKind::Unsuitable`](crate::error::ErrorKind::Unsuitable), so
/// that pdk asks the next one.
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

    /// What was decided when the recording was opened and is not among the parameters, such as the columns that were guessed: names and
    /// values, which pdk prints and records.
    fn info(&self) -> Vec<(String, String)> {
        Vec::new()
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
///
/// What was not recorded is not a number: `Entry { frame, steering, ..Entry::default() }` has no throttle and no speed.
#[derive(Debug, Clone, PartialEq)]
pub struct Entry {
    /// The image.
    pub frame: FrameBuf,
    /// The recorded steering, -1 to 1; NaN if none was recorded.
    pub steering: f64,
    /// The recorded throttle, -1 to 1; NaN if none was recorded.
    pub throttle: f64,
    /// Seconds since the first frame.
    pub time: f64,
    /// The recorded speed in metres per second; NaN if none was recorded.
    pub speed: f64,
}

impl Default for Entry {
    fn default() -> Self {
        let frame = FrameBuf::default();
        Self { frame, steering: f64::NAN, throttle: f64::NAN, time: 0.0, speed: f64::NAN }
    }
}

impl Entry {
    /// Whether it can be used: what was recorded is finite, and it has a time.
    pub fn is_plausible(&self) -> bool {
        self.time.is_finite() && ![self.steering, self.throttle, self.speed].iter().any(|n| n.is_infinite())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_was_not_recorded_is_plausible_and_infinity_is_not() {
        assert!(Entry::default().is_plausible());
        for entry in [
            Entry { steering: f64::INFINITY, ..Entry::default() },
            Entry { time: f64::NAN, ..Entry::default() },
            Entry { speed: f64::NEG_INFINITY, ..Entry::default() },
        ] {
            assert!(!entry.is_plausible(), "{entry:?}");
        }
    }
}
