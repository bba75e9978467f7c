//! Biased speed: the speed that the driver gets is wrong by a share, and by a constant.

use pdk_sdk::prelude::*;

use crate::with_speed;

/// Scales and shifts the speed.
pub struct BiasedSpeed;

impl Component for BiasedSpeed {
    fn description() -> Description {
        crate::fault(
            "biased_speed",
            "Tells the driver a speed that is too low, or too high, by a share of it",
            ActsOn::Observation,
        )
        .mathematics("speed(t) = max(0, (1 + share) v(t) + offset)")
        .source("Offset errors of sensors in ISO 26262-5:2018, annex D; a share is what wheels of another circumference make of it")
        .parameter(
            Parameter::by_level(
                "share",
                [-0.05, -0.1, -0.2, -0.35, -0.5],
                "by which share the speed is too high; below 0 it is too low, so that a driver that holds a speed goes faster",
            )
            .range(-1.0, 5.0),
        )
        .parameter(
            Parameter::number("offset", 0.0, "what is added to the speed").range(-100.0, 100.0).unit("m/s"),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for BiasedSpeed {
    fn observe(&mut self, observation: DriveContext, cx: &Context<'_>) -> Result<DriveContext> {
        Ok(with_speed(observation, (1.0 + cx.number("share")) * observation.speed + cx.number("offset")))
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::serde_json::json;

    use super::BiasedSpeed;
    use crate::test_drive::speeds;

    #[test]
    fn the_speed_is_scaled_and_shifted_and_never_below_zero() {
        let given = json!({"share": -0.5, "offset": -1});
        assert_eq!(speeds::<BiasedSpeed>(&given, 0.0, &[10.0, 2.0, 1.0]), [4.0, 0.0, 0.0]);
        assert!(speeds::<BiasedSpeed>(&given, 0.0, &[f64::NAN])[0].is_nan());
    }

    #[test]
    fn rules() {
        pdk_sdk::testing::perturbation::<BiasedSpeed>();
    }
}
