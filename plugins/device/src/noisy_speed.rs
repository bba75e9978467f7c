//! Noisy speed: the speed that the driver gets scatters around the true one.

use pdk_sdk::prelude::*;

use crate::with_speed;

/// Adds normal noise to the speed.
pub struct NoisySpeed;

impl Component for NoisySpeed {
    fn description() -> Description {
        crate::fault("noisy_speed", "Adds normally distributed noise to the speed that the driver gets", ActsOn::Observation)
            .mathematics("speed(t) = max(0, v(t) + sigma n), n normal")
            .drawn_per_frame("the noise")
            .source("White noise of a sensor; sensor noise is among the faults of AVFI: Jha et al., AVFI: Fault injection for autonomous vehicles (2018)")
            .parameter(
                Parameter::by_level("sigma", [0.2, 0.5, 1.0, 2.0, 4.0], "standard deviation of the noise")
                    .range(0.0, 100.0)
                    .unit("m/s"),
            )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for NoisySpeed {
    fn observe(&mut self, observation: DriveContext, cx: &Context<'_>) -> Result<DriveContext> {
        Ok(with_speed(observation, observation.speed + cx.number("sigma") * cx.frame_random().normal()))
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::serde_json::json;

    use super::NoisySpeed;
    use crate::test_drive::speeds;

    #[test]
    fn the_noise_has_the_deviation_that_was_asked_for() {
        let observed = speeds::<NoisySpeed>(&json!({"sigma": 1.5}), 0.0, &[20.0; 4_000]);
        let mean = observed.iter().sum::<f64>() / observed.len() as f64;
        let variance =
            observed.iter().map(|speed| (speed - mean) * (speed - mean)).sum::<f64>() / observed.len() as f64;
        assert!((mean - 20.0).abs() < 0.08, "{mean}");
        assert!((variance - 2.25).abs() < 0.2, "{variance}");
        assert!(
            speeds::<NoisySpeed>(&json!({"sigma": 9}), 0.0, &[0.1; 400]).iter().all(|speed| *speed >= 0.0)
        );
    }

    #[test]
    fn rules() {
        pdk_sdk::testing::perturbation::<NoisySpeed>();
    }
}
