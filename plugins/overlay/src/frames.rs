//! What every decoder of clips gives.

use pdk_sdk::prelude::*;

use crate::picture::Picture;

/// The decoded frames of a clip, one after the other.
pub trait Frames {
    /// Reads the next frame; false at the end.
    ///
    /// # Errors
    /// Where the clip is damaged or cut off.
    fn next(&mut self, into: &mut Picture) -> Result<bool>;

    /// Frames per second, as far as the frames read so far tell.
    fn rate(&self) -> f64;
}
