//! Steering play: the wheels follow only when the play is used up.

use pdk_sdk::prelude::*;

/// Lets the steering have play.
pub struct SteeringPlay;

impl Component for SteeringPlay {
    fn description() -> Description {
        crate::fault(
            "steering_play",
            "Gives the steering play, so that the wheels follow only when it is used up",
            ActsOn::Control,
        )
        .history(1)
        .mathematics("applied(t) = clip(applied(t - 1), steering(t) - play / 2, steering(t) + play / 2)")
        .source(
            "Backlash as in Nordin and Gutman, Controlling mechanical systems with backlash: a survey (2002)",
        )
        .parameter(
            Parameter::by_level(
                "play",
                [0.02, 0.05, 0.1, 0.2, 0.4],
                "how far the steering turns before the wheels follow, as a share of full lock",
            )
            .range(0.0, 2.0),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for SteeringPlay {
    fn actuate(&mut self, control: Control, cx: &Context<'_>) -> Result<Control> {
        let half = cx.number("play") / 2.0;
        let before = cx.signals.back(1).map_or(0.0, |before| before.passed[0]);
        Ok(Control { steering: before.min(control.steering + half).max(control.steering - half), ..control })
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::prelude::Control;
    use pdk_sdk::serde_json::json;

    use super::SteeringPlay;
    use crate::test_drive::applied;

    #[test]
    fn the_wheels_follow_when_the_play_is_used_up() {
        let controls = [0.125, 0.5, 0.375, 0.25, 0.0].map(|steering| Control { steering, throttle: 0.5 });
        let found = applied::<SteeringPlay>(&json!({"play": 0.25}), 0.0, &controls);
        let steering: Vec<f64> = found.iter().map(|control| control.steering).collect();
        assert_eq!(steering, [0.0, 0.375, 0.375, 0.375, 0.125]);
    }

    #[test]
    fn rules() {
        pdk_sdk::testing::perturbation::<SteeringPlay>();
    }
}
