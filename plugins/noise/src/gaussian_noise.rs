//! Gaussian noise: a sensor in low light.

use pdk_sdk::ops::noise::gaussian_noise;
use pdk_sdk::prelude::*;

/// Adds a normal random number to every value of every channel.
pub struct GaussianNoise;

impl Component for GaussianNoise {
    fn description() -> Description {
        Description::perturbation("gaussian_noise", "Adds normally distributed noise to every value, anew in every frame")
            .family("noise")
            .keeps_geometry().mathematics("255 clip(v/255 + n), n ~ N(0, sigma) for each value").drawn_per_frame("the noise")
            .source("Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations (2019)")
            .parameter(
                Parameter::by_level("sigma", [0.03, 0.06, 0.12, 0.18, 0.22], "standard deviation of the noise")
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
        gaussian_noise(src, dst, cx.number("sigma"), &mut cx.frame_random());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::GaussianNoise;
    use crate::golden;

    #[test]
    fn matches_the_published_statistics() {
        golden::matches_statistics::<GaussianNoise>();
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<GaussianNoise>(&pdk_sdk::serde_json::Value::Null);
    }

    #[test]
    fn draws_anew_for_every_frame() {
        golden::draws_anew_for_every_frame::<GaussianNoise>();
    }
}
