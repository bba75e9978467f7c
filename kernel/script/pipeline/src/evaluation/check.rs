//! Whether results about a driver say anything: how it does on the frames as they are, beside a constant.

use pdk_model::component::ComponentSpec;
use pdk_sdk::prelude::Control;
use serde::Serialize;
use serde_json::Value;

/// With fewer frames a constant is hard to beat, and nothing is refused.
const FEWEST: usize = 30;
/// Outputs that are as often at a limit, or the same, say nothing.
const NEARLY_ALWAYS: f64 = 0.95;
/// A driver that gives no usable number for as many frames cannot be ranked.
const HALF: f64 = 0.5;
/// Numbers that differ by less are the same.
const SAME: f64 = 1e-6;

/// How a driver does on the frames as they are.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Check {
    /// Frames that the driver decided on.
    pub frames: usize,
    /// Those and the ones on which it failed.
    #[serde(skip)]
    all: usize,
    /// How it steers.
    pub steering: NumberCheck,
    /// Its throttle.
    pub throttle: NumberCheck,
    /// The share of the frames for which the driver gave no usable number.
    pub failed: f64,
    /// What it said when it failed first.
    #[serde(skip)]
    pub first_failure: Option<String>,
    /// Why the driver cannot be ranked; none if nothing speaks against it.
    pub refusal: Option<String>,
}

/// One of the numbers that a driver gives.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct NumberCheck {
    /// Mean absolute error of the driver.
    pub error: f64,
    /// The constant with the smallest mean absolute error: the median of what was recorded.
    pub constant: f64,
    /// Its mean absolute error.
    pub constant_error: f64,
    /// The mean of what was recorded.
    pub mean: f64,
    /// Its mean absolute error.
    pub mean_error: f64,
    /// The share of outputs at -1 or 1.
    pub at_limit: f64,
    /// The share of outputs that are the same number.
    pub same: f64,
}

impl Check {
    /// The check of what was recorded and what the driver makes of it; on this many frames more the driver failed.
    pub fn of(frames: &[(Control, Control)], failed: usize) -> Self {
        let all = frames.len() + failed;
        let number = |of: fn(&Control) -> f64| {
            let numbers: Vec<(f64, f64)> =
                frames.iter().map(|(truth, control)| (of(truth), of(control))).collect();
            NumberCheck::of(&numbers)
        };
        Self {
            frames: frames.len(),
            all,
            steering: number(|control| control.steering),
            throttle: number(|control| control.throttle),
            failed: failed as f64 / all.max(1) as f64,
            first_failure: None,
            refusal: None,
        }
    }

    /// Whether the frames are enough for a verdict.
    pub fn is_conclusive(&self) -> bool {
        self.all >= FEWEST
    }

    /// The check with the reason why this driver cannot be ranked, if there is one.
    pub fn judged(self, driver: &ComponentSpec) -> Self {
        let refusal = self.is_conclusive().then(|| self.finding()).flatten().map(|finding| {
            format!(
                "driver `{}` {finding}, so what perturbations do to it says nothing; {}, or set trust=true to rank it all the same",
                driver.name,
                remedy(driver)
            )
        });
        Self { refusal, ..self }
    }

    /// The check alone.
    pub fn unjudged(self) -> Self {
        Self { refusal: None, ..self }
    }

    fn finding(&self) -> Option<String> {
        let NumberCheck { error, constant, constant_error, at_limit, same, .. } = self.steering;
        let percent = |share: f64| format!("{:.0} %", share * 100.0);
        if self.failed >= HALF {
            let first = self
                .first_failure
                .as_ref()
                .map_or_else(String::new, |first| format!(" (the first: {first})"));
            Some(format!(
                "gives no usable number for {} of the frames as they are{first}",
                percent(self.failed)
            ))
        } else if at_limit >= NEARLY_ALWAYS {
            Some(format!(
                "steers to a limit (-1 or 1) on {} of the frames as they are, and is off by {error:.3} on average",
                percent(at_limit)
            ))
        } else if same >= NEARLY_ALWAYS {
            Some(format!("gives the same steering on {} of the frames as they are", percent(same)))
        } else if error > constant_error {
            Some(format!(
                "is worse than a constant on the frames as they are: its mean absolute steering error is {error:.3}, and that of the \
                 constant {constant:.3} is {constant_error:.3}"
            ))
        } else {
            None
        }
    }
}

/// Where to look for the mistake.
fn remedy(driver: &ComponentSpec) -> String {
    match driver.parameters.get("model").and_then(Value::as_str) {
        Some(model) => {
            format!("check its preprocessing and the scale of its steering with `pdk show {model}`")
        }
        None => format!("check with `pdk show {}` how it reads frames", driver.name),
    }
}

impl NumberCheck {
    /// The check of recorded numbers with those of the driver.
    fn of(numbers: &[(f64, f64)]) -> Self {
        // What was not recorded cannot be compared with.
        let recorded: Vec<(f64, f64)> =
            numbers.iter().copied().filter(|(truth, _)| !truth.is_nan()).collect();
        let mean_of = |sum: f64| if recorded.is_empty() { f64::NAN } else { sum / recorded.len() as f64 };
        let count = numbers.len().max(1) as f64;
        let share = |is: &dyn Fn(f64) -> bool| {
            numbers.iter().filter(|(_, output)| is(*output)).count() as f64 / count
        };
        let error_of =
            |constant: f64| mean_of(recorded.iter().map(|(truth, _)| (truth - constant).abs()).sum());
        let constant = match recorded.is_empty() {
            true => f64::NAN,
            false => median(recorded.iter().map(|(truth, _)| *truth).collect()),
        };
        let mean = mean_of(recorded.iter().map(|(truth, _)| truth).sum());
        // If most outputs are the same number, it is their median.
        let usual = median(numbers.iter().map(|(_, output)| *output).collect());
        Self {
            error: mean_of(recorded.iter().map(|(truth, output)| (output - truth).abs()).sum()),
            constant,
            constant_error: error_of(constant),
            mean,
            mean_error: error_of(mean),
            at_limit: share(&|output| output.abs() >= 1.0 - SAME),
            same: share(&|output| (output - usual).abs() <= SAME),
        }
    }
}

/// A value in the middle; 0 if there are none.
fn median(mut values: Vec<f64>) -> f64 {
    values.sort_by(f64::total_cmp);
    values.get(values.len() / 2).copied().unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn judged(steering: impl Fn(f64) -> f64) -> Option<String> {
        let control = |steering: f64| Control { steering, throttle: 0.3 };
        let frames: Vec<(Control, Control)> = (0..100)
            .map(|n| f64::from(n) / 100.0 - 0.4)
            .map(|truth| (control(truth), control(steering(truth))))
            .collect();
        let mut driver = ComponentSpec::new("onnx");
        driver.parameters.insert("model".into(), "pilot.onnx".into());
        Check::of(&frames, 0).judged(&driver).refusal
    }

    #[test]
    fn a_driver_that_beats_a_constant_is_ranked() {
        assert_eq!(judged(|truth| truth + 0.1), None);
        assert_eq!(judged(|truth| if truth < 0.0 { -0.3 } else { 0.3 }), None);
    }

    #[test]
    fn one_that_does_not_is_refused_with_what_was_found_and_what_to_do() {
        let worse = judged(|truth| -truth).unwrap();
        assert_eq!(
            worse,
            "driver `onnx` is worse than a constant on the frames as they are: its mean absolute steering error is 0.518, and that \
             of the constant 0.100 is 0.250, so what perturbations do to it says nothing; check its preprocessing and the scale of its \
             steering with `pdk show pilot.onnx`, or set trust=true to rank it all the same"
        );
        assert!(judged(|_| 1.0).unwrap().contains("steers to a limit (-1 or 1) on 100 % of the frames"));
        assert!(
            judged(|truth| if truth > 0.565 { truth } else { 0.2 })
                .unwrap()
                .contains("same steering on 97 %")
        );
        let silent = Check::of(&[(Control::default(), Control::default()); 20], 80);
        let said = Check { first_failure: Some("it takes the speed".to_owned()), ..silent.clone() };
        let said = said.judged(&ComponentSpec::new("x")).refusal.unwrap();
        assert!(
            said.contains("80 % of the frames as they are (the first: it takes the speed), so"),
            "{said}"
        );
        assert!(
            silent.judged(&ComponentSpec::new("x")).refusal.unwrap().contains("no usable number for 80 %")
        );
    }

    #[test]
    fn without_a_recorded_steering_nothing_is_compared() {
        let none = Control { steering: f64::NAN, throttle: f64::NAN };
        let frames: Vec<(Control, Control)> =
            (0..100).map(|n| (none, Control { steering: f64::from(n) / 200.0, throttle: 0.3 })).collect();
        let check = Check::of(&frames, 0).judged(&ComponentSpec::new("x"));
        assert!(check.refusal.is_none() && check.steering.error.is_nan() && check.steering.at_limit == 0.0);
    }

    #[test]
    fn a_driver_without_an_output_has_no_errors() {
        let check = Check::of(&[], 80).judged(&ComponentSpec::new("x"));
        let NumberCheck { error, constant, constant_error, mean, mean_error, .. } = check.steering;
        assert!([error, constant, constant_error, mean, mean_error].iter().all(|number| number.is_nan()));
        assert!(check.refusal.unwrap().contains("no usable number for 100 %"));
    }

    #[test]
    fn few_frames_refuse_nothing() {
        let frames = [(Control::default(), Control { steering: 1.0, throttle: 0.0 }); 29];
        let check = Check::of(&frames, 0).judged(&ComponentSpec::new("x"));
        assert!(check.refusal.is_none() && check.steering.at_limit == 1.0);
    }
}
