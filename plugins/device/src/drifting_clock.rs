//! Drifting clock: the time that the driver gets runs off.

use pdk_sdk::prelude::*;

/// Lets the clock run fast, or slow.
pub struct DriftingClock;

impl Component for DriftingClock {
    fn description() -> Description {
        crate::fault("drifting_clock", "Tells the driver a time that runs off", ActsOn::Observation)
            .mathematics("time(t) = (1 + rate) t + offset")
            .source("Frequency error of an oscillator, as in IEEE 1139; quartz without synchronisation runs off by 1e-5 to 1e-4, the higher levels are those of a clock that counts wrongly")
            .parameter(
                Parameter::by_level(
                    "rate",
                    [0.0001, 0.001, 0.01, 0.05, 0.2],
                    "by which share the clock is fast; below 0 it is slow",
                )
                .range(-0.9, 10.0),
            )
            .parameter(Parameter::number("offset", 0.0, "how far it is ahead at the start").range(-1e5, 1e5).unit("s"))
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for DriftingClock {
    fn observe(&mut self, observation: DriveContext, cx: &Context<'_>) -> Result<DriveContext> {
        Ok(DriveContext {
            time: (1.0 + cx.number("rate")) * observation.time + cx.number("offset"),
            ..observation
        })
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::serde_json::json;

    use super::DriftingClock;
    use crate::test_drive::observed;

    #[test]
    fn the_time_runs_off_and_the_speed_stays() {
        let observed = observed::<DriftingClock>(&json!({"rate": 0.5, "offset": 3}), 0.0, &[8.0; 41]);
        assert_eq!((observed[0], observed[40]), ([3.0, 8.0], [6.0, 8.0]));
    }

    #[test]
    fn rules() {
        pdk_sdk::testing::perturbation::<DriftingClock>();
    }
}
