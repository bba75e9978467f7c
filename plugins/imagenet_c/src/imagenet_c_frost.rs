//! Frost as in ImageNet-C: a window of a picture of ice, added to the frame.
//!
//! The pictures there are photographs, which are not part of pdk. Here a window of a drawn texture has the means and deviations of
//! one of them, which is drawn as well.

use pdk_sdk::ops::ice;
use pdk_sdk::ops::point::truncated;
use pdk_sdk::prelude::*;

use crate::simd::vectorised;
use crate::suite::{MadeFor, corruption};

/// Means of red, green and blue of each photograph, and the deviation of its brightness.
const PHOTOGRAPHS: [([f64; 3], f64); 5] = [
    ([78.0, 149.0, 166.0], 20.0),
    ([201.0, 205.0, 214.0], 22.0),
    ([201.0, 205.0, 214.0], 22.0),
    ([138.0, 153.0, 165.0], 29.0),
    ([112.0, 123.0, 135.0], 43.0),
];
/// The texture is so much larger than the frame.
const LARGER: f64 = 1.1;

/// Adds ice to a darkened frame.
#[derive(Default)]
pub struct Frost {
    texture: Texture,
    made_for: MadeFor,
    /// The window, as bytes.
    ice: FrameBuf,
}

/// Shades with a mean of 0 and a deviation of 1.
#[derive(Default)]
struct Texture {
    width: usize,
    height: usize,
    shades: Vec<f64>,
}

impl Texture {
    /// Draws it, unless it has this size already.
    fn fit(&mut self, width: usize, height: usize) {
        if (self.width, self.height) == (width, height) {
            return;
        }
        (self.width, self.height) = (width, height);
        self.shades = ice::draw(width, height).iter().map(|texel| texel.rgb[1]).collect();
        let count = self.shades.len() as f64;
        let mean = self.shades.iter().sum::<f64>() / count;
        self.shades.iter_mut().for_each(|shade| *shade -= mean);
        let variance = self.shades.iter().map(|shade| shade * shade).sum::<f64>() / count;
        let scale = if variance > 0.0 { 1.0 / variance.sqrt() } else { 0.0 };
        self.shades.iter_mut().for_each(|shade| *shade *= scale);
    }
}

impl Component for Frost {
    fn description() -> Description {
        corruption("frost", "Adds a window of a texture of ice to the darkened frame, the same one in all frames of a sequence")
            .mathematics("a v + b ice")
            .drawn_per_sequence("the window, and which photograph's means and deviation it has")
            .divergence("The texture is the project's own, with the means and deviations of the photographs of the published package.")
            .parameter(Parameter::by_level("weight", [1.0, 0.8, 0.7, 0.65, 0.6], "weight of the frame").range(0.0, 1.0))
            .parameter(Parameter::by_level("ice", [0.4, 0.6, 0.7, 0.7, 0.75], "weight of the ice").range(0.0, 1.0))
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self::default())
    }
}

impl Perturbation for Frost {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        if self.made_for.is_new([src.width(), src.height()], Some(*cx.key()), &[]) {
            self.draw(src.width(), src.height(), &mut cx.sequence_random());
        }
        let (frame, ice) = (cx.number("weight") as f32, cx.number("ice") as f32);
        for ((from, to), cold) in src.rows().zip(dst.rows_mut()).zip(self.ice.as_ref().rows()) {
            add_ice(from, cold, to, frame, ice);
        }
        Ok(())
    }
}

vectorised! {
    fn add_ice / add_ice_avx2 / add_ice_avx512 (from: &[u8], cold: &[u8], to: &mut [u8], frame: f32, ice: f32) {
        for ((&from, to), &cold) in from.iter().zip(to).zip(cold) {
            *to = truncated(frame * f32::from(from) + ice * f32::from(cold));
        }
    }
}

impl Frost {
    fn draw(&mut self, width: usize, height: usize, random: &mut Random) {
        let larger = |length: usize| (length as f64 * LARGER).ceil() as usize;
        let (wide, high) = (larger(width), larger(height));
        self.texture.fit(wide, high);
        let (means, deviation) = PHOTOGRAPHS[random.below(PHOTOGRAPHS.len() as u32) as usize];
        let left = random.below((wide - width).max(1) as u32) as usize;
        let top = random.below((high - height).max(1) as u32) as usize;
        self.ice.resize(width, height);
        let mut ice = self.ice.as_mut();
        for y in 0..height {
            let shades = &self.texture.shades[(top + y) * wide + left..][..width];
            for (x, shade) in shades.iter().enumerate() {
                ice.set_pixel(
                    x,
                    y,
                    means.map(|mean| (mean + deviation * shade).round().clamp(0.0, 255.0) as u8),
                );
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::prelude::*;
    use pdk_sdk::serde_json::{Value, json};

    use super::Frost;
    use crate::golden;

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<Frost>();
    }

    #[test]
    fn keeps_nothing_that_does_not_fit() {
        crate::testing::keeps_nothing_that_does_not_fit::<Frost>();
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<Frost>(&Value::Null);
    }

    #[test]
    fn the_window_stays_for_a_sequence_and_differs_between_sequences() {
        let src = FrameBuf::new(64, 48);
        let at = |key, index| golden::perturb::<Frost>(&json!({}), src.as_ref(), 4.0, &Key([key; 32]), index);
        assert_eq!(at(1, 0), at(1, 9));
        assert_ne!(at(1, 0), at(2, 0));
        // Of a black frame the ice is left.
        let mean = |frame: FrameBuf| {
            frame.data().iter().map(|&v| f64::from(v)).sum::<f64>() / frame.data().len() as f64
        };
        let means: Vec<f64> = (0..8).map(|key| mean(at(key, 0))).collect();
        assert!(means.iter().all(|mean| (80.0..165.0).contains(mean)), "{means:?}");
    }
}
