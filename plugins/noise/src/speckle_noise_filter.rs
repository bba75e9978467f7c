//! Speckle noise: brightness flickers in proportion to itself.

use pdk_sdk::ops::noise::speckle_noise;
use pdk_sdk::prelude::*;

/// Multiplies every value of every channel by a normal random number with mean 1.
pub struct SpeckleNoise;

impl Component for SpeckleNoise {
    fn description() -> Description {
        Description::perturbation(
            "speckle_noise_filter",
            "Multiplies every value by a normally distributed number around 1, anew in every frame",
        )
        .family("noise")
        .keeps_geometry().mathematics("trunc(clip(v n)), n ~ N(1, sigma) for each value").drawn_per_frame("the noise")
        .source("Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations (2019)")
        .parameter(
            Parameter::by_level("sigma", [0.02, 0.05, 0.09, 0.14, 0.2], "standard deviation of the multiplier")
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
    use super::SpeckleNoise;
    use crate::golden;

    #[test]
    fn matches_the_published_statistics() {
        golden::matches_statistics::<SpeckleNoise>();
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<SpeckleNoise>(&pdk_sdk::serde_json::Value::Null);
    }

    #[test]
    fn draws_anew_for_every_frame() {
        golden::draws_anew_for_every_frame::<SpeckleNoise>();
    }
}
