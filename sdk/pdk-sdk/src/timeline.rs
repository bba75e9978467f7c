//! Whether the time of a simulator goes on as it has to.

use std::time::Duration;

use crate::describe::Clock;
use crate::error::{Error, ErrorKind, Result};

/// The first state of a scenario has a time of at most this many seconds: time counts from the start of the scenario.
const FIRST: f64 = 1.0;
/// A simulator that waits for the driver goes on by one frame for each control. Some count in steps of their own, so that a frame may be
/// this many times shorter or longer than the camera's rate says.
const FACTOR: f64 = 10.0;
/// A simulator with its own clock may be held up, also for as long as a call of a component may take: the longest gap in seconds.
const LONGEST_GAP: f64 = 100.0;
/// It may send several frames with the same time, but not for this long.
const LONGEST_STAND: Duration = Duration::from_secs(10);
/// Times that are rounded may fall by so much, in seconds.
const ROUNDING: f64 = 1e-6;

/// Where a time comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Told {
    /// With a frame, whose state may be the one that was told already.
    Frame,
    /// After a control, which moves the simulation on.
    Act,
}

/// The times of a scenario so far.
#[derive(Debug, Clone)]
pub struct Timeline {
    clock: Clock,
    /// Seconds from one frame of the camera to the next.
    period: f64,
    last: Option<f64>,
    /// How many controls in a row had no effect on the time.
    stood: u64,
}

impl Timeline {
    /// That of a simulator with this clock, whose camera has this many frames a second.
    pub fn new(clock: Clock, rate: f64) -> Self {
        Self { clock, period: 1.0 / rate, last: None, stood: 0 }
    }

    /// Notes the time of the next state.
    ///
    /// # Errors
    /// If it cannot follow the one before.
    pub fn go_on(&mut self, time: f64, told: Told) -> Result<()> {
        let nonsense = |sentence: String| Err(Error::of(ErrorKind::Nonsense, sentence));
        let Some(before) = self.last.replace(time) else {
            return match time <= FIRST {
                true => Ok(()),
                false => nonsense(format!(
                    "its first state is of {time:?} s, but time has to count from the start of the scenario"
                )),
            };
        };
        let passed = time - before;
        if passed < -ROUNDING {
            return nonsense(format!("its time falls from {before:?} to {time:?} s"));
        }
        let most = match self.clock {
            Clock::Stepped => FACTOR * self.period,
            Clock::Own => LONGEST_GAP,
        };
        if passed > most {
            return nonsense(format!(
                "its time jumps from {before:?} to {time:?} s, but has to advance by at most {} s at a time",
                (most * 1e6).round() / 1e6
            ));
        }
        if told == Told::Frame {
            return Ok(());
        }
        match self.clock {
            Clock::Stepped if passed < self.period / FACTOR => nonsense(format!(
                "its time advances from {before:?} to {time:?} s with a control, but has to advance by a frame, which is {:?} s",
                self.period
            )),
            Clock::Stepped => Ok(()),
            Clock::Own => {
                self.stood = if passed > ROUNDING { 0 } else { self.stood + 1 };
                match self.stood as f64 * self.period > LONGEST_STAND.as_secs_f64() {
                    true => nonsense(format!("its time stands at {time:?} s over {} frames", self.stood)),
                    false => Ok(()),
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The judgement of the last of these times, each of which follows a control; at 20 frames a second.
    fn said(clock: Clock, times: impl IntoIterator<Item = f64>) -> String {
        let mut timeline = Timeline::new(clock, 20.0);
        let results: Vec<_> = times.into_iter().map(|time| timeline.go_on(time, Told::Act)).collect();
        let Some((last, others)) = results.split_last() else { return String::new() };
        assert!(others.iter().all(Result::is_ok), "{others:?}");
        last.as_ref().err().map(|error| error.message().to_owned()).unwrap_or_default()
    }

    #[test]
    fn a_simulator_that_waits_goes_on_by_a_frame_each_time() {
        let stepped = |times: &[f64]| said(Clock::Stepped, times.iter().copied());
        for right in [vec![0.0, 0.05, 0.1], vec![0.9, 0.95], vec![0.0, 0.0334, 0.0667], vec![0.0, 0.5]] {
            assert_eq!(stepped(&right), "");
        }
        assert_eq!(
            stepped(&[7.0]),
            "its first state is of 7.0 s, but time has to count from the start of the scenario"
        );
        assert_eq!(stepped(&[0.0, 0.25, 0.0]), "its time falls from 0.25 to 0.0 s");
        assert!(
            stepped(&[0.0, 0.05, 0.05]).starts_with("its time advances from 0.05 to 0.05 s with a control")
        );
        assert_eq!(
            stepped(&[0.0, 1e3]),
            "its time jumps from 0.0 to 1000.0 s, but has to advance by at most 0.5 s at a time"
        );
    }

    #[test]
    fn the_state_of_a_frame_may_be_the_one_that_was_told() {
        let mut timeline = Timeline::new(Clock::Stepped, 20.0);
        for (time, told) in [(0.0, Told::Frame), (0.05, Told::Act), (0.05, Told::Frame), (0.1, Told::Act)] {
            assert_eq!(timeline.go_on(time, told), Ok(()));
        }
        assert!(timeline.go_on(0.0, Told::Frame).is_err());
    }

    #[test]
    fn one_with_its_own_clock_may_be_held_up_and_repeat_itself_for_a_while() {
        let own = |times: Vec<f64>| said(Clock::Own, times);
        assert_eq!(own(vec![0.0, 0.01, 3.0, 99.0]), "");
        assert!(own(vec![0.0, 1e308]).starts_with("its time jumps from 0.0 to 1e308 s"));
        assert_eq!(own(vec![0.0, 1.0, 0.7]), "its time falls from 1.0 to 0.7 s");
        // The first one begins at 0.5 s.
        let stands =
            |times: usize| own(std::iter::once(0.0).chain(std::iter::repeat_n(0.5, times)).collect());
        assert_eq!(stands(201), "");
        assert_eq!(stands(202), "its time stands at 0.5 s over 201 frames");
    }
}
