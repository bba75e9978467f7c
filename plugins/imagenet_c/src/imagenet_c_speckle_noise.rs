//! Speckle: factors around 1.

use pdk_sdk::ops::noise::speckle_noise;
use pdk_sdk::prelude::*;

use crate::suite::corruption;

/// Multiplies values by normally distributed numbers.
pub struct SpeckleNoise;

impl Component for SpeckleNoise {
    fn description() -> Description {
        corruption(
            "speckle_noise",
            "Multiplies every value by a normally distributed number around 1, anew in every frame",
        )
        .mathematics("255 clip(v/255 (1 + n)), n ~ N(0, sigma) for each value")
        .drawn_per_frame("the noise")
        .parameter(
            Parameter::by_level("sigma", [0.15, 0.2, 0.35, 0.45, 0.6], "standard deviation of the factors")
                .range(0.0, 1.0),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for SpeckleNoise {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        speckle_noise(src, dst, cx.number("sigma"), &mut cx.frame_random());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{frame, perturbed};

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<SpeckleNoise>();
    }

    #[test]
    fn the_noise_has_its_mean_and_deviation() {
        let (mean, deviation) =
            crate::testing::moments(&perturbed::<SpeckleNoise>(&frame(128, 200, 200), 0.0, 1));
        let wanted = 0.15 * 128.0;
        assert!(
            (mean - 127.5).abs() < 0.5 && (deviation - wanted).abs() < 0.5,
            "{mean} {deviation} {wanted}"
        );
    }
}
