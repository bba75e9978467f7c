//! What a perturbation has to hold that acts on what the driver gets besides the frame, or on controls.

use pdk_seed::Key;

use super::sample::ensure;
use crate::config::{Config, frame_values};
use crate::describe::{ActsOn, Description, LEVELS};
use crate::error::Result;
use crate::perturbation::{Context, Perturbation, pass};
use crate::signals::{Numbers, Passed, Signal};

/// Frames of the drive, at 20 a second.
const FRAMES: u64 = 80;
const PERIOD: f64 = 0.05;
/// From one frame to the next if they do not come in their order.
const STRIDE: u64 = 37;

/// Checks that what a perturbation makes of a signal can be used, and follows from the signals that it asks for alone.
pub(crate) fn check(
    description: &Description,
    config: &Config,
    make: &mut dyn FnMut(&Config) -> Result<Box<dyn Perturbation>>,
) -> Result<()> {
    let names: Vec<String> = description.parameters.iter().map(|p| p.name.clone()).collect();
    let (mut values, key) = (Vec::new(), Key([9; 32]));
    // One sees the frames in their order, the other in another.
    let (mut first, mut second) = (make(config)?, make(config)?);
    for level in 0..=2 * (LEVELS - 1) {
        let intensity = level as f64 / 2.0;
        frame_values(description, config, intensity, &mut values);
        let mut kept = Passed::of(description.history as usize);
        let mut all: Vec<Signal> = Vec::new();
        let place = |frame_index: u64| format!("at frame {frame_index} and level {intensity}");
        let made = |instance: &mut dyn Perturbation, kept: &mut Passed, frame_index: u64| -> Result<Signal> {
            let (time, given) = (frame_index as f64 * PERIOD, sample(description.acts_on, frame_index));
            let mut cx = Context::new(intensity, frame_index, time, &key)
                .with_values(&names, &values)
                .with_signals(kept.before(frame_index));
            cx.period = Some(PERIOD);
            let passed = pass(instance, description.acts_on, given, &cx)
                .map_err(|error| error.at(place(frame_index)))?;
            Ok(Signal { frame_index, time, given, passed })
        };
        for frame_index in 0..FRAMES {
            let signal = made(&mut *first, &mut kept, frame_index)?;
            kept.keep(signal);
            all.push(signal);
        }
        // The stride has no divisor in common with the number of frames, so it leads to all of them.
        for frame_index in (0..FRAMES).map(|number| (number * STRIDE + 1) % FRAMES) {
            let before = &all[..frame_index as usize];
            let mut asked_for = Passed::of(description.history as usize);
            let earliest = before.len().saturating_sub(description.history as usize);
            before[earliest..].iter().for_each(|signal| asked_for.keep(*signal));
            let again = made(&mut *second, &mut asked_for, frame_index)?.passed;
            let passed = all[frame_index as usize].passed;
            ensure(passed.map(f64::to_bits) == again.map(f64::to_bits), || {
                format!(
                    "{} it passes on something else than it does after other frames; the result may depend on the signal, the parameters, \
                     the key and the {} signals before it that the description asks for",
                    place(frame_index),
                    description.history
                )
            })?;
        }
    }
    Ok(())
}

/// A signal that swings, with a step in its middle.
fn sample(acts_on: ActsOn, frame_index: u64) -> Numbers {
    let swing = (frame_index % 16) as f64 / 8.0 - 1.0;
    let step = if frame_index > FRAMES / 2 { 0.5 } else { 0.0 };
    match acts_on {
        ActsOn::Control => [(swing + step).min(1.0), 0.5 - step],
        _ => [frame_index as f64 * PERIOD, 8.0 + swing + step],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::driver::{Control, DriveContext};

    /// Breaks one rule, as told.
    struct Rogue(&'static str, f64);

    impl Perturbation for Rogue {
        fn actuate(&mut self, control: Control, cx: &Context<'_>) -> Result<Control> {
            let before = cx.signals.back(1).map_or(0.0, |signal| signal.passed[0]);
            let steering = match self.0 {
                "remembers" => self.1,
                "looks further back" => cx.signals.back(3).map_or(0.0, |signal| signal.given[0]),
                "is not a number" => f64::NAN,
                _ => 0.5 * (before + control.steering),
            };
            self.1 = control.steering;
            Ok(Control { steering, ..control })
        }

        fn observe(&mut self, observation: DriveContext, _: &Context<'_>) -> Result<DriveContext> {
            Ok(match self.0 {
                "has no time" => DriveContext { time: f64::INFINITY, ..observation },
                _ => DriveContext { speed: f64::NAN, ..observation },
            })
        }
    }

    fn check(rule: &'static str, acts_on: ActsOn) -> std::result::Result<(), String> {
        let description = Description::perturbation("rogue", "Breaks a rule").acts_on(acts_on).history(2);
        let mut make = |_: &Config| Ok(Box::new(Rogue(rule, 0.0)) as Box<dyn Perturbation>);
        crate::perturbation::check(&description, &Config::default(), &mut make)
            .map_err(|error| error.to_string())
    }

    #[test]
    fn every_broken_rule_is_found() {
        assert_eq!(check("keeps them all", ActsOn::Control), Ok(()));
        // An unknown speed is not a number.
        assert_eq!(check("keeps them all", ActsOn::Observation), Ok(()));
        // What is not there is 0, as often as it is looked for.
        assert_eq!(check("looks further back", ActsOn::Control), Ok(()));
        let error = check("remembers", ActsOn::Control).unwrap_err();
        assert!(error.starts_with("at frame 1 and level 0 it passes on something else"), "{error}");
        let error = check("is not a number", ActsOn::Control).unwrap_err();
        assert!(error.contains("both have to be finite numbers"), "{error}");
        let error = check("has no time", ActsOn::Observation).unwrap_err();
        assert!(error.contains("the time inf s"), "{error}");
    }
}
