//! Masks: components that say where frames are to be perturbed.

use pdk_ops::Frame;

use crate::error::Result;
use crate::saliency::{HeatmapMut, MapContext};

/// Says how much of each pixel is to be perturbed.
///
/// The weights depend on the frame, the parameters and the key in the context alone, so that they can be made for any frame on its
/// own.
pub trait Mask: Send {
    /// Writes a value from 0 (stays as it is) to 1 (is perturbed) for each pixel of the frame, as the camera saw it. `out` is as
    /// large as the frame and starts out with unspecified values, all of which have to be written.
    ///
    /// # Errors
    /// If it cannot be said of this frame.
    fn weights(&mut self, frame: Frame<'_>, cx: &MapContext<'_>, out: HeatmapMut<'_>) -> Result<()>;
}
