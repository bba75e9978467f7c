//! Pixelation: a camera with too few pixels.
//!
//! The published code means to average when it shrinks and to repeat pixels when it enlarges, but passes both wishes in
//! the wrong place, so that both steps interpolate linearly: a blur with aliasing, without blocks. The variant
//! `published` keeps that; `corrected` averages and repeats.

use pdk_sdk::ops::resample::{Workspace, resize_area, resize_nearest};
use pdk_sdk::ops::resize::resize_linear;
use pdk_sdk::prelude::*;

/// Shrinks the frame and enlarges it again.
pub struct Pixelate {
    small: FrameBuf,
    workspace: Workspace,
}

impl Component for Pixelate {
    fn description() -> Description {
        Description::perturbation("pixelate", "Shrinks the frame and enlarges it again")
            .family("distortion")
            .keeps_geometry().mathematics("enlarge(shrink(image, factor))").divergence("Only with `variant=corrected`: it averages areas and repeats pixels; the published tool interpolates both ways, so that no blocks appear.")
            .source("Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations (2019)")
            .parameter(
                Parameter::by_level(
                    "factor",
                    [0.85, 0.55, 0.35, 0.2, 0.1],
                    "factor of width and height, which are rounded down to whole pixels",
                )
                .range(0.001, 1.0),
            )
            .parameter(Parameter::choice(
                "variant",
                &["published", "corrected"],
                "published: linear interpolation both ways, which blurs and makes no blocks; corrected: means down, repeated pixels up",
            ))
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self { small: FrameBuf::new(1, 1), workspace: Workspace::default() })
    }
}

impl Perturbation for Pixelate {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let factor = cx.number("factor");
        let scaled = |length: usize| ((length as f64 * factor) as usize).max(1);
        self.small.resize(scaled(src.width()), scaled(src.height()));
        if cx.integer("variant") == 0 {
            resize_linear(src, self.small.as_mut());
            resize_linear(self.small.as_ref(), dst);
        } else {
            resize_area(src, self.small.as_mut(), &mut self.workspace);
            resize_nearest(self.small.as_ref(), dst);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::prelude::*;
    use pdk_sdk::serde_json::{Value, json};

    use super::Pixelate;
    use crate::golden;

    #[test]
    fn matches_the_published_outputs() {
        golden::matches_outputs::<Pixelate>(0.1);
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<Pixelate>(&Value::Null);
        golden::writes_exactly_the_frame::<Pixelate>(&json!({"variant": "corrected"}));
    }

    #[test]
    fn holds_what_every_perturbation_has_to_hold() {
        pdk_sdk::testing::perturbation::<Pixelate>();
    }

    #[test]
    fn strength_grows_with_the_intensity() {
        golden::strength_grows::<Pixelate>(&Value::Null, &golden::quarters(0.0, 4.0), true);
        golden::strength_grows::<Pixelate>(
            &json!({"variant": "corrected"}),
            &golden::quarters(0.0, 4.0),
            true,
        );
    }

    #[test]
    fn the_corrected_variant_makes_blocks_of_means() {
        let src = FrameBuf::from_vec((0..12 * 8 * 3).map(|i| (i * 89 % 251) as u8).collect(), 12, 8).unwrap();
        let given = json!({"variant": "corrected", "factor": 0.25});
        let out = golden::perturb::<Pixelate>(&given, src.as_ref(), 0.0, &Key::default(), 0);
        for (x, y) in (0..12).flat_map(|x| (0..8).map(move |y| (x, y))) {
            let block = (0..16).map(|i| src.as_ref().pixel(x / 4 * 4 + i % 4, y / 4 * 4 + i / 4));
            let sums = block.fold([0u32; 3], |sums, p| [0, 1, 2].map(|c| sums[c] + u32::from(p[c])));
            let mean = sums.map(|sum| (f64::from(sum) / 16.0).round_ties_even() as u8);
            assert_eq!(out.as_ref().pixel(x, y), mean, "{x} {y}");
        }
    }
}
