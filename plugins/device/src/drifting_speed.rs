//! Drifting speed: the error of the speed that the driver gets grows over time.

use pdk_sdk::prelude::*;

use crate::with_speed;

/// Adds an error that grows evenly.
pub struct DriftingSpeed;

impl Component for DriftingSpeed {
    fn description() -> Description {
        crate::fault(
            "drifting_speed",
            "Tells the driver a speed whose error grows over time",
            ActsOn::Observation,
        )
        .mathematics("speed(t) = max(0, v(t) + drift t)")
        .source("Drift of sensors in ISO 26262-5:2018, annex D")
        .parameter(
            Parameter::by_level(
                "drift",
                [-0.02, -0.05, -0.1, -0.2, -0.4],
                "how much the error grows in a second; below 0 the speed is too low, so that a driver that holds a speed goes faster",
            )
            .range(-100.0, 100.0)
            .unit("m/s²"),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for DriftingSpeed {
    fn observe(&mut self, observation: DriveContext, cx: &Context<'_>) -> Result<DriveContext> {
        Ok(with_speed(observation, observation.speed + cx.number("drift") * cx.time))
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::serde_json::json;

    use super::DriftingSpeed;
    use crate::test_drive::speeds;

    #[test]
    fn the_error_grows_evenly_and_the_speed_is_never_below_zero() {
        // Twenty frames a second.
        let observed = speeds::<DriftingSpeed>(&json!({"drift": -2}), 0.0, &[4.0; 100]);
        assert_eq!((observed[0], observed[10], observed[20], observed[99]), (4.0, 3.0, 2.0, 0.0));
    }

    #[test]
    fn rules() {
        pdk_sdk::testing::perturbation::<DriftingSpeed>();
    }
}
