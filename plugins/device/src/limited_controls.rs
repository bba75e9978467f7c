//! Limited controls: steering and pedals end before their stops.

use pdk_sdk::prelude::*;

/// Limits controls.
pub struct LimitedControls;

impl Component for LimitedControls {
    fn description() -> Description {
        crate::fault(
            "limited_controls",
            "Limits how far the vehicle steers, and how much it accelerates and brakes",
            ActsOn::Control,
        )
        .mathematics("applied(t) = clip(control(t), -limit, limit)")
        .source("Saturation of an actuator, as in Rajamani, Vehicle dynamics and control (2012)")
        .parameter(
            Parameter::by_level(
                "steering",
                [0.3, 0.2, 0.15, 0.1, 0.06],
                "most steering to either side, as a share of full lock",
            )
            .range(0.0, 1.0),
        )
        .parameter(Parameter::number("throttle", 1.0, "most throttle").range(0.0, 1.0))
        .parameter(Parameter::number("brake", 1.0, "most brake").range(0.0, 1.0))
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for LimitedControls {
    fn actuate(&mut self, control: Control, cx: &Context<'_>) -> Result<Control> {
        let (steering, throttle, brake) = (cx.number("steering"), cx.number("throttle"), cx.number("brake"));
        Ok(Control {
            steering: control.steering.min(steering).max(-steering),
            throttle: control.throttle.min(throttle).max(-brake),
        })
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::prelude::Control;
    use pdk_sdk::serde_json::json;

    use super::LimitedControls;
    use crate::test_drive::applied;

    #[test]
    fn controls_end_at_their_limits() {
        let control = |steering, throttle| Control { steering, throttle };
        let given = json!({"steering": 0.25, "throttle": 0.5, "brake": 0.125});
        let found = applied::<LimitedControls>(
            &given,
            0.0,
            &[control(0.5, 1.0), control(-1.0, -1.0), control(0.2, 0.1)],
        );
        assert_eq!(found, [control(0.25, 0.5), control(-0.25, -0.125), control(0.2, 0.1)]);
    }

    #[test]
    fn rules() {
        pdk_sdk::testing::perturbation::<LimitedControls>();
    }
}
