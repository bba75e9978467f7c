//! Lagging controls: the actuator follows as a first-order lag does.

use pdk_sdk::prelude::*;

/// Lets the actuator follow with a time constant.
pub struct LaggingControls;

impl Component for LaggingControls {
    fn description() -> Description {
        crate::fault(
            "lagging_controls",
            "Lets steering and pedals follow the driver with a lag of first order",
            ActsOn::Control,
        )
        .history(1)
        .mathematics("tau a'(t) = control(t) - a(t), of which the mean over a frame is applied")
        .source("First-order lag of an actuator, as in Rajamani, Vehicle dynamics and control (2012)")
        .parameter(
            Parameter::by_level("steering", [0.05, 0.1, 0.2, 0.4, 0.8], "time constant of the steering")
                .range(0.0, 60.0)
                .unit("s"),
        )
        .parameter(
            Parameter::number("throttle", 0.0, "time constant of throttle and brake")
                .range(0.0, 60.0)
                .unit("s"),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

/// The mean position of an actuator over a frame that lasts `x` time constants, under a control, if it began the frame before with `before`
/// as its control, and had that mean. That control stayed for as many time constants as `missed` longer than a frame.
fn follow(control: f64, before: Option<[f64; 2]>, x: f64, missed: f64) -> f64 {
    // At once: the constant is so small that the quotient is infinite.
    if !x.is_finite() {
        return control;
    }
    if x <= 0.0 {
        return before.map_or(0.0, |[_, mean]| mean);
    }
    // From the mean over the frame before to the position at its end: both are distances from its control that shrink.
    let left = x / libm::expm1(x) * libm::exp(-missed);
    let begin = before.map_or(0.0, |[control, mean]| control + (mean - control) * left);
    control + (begin - control) * (-libm::expm1(-x) / x)
}

impl Perturbation for LaggingControls {
    fn actuate(&mut self, control: Control, cx: &Context<'_>) -> Result<Control> {
        let before = cx.signals.back(1);
        let elapsed = before.map(|before| cx.time - before.time);
        let period = cx.period.or(elapsed).unwrap_or_default();
        // Frames that the driver missed because it was late.
        let has_missed = before.is_some_and(|before| before.frame_index + 1 < cx.frame_index);
        let missed = elapsed.filter(|_| has_missed).map_or(0.0, |elapsed| (elapsed - period).max(0.0));
        let of = |place: usize, control: f64, constant: f64| {
            let before = before.map(|before| [before.given[place], before.passed[place]]);
            match constant > 0.0 {
                true => follow(control, before, period / constant, missed / constant),
                false => control,
            }
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

    use super::LaggingControls;
    use crate::test_drive::{applied, assert_missed_frames_change_nothing};

    /// The mean from frame to frame of what the differential equation says for a step at the beginning and one back.
    #[test]
    fn steps_are_followed_as_the_differential_equation_says() {
        const BACK: usize = 30;
        let control =
            |index: usize| Control { steering: if index < BACK { 0.75 } else { -0.25 }, throttle: 0.5 };
        let controls: Vec<Control> = (0..80).map(control).collect();
        for tau in [0.003, 0.05, 0.3, 5.0] {
            let found = applied::<LaggingControls>(&json!({"steering": tau}), 0.0, &controls);
            // The integral of the position up to a time.
            let integral = |time: f64| {
                let back = BACK as f64 / 20.0;
                let rest = |since: f64| tau * (1.0 - libm::exp(-since / tau));
                match time <= back {
                    true => 0.75 * (time - rest(time)),
                    false => {
                        let at_back = 0.75 * (1.0 - libm::exp(-back / tau));
                        0.75 * (back - rest(back)) - 0.25 * (time - back)
                            + (at_back + 0.25) * rest(time - back)
                    }
                }
            };
            for (index, found) in found.iter().enumerate() {
                let (from, to) = (index as f64 / 20.0, (index + 1) as f64 / 20.0);
                let expected = (integral(to) - integral(from)) * 20.0;
                assert!(
                    (found.steering - expected).abs() < 1e-9,
                    "{tau} s, frame {index}: {found:?}, {expected}"
                );
                // Without a constant there is no lag.
                assert_eq!(found.throttle, 0.5);
            }
        }
    }

    #[test]
    fn over_frames_that_the_driver_misses_the_actuator_goes_on_to_the_control_before() {
        assert_missed_frames_change_nothing::<LaggingControls>(&json!({"steering": 0.3}));
    }

    #[test]
    fn rules() {
        pdk_sdk::testing::perturbation::<LaggingControls>();
    }
}
