//! Predictors: networks that say something about a frame other than how to steer, such as what it shows.

use pdk_ops::Frame;

use crate::driver::DriveContext;
use crate::error::Result;

/// Looks at a frame and gives values by name: scores of classes, boxes, a map. A metric says how good they are.
pub trait Predictor: Send {
    /// Forgets everything about earlier frames. Called before each sequence.
    ///
    /// # Errors
    /// If the predictor cannot start over.
    fn reset(&mut self) -> Result<()> {
        Ok(())
    }

    /// What the predictor makes of a frame: the same names in the same order for every frame.
    ///
    /// # Errors
    /// If the predictor cannot use the frame, for instance because of its size.
    fn predict(&mut self, frame: Frame<'_>, cx: &DriveContext) -> Result<Vec<Output>>;

    /// What was decided when the instance was made and is not among its parameters, such as the library that runs a
    /// network: names and values for the record.
    fn info(&self) -> Vec<(String, String)> {
        Vec::new()
    }
}

/// Values under a name.
#[derive(Debug, Clone, PartialEq)]
pub struct Output {
    /// The name.
    pub name: String,
    /// How many values there are along each axis.
    pub shape: Vec<usize>,
    /// The values, those of the last axis next to each other.
    pub values: Vec<f32>,
}
