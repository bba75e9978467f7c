//! Drivers: the models under test.

pub use pdk_model::control::Control;
use pdk_ops::Frame;

use crate::error::Result;

/// The name under which [`Driver::info`] gives the conventions that a driver assumes because nothing says otherwise, such as the range
/// of pixel values. A run reports them once at its start.
pub const ASSUMED: &str = "assumed";

/// Looks at a frame and steers.
pub trait Driver: Send {
    /// Forgets everything about earlier frames. Called before each scenario.
    ///
    /// # Errors
    /// If the driver cannot start over.
    fn reset(&mut self) -> Result<()> {
        Ok(())
    }

    /// Decides what to do.
    ///
    /// # Errors
    /// If the driver cannot use the frame, for instance because of its size.
    fn drive(&mut self, frame: Frame<'_>, cx: &DriveContext) -> Result<Control>;

    /// What was decided when the instance was made and is not among its parameters, such as the library that runs a
    /// network: names and values for the record.
    fn info(&self) -> Vec<(String, String)> {
        Vec::new()
    }
}

/// What a driver knows besides the frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DriveContext {
    /// The number of the frame in its sequence, from 0.
    pub frame_index: u64,
    /// Simulation time in seconds since the start of the sequence.
    pub time: f64,
    /// The vehicle's speed in metres per second; not a number if it is not known, as in a dataset.
    pub speed: f64,
}

impl Default for DriveContext {
    /// The first frame, at an unknown speed.
    fn default() -> Self {
        Self { frame_index: 0, time: 0.0, speed: f64::NAN }
    }
}
