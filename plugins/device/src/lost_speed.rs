//! Lost speed: readings of the speed are lost in bursts.

use pdk_sdk::bursts;
use pdk_sdk::prelude::*;

/// Loses readings.
pub struct LostSpeed;

impl Component for LostSpeed {
    fn description() -> Description {
        let description = crate::fault(
            "lost_speed",
            "Loses readings of the speed in bursts, and tells the driver the last one meanwhile",
            ActsOn::Observation,
        )
        .version(2)
        .history(1)
        .mathematics("speed(t) = v(last t' <= t that is not lost)")
        .drawn_per_frame("whether a burst begins, and its length")
        .source("Burst losses as in Gilbert, Capacity of a burst-noise channel (1960); stuck values of sensors in ISO 26262-5:2018, annex D");
        bursts::described(description, "readings", [0.1, 0.2, 0.35, 0.5, 0.7], [2.0, 4.0, 6.0, 10.0, 16.0]).parameter(
            Parameter::choice(
                "shows",
                &["last", "zero", "unknown"],
                "what the driver gets in place of a lost reading: last: the last one that came; zero: a standing vehicle; unknown: that the \
                 speed is not known",
            ),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for LostSpeed {
    fn observe(&mut self, observation: DriveContext, cx: &Context<'_>) -> Result<DriveContext> {
        if !bursts::of(cx).lose(cx.frame_index, cx) {
            return Ok(observation);
        }
        let speed = match cx.integer("shows") {
            // Before the first reading that came there is none.
            0 => cx.signals.back(1).map_or(0.0, |before| before.passed[1]),
            1 => 0.0,
            _ => f64::NAN,
        };
        Ok(DriveContext { speed, ..observation })
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::serde_json::json;

    use super::LostSpeed;
    use crate::test_drive::speeds;

    #[test]
    fn the_speed_is_always_that_of_the_last_reading_that_came() {
        let true_speeds: Vec<f64> = (1..=600).map(f64::from).collect();
        let observed = speeds::<LostSpeed>(&json!({"lost": 0.5, "burst": 5}), 0.0, &true_speeds);
        let mut latest = 0.0;
        for (speed, observed) in true_speeds.iter().zip(&observed) {
            assert!(observed == speed || *observed == latest, "{observed} at {speed} after {latest}");
            latest = *observed;
        }
        let lost = observed.iter().zip(&true_speeds).filter(|(observed, speed)| observed != speed).count();
        assert!((200..400).contains(&lost), "{lost}");
    }

    #[test]
    fn what_is_lost_can_be_zero_or_unknown() {
        let observed = |shows| speeds::<LostSpeed>(&json!({"lost": 1.0, "shows": shows}), 0.0, &[7.0; 3]);
        assert_eq!(observed("zero"), [0.0; 3]);
        assert!(observed("unknown").iter().all(|speed| speed.is_nan()));
        // Nothing came before.
        assert_eq!(observed("last"), [0.0; 3]);
    }

    #[test]
    fn rules() {
        pdk_sdk::testing::perturbation::<LostSpeed>();
    }
}
