//! What every decoder of clips gives.

use pdk_sdk::prelude::*;

use crate::picture::Picture;

/// The decoded frames of a clip, one after the other.
pub trait Frames {
    /// Reads the next frame; false at the end.
    ///
    /// # Errors
    /// If the clip is damaged or cut off.
    fn next(&mut self, into: &mut Picture) -> Result<bool>;

    /// When the frame that was read last ends, in seconds after the first one began.
    fn end(&self) -> f64;
}
