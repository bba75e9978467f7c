//! What a driver's network looks at: the maps of a saliency method laid over frames, for people.

use pdk_model::component::ComponentSpec;
use pdk_sdk::error::Result;
use pdk_sdk::prelude::{Frame, FrameBuf, Key, Saliency};
use pdk_sdk::seed;

use crate::maps::{context, map};
use crate::moment::Moment;
use pdk_components::registry::Registry;

/// A saliency method that shows what a network looks at.
pub struct View {
    method: Box<dyn Saliency>,
    label: String,
    key: Key,
}

impl View {
    /// A method with its parameters, the model among them.
    ///
    /// # Errors
    /// If there is no such method, or it refuses its parameters.
    pub fn new(registry: &Registry, by: &ComponentSpec, seed: u64) -> Result<Self> {
        let (method, _) = registry.saliency(&by.name, &by.parameters)?;
        Ok(Self { method, label: format!("saliency `{}`", by.name), key: seed::key(seed, "maps", 0) })
    }

    /// The map of a frame, a number from 0 to 1 for each of its pixels.
    ///
    /// # Errors
    /// If the method fails.
    pub fn map(&mut self, frame: Frame<'_>, moment: &Moment<'_>) -> Result<Vec<f32>> {
        map(&mut *self.method, &self.label, frame, &context(moment, &self.key))
    }

    /// A frame with its map laid over.
    ///
    /// # Errors
    /// If the method fails.
    pub fn picture(&mut self, frame: Frame<'_>, moment: &Moment<'_>) -> Result<FrameBuf> {
        Ok(heat(frame, &self.map(frame, moment)?))
    }
}

/// The colours of a saliency map from 0 to 1: what matters is lit from blue over green to red.
fn heat_color(value: f32) -> [f32; 3] {
    let ramp = |middle: f32| (1.5 - (4.0 * value - middle).abs()).clamp(0.0, 1.0) * 255.0;
    [ramp(3.0), ramp(2.0), ramp(1.0)]
}

/// A frame with a saliency map of its size laid over, through which it shows.
pub fn heat(frame: Frame<'_>, values: &[f32]) -> FrameBuf {
    let mut picture = FrameBuf::new(frame.width(), frame.height());
    let mut view = picture.as_mut();
    for (at, value) in values.iter().enumerate().take(frame.width() * frame.height()) {
        let (x, y) = (at % frame.width(), at / frame.width());
        let (lit, from) = (heat_color(*value), frame.pixel(x, y));
        view.set_pixel(x, y, [0, 1, 2].map(|c| (f32::from(from[c]) * 0.5 + lit[c] * 0.5 + 0.5) as u8));
    }
    picture
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_matters_most_is_red_and_what_does_not_is_blue() {
        let frame = FrameBuf::new(3, 1);
        let heat = heat(frame.as_ref(), &[0.0, 0.5, 1.0]);
        let [least, middle, most] = [0, 1, 2].map(|x| heat.as_ref().pixel(x, 0));
        assert!(least[2] > 50 && least[0] == 0 && most[0] > 50 && most[2] == 0 && middle[1] > 120);
    }
}
