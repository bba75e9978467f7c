//! Quantised controls: only some values reach the vehicle.

use pdk_sdk::prelude::*;

/// Rounds controls.
pub struct QuantisedControls;

impl Component for QuantisedControls {
    fn description() -> Description {
        crate::fault(
            "quantised_controls",
            "Rounds controls to steps, as coarse messages or switched actuators do",
            ActsOn::Control,
        )
        .mathematics("applied(t) = clip(step round(control(t) / step), -1, 1)")
        .source("Uniform mid-tread quantisation, as in Widrow and Kollár, Quantization noise (2008)")
        .parameter(
            Parameter::by_level(
                "step",
                [0.02, 0.05, 0.1, 0.2, 0.4],
                "the distance between two values, all of which lie from -1 to 1",
            )
            .range(0.0, 2.0),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for QuantisedControls {
    fn actuate(&mut self, control: Control, cx: &Context<'_>) -> Result<Control> {
        let step = cx.number("step");
        let rounded =
            |value: f64| if step > 0.0 { ((value / step).round() * step).clamp(-1.0, 1.0) } else { value };
        Ok(Control::from_numbers(control.numbers().map(rounded)))
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::prelude::Control;
    use pdk_sdk::serde_json::json;

    use super::QuantisedControls;
    use crate::test_drive::applied;

    #[test]
    fn controls_are_rounded_to_the_nearest_step() {
        let control = |steering, throttle| Control { steering, throttle };
        let found = |step| applied::<QuantisedControls>(&json!({"step": step}), 0.0, &[control(0.3, -0.13)]);
        assert_eq!(found(0.25), [control(0.25, -0.25)]);
        assert_eq!(found(2.0), [control(0.0, 0.0)]);
        assert_eq!(found(0.0), [control(0.3, -0.13)]);
    }

    #[test]
    fn rules() {
        pdk_sdk::testing::perturbation::<QuantisedControls>();
    }
}
