//! Late speed: the driver gets the speed of some time ago.

use pdk_sdk::prelude::*;

/// Readings that it asks for: two seconds at 60 frames a second.
const FRAMES: u32 = 120;

/// Tells the speed of some time ago.
pub struct LateSpeed;

impl Component for LateSpeed {
    fn description() -> Description {
        crate::fault("late_speed", "Tells the driver the speed of some time ago", ActsOn::Observation)
            .history(FRAMES)
            .mathematics("speed(t) = v(the latest frame of t - delay or before)")
            .source("Delayed sensor data, one of the timing faults of AVFI: Jha et al., AVFI: Fault injection for autonomous vehicles (2018)")
            .parameter(
                Parameter::by_level(
                    "delay",
                    [0.1, 0.2, 0.4, 0.7, 1.0],
                    "how much later the driver gets a reading; at most 120 frames",
                )
                .range(0.0, 2.0)
                .unit("s"),
            )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for LateSpeed {
    fn observe(&mut self, observation: DriveContext, cx: &Context<'_>) -> Result<DriveContext> {
        // Times are sums of steps, so they miss a multiple of a step by a rounding error.
        let latest = cx.time - cx.number("delay") + 1e-6;
        if cx.time <= latest {
            return Ok(observation);
        }
        let mut speed = observation.speed;
        for earlier in cx.signals.iter() {
            speed = earlier.given[1];
            if earlier.time <= latest {
                break;
            }
        }
        Ok(DriveContext { speed, ..observation })
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::serde_json::json;

    use super::LateSpeed;
    use crate::test_drive::speeds;

    #[test]
    fn a_reading_comes_as_much_later_as_asked_for() {
        // Twenty readings a second. Before the first one came, the driver gets the oldest there is.
        let readings: Vec<f64> = (0..60).map(f64::from).collect();
        for (delay, frames) in [(0.0, 0), (0.05, 1), (0.12, 3), (1.0, 20)] {
            let expected: Vec<f64> = (0..60i32).map(|index| f64::from((index - frames).max(0))).collect();
            assert_eq!(speeds::<LateSpeed>(&json!({"delay": delay}), 0.0, &readings), expected, "{delay} s");
        }
    }

    #[test]
    fn rules() {
        pdk_sdk::testing::perturbation::<LateSpeed>();
    }
}
