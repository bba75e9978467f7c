//! The part of a drive that a perturbation is limited to.

use pdk_model::during::{During, Span};
use pdk_model::region::Region;
use pdk_sdk::error::Result;

use crate::mask::Mask;

/// A part made ready for frames.
pub struct Part {
    during: During,
    /// The box of what is perturbed, and everything but that of what is left out.
    masks: [Option<Mask>; 2],
}

impl Part {
    /// A part.
    ///
    /// # Errors
    /// None; boxes need no files.
    pub fn new(during: &During) -> Result<Self> {
        let mask = |span: Span, inverted| -> Result<Option<Mask>> {
            let mask = span.area.map(|area| Mask::new(&Region::Box(area))).transpose()?;
            Ok(mask.map(|mask| mask.inverted(inverted)))
        };
        let masks = [mask(during.span, false)?, mask(during.except.unwrap_or_default(), true)?];
        Ok(Self { during: *during, masks })
    }

    /// Whether nothing of the frame at this time, in seconds, is perturbed.
    pub fn spares(&self, time: f64) -> bool {
        let left_out =
            self.during.except.is_some_and(|except| except.area.is_none() && except.contains(time));
        left_out || !self.during.span.contains(time)
    }

    /// How much of each pixel of the frame at this time is changed, 0 to 255, by what is perturbed and by what is left out of it; nothing
    /// if they do not limit it.
    pub fn weights(&mut self, time: f64, width: usize, height: usize) -> [Option<&[u8]>; 2] {
        let [within, without] = &mut self.masks;
        let left_out = self.during.except.is_some_and(|except| except.contains(time));
        [within.as_mut(), without.as_mut().filter(|_| left_out)]
            .map(|mask| mask.map(|mask| mask.weights(width, height)))
    }
}
