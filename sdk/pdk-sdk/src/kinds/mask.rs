//! Masks: components that say where frames are to be perturbed.

use pdk_abi::{MaskFunctionsRef, empty, load};
use pdk_ops::Frame;
use pdk_seed::Key;

use super::saliency::{self, HeatmapMut, MapContext};
use crate::abi::convert;
use crate::abi::host::call::{Object, call};
use crate::abi::plugin::call::functions;
use crate::config::Config;
use crate::describe::Description;
use crate::error::Result;
use crate::testing::sample::{Make, SIZES, ensure, sample_frame};

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

functions! { Mask as MaskFunctions:
    fn weights(
        component,
        _,
        frame: *const pdk_abi::Frame,
        context: *const pdk_abi::MapContext,
        map: *const pdk_abi::Heatmap
    ) {
        let raw = load(context, saliency::unsaid_map_context());
        let key = Key(raw.key);
        let pdk_abi::Heatmap { values, width, height, .. } = load(map, empty());
        let values = convert::slice_mut(values, width.saturating_mul(height));
        let out = HeatmapMut::new(values, width, height)?;
        component.weights(convert::source(frame)?, &saliency::read_map_context(&raw, &key), out)
    }
}

/// An instance in a plugin.
pub(crate) struct Host(Object<MaskFunctionsRef>);

impl Host {
    pub(crate) fn new(object: Object<MaskFunctionsRef>) -> Result<Self> {
        Ok(Self(object))
    }
}

impl Mask for Host {
    fn weights(&mut self, frame: Frame<'_>, cx: &MapContext<'_>, mut out: HeatmapMut<'_>) -> Result<()> {
        let Object { pointer, functions, .. } = self.0;
        let (frame, context) = (convert::frame(frame), saliency::map_context(cx));
        let (width, height) = (out.width(), out.height());
        let heatmap = pdk_abi::Heatmap { values: out.values_mut().as_mut_ptr(), width, height, ..empty() };
        // SAFETY: everything lives through the call.
        call(|error| unsafe { functions.weights()(pointer, &frame, &context, &heatmap, error) })
    }
}

/// Checks that a mask has values from 0 to 1 for frames of several sizes and comes out the same twice.
///
/// # Errors
/// The first check that fails.
pub fn check(_: &Description, config: &Config, make: Make<'_, dyn Mask>) -> Result<()> {
    let mut mask = make(config)?;
    let key = Key([9; 32]);
    for (width, height) in SIZES {
        let frame = sample_frame(width, height);
        let mut maps = [vec![f32::NAN; width * height], vec![f32::NAN; width * height]];
        for map in &mut maps {
            mask.weights(
                frame.as_ref(),
                &MapContext::new(5, 0.25, &key),
                HeatmapMut::new(map, width, height)?,
            )?;
            ensure(map.iter().all(|value| (0.0..=1.0).contains(value)), || {
                format!(
                    "on a frame of {width}x{height} it has values that are not from 0 to 1, or that were not written"
                )
            })?;
        }
        ensure(maps[0] == maps[1], || "the same frame gives two masks".to_owned())?;
    }
    Ok(())
}
