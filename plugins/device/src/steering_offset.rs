//! Steering offset: straight ahead is not where the driver believes it to be.

use pdk_sdk::prelude::*;

/// Shifts the steering to one side.
pub struct SteeringOffset;

impl Component for SteeringOffset {
    fn description() -> Description {
        crate::fault(
            "steering_offset",
            "Shifts the steering to one side, as a wrong zero of its sensor does",
            ActsOn::Control,
        )
        .mathematics("applied(t) = clip(steering(t) + side offset, -1, 1)")
        .drawn_per_sequence("the side")
        .source("Offset errors of sensors in ISO 26262-5:2018, annex D")
        .parameter(
            Parameter::by_level("offset", [0.02, 0.05, 0.1, 0.15, 0.25], "how far, as a share of full lock")
                .range(0.0, 1.0),
        )
        .parameter(Parameter::choice("side", &["drawn", "left", "right"], "to which side"))
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for SteeringOffset {
    fn actuate(&mut self, control: Control, cx: &Context<'_>) -> Result<Control> {
        let left = match cx.integer("side") {
            0 => cx.sequence_random().below(2) == 0,
            side => side == 1,
        };
        let offset = if left { -cx.number("offset") } else { cx.number("offset") };
        Ok(Control { steering: (control.steering + offset).clamp(-1.0, 1.0), ..control })
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::prelude::Control;
    use pdk_sdk::serde_json::json;

    use super::SteeringOffset;
    use crate::test_drive::applied;

    #[test]
    fn the_steering_is_shifted_to_one_side() {
        let controls = [Control { steering: 0.25, throttle: 0.5 }; 3];
        let steering = |side| {
            let found = applied::<SteeringOffset>(&json!({"offset": 0.125, "side": side}), 0.0, &controls);
            assert!(found.iter().all(|control| *control == found[0] && control.throttle == 0.5));
            found[0].steering
        };
        assert_eq!((steering("left"), steering("right")), (0.125, 0.375));
        assert!([0.125, 0.375].contains(&steering("drawn")));
    }

    #[test]
    fn rules() {
        pdk_sdk::testing::perturbation::<SteeringOffset>();
    }
}
