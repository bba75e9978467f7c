//! Compares what was driven again with what is recorded.

use std::fmt;

use pdk_model::json::difference;
use pdk_model::outcome::Outcome;
use pdk_model::scenario::ScenarioId;
use pdk_record::trace::step::Step;
use pdk_sdk::error::{Error, Result};
use pdk_sdk::prelude::{Control, State};
use serde::Serialize;

use crate::recorded::Recorded;

/// What there is to say of a scenario.
#[derive(Debug)]
pub struct Compared {
    /// The number of the scenario in its run.
    pub number: u64,
    /// Its id.
    pub id: ScenarioId,
    /// Its name in the record.
    pub name: String,
    /// Its name as it fits into a line.
    pub short_name: String,
    /// Frames that were driven.
    pub frames: u64,
    /// What the comparison found.
    pub finding: Finding,
}

/// What a comparison found.
#[derive(Debug)]
pub enum Finding {
    /// Every frame, control and state and the outcome are as recorded.
    Equal,
    /// The first thing that is not.
    Different(Difference),
    /// There is nothing to compare with, so it was not driven.
    Unreadable(Error),
}

/// The first thing that differs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Difference {
    /// The number of the frame; none if the frames are equal and the outcome is not.
    pub frame: Option<u64>,
    /// Simulation time of the frame in seconds.
    pub time: Option<f64>,
    /// What differs.
    pub what: String,
    /// What is recorded.
    pub recorded: String,
    /// What it is now.
    pub replayed: String,
}

impl fmt::Display for Difference {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { frame, time, what, recorded, replayed } = self;
        match (frame, time) {
            (Some(frame), Some(time)) => write!(f, "frame {frame} at {time:.3} s: ")?,
            _ => f.write_str("the outcome: ")?,
        }
        write!(f, "{what} was {recorded} and is {replayed}")
    }
}

impl fmt::Display for Compared {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "scenario {} ({}): ", self.number, self.short_name)?;
        match &self.finding {
            Finding::Equal => write!(f, "{} frames, equal", self.frames),
            Finding::Different(difference) => difference.fmt(f),
            Finding::Unreadable(error) => error.fmt(f),
        }
    }
}

impl Compared {
    /// What was found of a recorded scenario that was driven again for this many frames.
    pub fn new(recorded: &Recorded, frames: u64, finding: Finding) -> Self {
        let Recorded { number, line } = recorded;
        let (name, short_name) = (line.name.clone(), recorded.short_name());
        Self { number: *number, id: line.id, name, short_name, frames, finding }
    }
}

/// Compares a recorded scenario, which has these steps in its trace, with what it came to when it was driven again.
///
/// # Errors
/// If an outcome cannot be JSON.
pub fn compare(recorded: &Recorded, steps: &[Step], outcome: &Outcome, again: &[Step]) -> Result<Compared> {
    let mut pairs = steps.iter().zip(again);
    let of_steps = pairs.find_map(|(was, is)| step_difference(was, is)).or_else(|| {
        match (steps.get(again.len()), again.get(steps.len())) {
            (Some(step), _) => Some(another_end(step, "after", "before")),
            (_, Some(step)) => Some(another_end(step, "before", "after")),
            (None, None) => None,
        }
    });
    // If a process was lost it left no steps, and the outcome says why.
    let lost = steps.is_empty() != again.is_empty();
    let found = match (of_steps, lost) {
        (Some(difference), false) => Some(difference),
        (of_steps, _) => outcome_difference(&recorded.line.outcome, outcome)?.or(of_steps),
    };
    Ok(Compared::new(recorded, outcome.frames, found.map_or(Finding::Equal, Finding::Different)))
}

/// One of the two has this step, and for the other the scenario was over.
fn another_end(step: &Step, recorded: &str, replayed: &str) -> Difference {
    Difference {
        frame: Some(step.sequence),
        time: Some(step.state.time),
        what: "the end of the scenario".to_owned(),
        recorded: format!("{recorded} it"),
        replayed: format!("{replayed} it"),
    }
}

/// The first thing that differs, in the order in which the loop makes them: state, frame, what the driver gets besides, control, and what
/// is applied.
fn step_difference(recorded: &Step, replayed: &Step) -> Option<Difference> {
    let found = |what: &str, was: String, is: String| {
        let frame = Some(replayed.sequence);
        // If it is the time that differs, the time as recorded.
        let time = Some(recorded.state.time);
        Some(Difference { frame, time, what: what.to_owned(), recorded: was, replayed: is })
    };
    if recorded.sequence != replayed.sequence {
        return found("its number", recorded.sequence.to_string(), replayed.sequence.to_string());
    }
    let (was, is) = (recorded.state.numbers(), replayed.state.numbers());
    if let Some(place) = first_other(&was, &is) {
        return found(State::NUMBERS[place], was[place].to_string(), is[place].to_string());
    }
    let (was, is) = (recorded.state.flags(), replayed.state.flags());
    if let Some(place) = (0..was.len()).find(|place| was[*place] != is[*place]) {
        return found(State::FLAGS[place], was[place].to_string(), is[place].to_string());
    }
    if recorded.frame_hash != replayed.frame_hash {
        let hash = |step: &Step| format!("{:016x}", step.frame_hash);
        return found("the hash of the frame", hash(recorded), hash(replayed));
    }
    // What is not recorded was not changed: the driver got what is in the state, and its control was applied.
    let signals = |step: &Step| {
        let observed = step.observed.unwrap_or([step.state.time, step.state.speed]);
        let applied = step.applied.unwrap_or(step.control).numbers();
        [(OBSERVED, observed), (Control::NUMBERS, step.control.numbers()), (APPLIED, applied)]
    };
    signals(recorded).into_iter().zip(signals(replayed)).find_map(|((names, was), (_, is))| {
        let place = first_other(&was, &is)?;
        found(names[place], was[place].to_string(), is[place].to_string())
    })
}

/// What a difference calls the numbers that the driver got, and those that were applied to the vehicle.
const OBSERVED: [&str; 2] = ["the time that the driver got", "the speed that the driver got"];
const APPLIED: [&str; 2] = ["the steering that was applied", "the throttle that was applied"];

/// The place of the first number that has other bits.
fn first_other(was: &[f64], is: &[f64]) -> Option<usize> {
    was.iter().zip(is).position(|(was, is)| was.to_bits() != is.to_bits())
}

/// The first field of the outcome that differs.
fn outcome_difference(recorded: &Outcome, replayed: &Outcome) -> Result<Option<Difference>> {
    let found = difference("", &serde_json::to_value(recorded)?, &serde_json::to_value(replayed)?);
    Ok(found.map(|(what, was, is)| {
        // Why it cannot be driven any more says more than that it cannot.
        let why = replayed.error.as_ref().map_or_else(String::new, |error| format!(" ({error})"));
        Difference {
            frame: None,
            time: None,
            what,
            recorded: was.to_string(),
            replayed: format!("{is}{why}"),
        }
    }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::{Value, json};

    fn step() -> Step {
        let state = State { time: 0.85, speed: 8.0, ..State::default() };
        Step { sequence: 17, state, frame_hash: 0xabc, ..Step::default() }
    }

    #[test]
    fn every_field_of_a_step_is_compared_bit_for_bit() {
        assert_eq!(step_difference(&step(), &step()), None);
        type Change = fn(&mut Step);
        let changes: [(&str, Change); 19] = [
            ("time", |s| s.state.time += 1e-15),
            ("x", |s| s.state.position[0] = -0.0),
            ("height", |s| s.state.position[1] = 1.0),
            ("z", |s| s.state.position[2] = 1.0),
            ("heading", |s| s.state.heading = 1.0),
            ("speed", |s| s.state.speed = 8.000_000_000_000_002),
            ("cross_track_error", |s| s.state.cross_track_error = 1.0),
            ("progress", |s| s.state.progress = 1.0),
            ("vehicle_ahead", |s| s.state.vehicle_ahead = 1.0),
            ("lane_departure", |s| s.state.lane_departure = true),
            ("collision", |s| s.state.collision = true),
            ("finished", |s| s.state.finished = true),
            ("the hash of the frame", |s| s.frame_hash += 1),
            ("steering", |s| s.control.steering = -0.0),
            ("throttle", |s| s.control.throttle = 1.0),
            ("the time that the driver got", |s| s.observed = Some([0.9, 8.0])),
            ("the speed that the driver got", |s| s.observed = Some([0.85, f64::NAN])),
            ("the steering that was applied", |s| {
                s.applied = Some(Control { steering: -0.0, throttle: 0.0 })
            }),
            ("the throttle that was applied", |s| s.applied = Some(Control { steering: 0.0, throttle: 1.0 })),
        ];
        for (what, change) in changes {
            let mut other = step();
            change(&mut other);
            let difference = step_difference(&step(), &other).unwrap();
            assert_eq!((difference.what.as_str(), difference.frame), (what, Some(17)));
            assert_ne!(difference.recorded, difference.replayed);
        }
        let mut other = step();
        (other.control.steering, other.frame_hash) = (0.25, 0xabd);
        assert_eq!(
            step_difference(&step(), &other).unwrap().to_string(),
            "frame 17 at 0.850 s: the hash of the frame was 0000000000000abc and is 0000000000000abd"
        );
    }

    /// A scenario that came to its end in time, with these fields set.
    fn recorded(changes: &[(&str, Value)]) -> Recorded {
        let mut value = json!({
            "id": "00".repeat(16), "name": "nominal", "images_every": 0, "success": true, "cause": "finished",
            "time": 1.0, "frames": 2, "progress": 1.0, "mean_cross_track_error": 0.1,
            "max_cross_track_error": 0.2, "digest": "ff",
            "scenario": {"simulator": {"name": "lane"}, "driver": {"name": "x"}, "duration": 1.0, "seed": 0},
        });
        changes.iter().for_each(|(key, change)| value[*key] = change.clone());
        Recorded { number: 3, line: serde_json::from_value(value).unwrap() }
    }

    fn said(was: &Recorded, steps: &[Step], is: &Recorded, again: &[Step]) -> String {
        compare(was, steps, &is.line.outcome, again).unwrap().to_string()
    }

    #[test]
    fn the_first_difference_is_reported() {
        let (one, two) = (step(), Step { sequence: 18, ..step() });
        let record = recorded(&[]);
        assert_eq!(said(&record, &[one, two], &record, &[one, two]), "scenario 3 (nominal): 2 frames, equal");
        let other = Step { frame_hash: 1, ..two };
        let text = said(&record, &[one, two], &recorded(&[("digest", json!("00"))]), &[one, other]);
        assert!(
            text.starts_with("scenario 3 (nominal): frame 18 at 0.850 s: the hash of the frame"),
            "{text}"
        );
        let text = said(&record, &[one, two], &record, &[one]);
        assert!(text.ends_with("frame 18 at 0.850 s: the end of the scenario was after it and is before it"));
        let text = said(&record, &[one], &record, &[one, two]);
        assert!(text.ends_with("frame 18 at 0.850 s: the end of the scenario was before it and is after it"));
        let text = said(&record, &[one], &recorded(&[("digest", json!("00"))]), &[one]);
        assert!(text.ends_with("the outcome: `digest` was \"ff\" and is \"00\""), "{text}");
    }

    #[test]
    fn a_process_that_was_lost_is_an_outcome_like_any_other() {
        let lost =
            [("cause", json!("error")), ("success", json!(false)), ("error", json!("driver: it aborts"))];
        let record = recorded(&lost);
        assert!(said(&record, &[], &record, &[]).ends_with(" equal"));
        // What came of it says more than that its trace is empty.
        let text = said(&record, &[], &recorded(&[]), &[step()]);
        assert!(text.contains("the outcome: `cause` was \"error\" and is \"finished\""), "{text}");
        let text = said(&recorded(&[]), &[step()], &record, &[]);
        assert!(text.contains("the outcome: `cause` was \"finished\" and is \"error\""), "{text}");
        // And a trace that is empty does not count as equal, although the outcomes are equal.
        let text = said(&recorded(&[]), &[step()], &recorded(&[]), &[]);
        assert!(text.ends_with("the end of the scenario was after it and is before it"), "{text}");
    }
}
