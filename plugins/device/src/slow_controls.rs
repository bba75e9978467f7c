//! Slow controls: steering and pedals move no faster than at some rate.

use pdk_sdk::prelude::*;

/// Limits the rate of controls.
pub struct SlowControls;

impl Component for SlowControls {
    fn description() -> Description {
        crate::fault("slow_controls", "Limits how fast the steering and the pedals move", ActsOn::Control)
            .version(2)
            .history(1)
            .mathematics("applied(t) = clip(control(t), applied(t - dt) - rate dt, applied(t - dt) + rate dt)")
            .source("Rate limit of an actuator, as in Rajamani, Vehicle dynamics and control (2012)")
            .parameter(
                Parameter::by_level(
                    "steering",
                    [1.0, 0.5, 0.25, 0.12, 0.06],
                    "how far the steering moves in a second, as a share of the way from the middle to full lock",
                )
                .range(0.0, 1000.0)
                .unit("1/s"),
            )
            .parameter(
                Parameter::number("throttle", 1000.0, "how far throttle and brake move in a second, likewise")
                    .range(0.0, 1000.0)
                    .unit("1/s"),
            )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for SlowControls {
    fn actuate(&mut self, control: Control, cx: &Context<'_>) -> Result<Control> {
        let towards = |from: f64, to: f64, way: f64| to.min(from + way).max(from - way);
        let before = cx.signals.back(1);
        let of = |place: usize, control: f64, rate: f64| {
            // At the beginning the wheels are straight, and a frame has passed.
            let Some(before) = before else {
                return towards(0.0, control, rate * cx.period.unwrap_or_default());
            };
            // Over frames that the driver missed because it was late, the actuator goes on to the control before.
            let frames = cx.frame_index.saturating_sub(before.frame_index).max(1);
            let elapsed = cx.time - before.time;
            let last = elapsed / frames as f64;
            let from = towards(before.passed[place], before.given[place], rate * (elapsed - last));
            towards(from, control, rate * last)
        };
        Ok(Control {
            steering: of(0, control.steering, cx.number("steering")),
            throttle: of(1, control.throttle, cx.number("throttle")),
        })
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::prelude::Control;
    use pdk_sdk::serde_json::json;

    use super::SlowControls;
    use crate::test_drive::{applied, assert_missed_frames_change_nothing};

    #[test]
    fn a_step_becomes_a_ramp_of_the_rate() {
        let controls = [Control { steering: -0.5, throttle: 1.0 }; 20];
        // Twenty frames a second.
        for (index, control) in
            applied::<SlowControls>(&json!({"steering": 1.0, "throttle": 4.0}), 0.0, &controls)
                .iter()
                .enumerate()
        {
            let time = (index + 1) as f64 / 20.0;
            assert!((control.steering + time.min(0.5)).abs() < 1e-12, "{control:?} after {time} s");
            assert!((control.throttle - (4.0 * time).min(1.0)).abs() < 1e-12, "{control:?} after {time} s");
        }
    }

    #[test]
    fn over_frames_that_the_driver_misses_the_actuator_goes_on_to_the_control_before() {
        assert_missed_frames_change_nothing::<SlowControls>(&json!({"steering": 0.3, "throttle": 0.1}));
    }

    #[test]
    fn rules() {
        pdk_sdk::testing::perturbation::<SlowControls>();
    }
}
