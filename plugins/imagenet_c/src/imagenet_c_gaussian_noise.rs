//! Gaussian noise.

use pdk_sdk::ops::noise::gaussian_noise_truncated;
use pdk_sdk::prelude::*;

use crate::suite::corruption;

/// Adds normally distributed noise.
pub struct GaussianNoise;

impl Component for GaussianNoise {
    fn description() -> Description {
        corruption("gaussian_noise", "Adds normally distributed noise to every value, anew in every frame")
            .mathematics("255 clip(v/255 + n), n ~ N(0, sigma) for each value")
            .drawn_per_frame("the noise")
            .parameter(
                Parameter::by_level(
                    "sigma",
                    [0.08, 0.12, 0.18, 0.26, 0.38],
                    "standard deviation of the noise",
                )
                .range(0.0, 1.0)
                .unit("of full scale"),
            )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for GaussianNoise {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        gaussian_noise_truncated(src, dst, cx.number("sigma"), &mut cx.frame_random());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{frame, perturbed};

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<GaussianNoise>();
    }

    #[test]
    fn the_noise_has_its_mean_and_deviation() {
        // The dropped fraction takes half a level of the mean.
        let (mean, deviation) =
            crate::testing::moments(&perturbed::<GaussianNoise>(&frame(128, 200, 200), 0.0, 1));
        let wanted = 0.08 * 255.0;
        assert!(
            (mean - 127.5).abs() < 0.3 && (deviation - wanted).abs() < 0.3,
            "{mean} {deviation} {wanted}"
        );
    }
}
