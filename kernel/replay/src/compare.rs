//! Compares what the loop does with what is recorded.

use std::collections::BTreeMap;
use std::fmt;
use std::path::Path;

use pdk_sdk::error::{Error, Result};
use pdk_sdk::prelude::{Camera, Control, Frame, State};
use serde::Serialize;
use serde_json::Value;

use super::clip::Clip;
use crate::drive::{Outcome, ScenarioSpec, Witness};
use crate::record::RunDirectory;
use crate::record::manifest::difference;
use crate::record::trace_reader::{Step, read_steps};

/// What there is to say of a scenario.
#[derive(Debug)]
pub struct Compared {
    /// The number of the scenario in its run.
    pub index: u64,
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
    /// The number of the frame; none where the frames are equal and the outcome is not.
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
        write!(f, "scenario {} ({}): ", self.index, self.short_name)?;
        match &self.finding {
            Finding::Equal => write!(f, "{} frames, equal", self.frames),
            Finding::Different(difference) => difference.fmt(f),
            Finding::Unreadable(error) => error.fmt(f),
        }
    }
}

/// The name of a scenario, cut off where it does not fit into a line.
pub fn short_name(scenario: &ScenarioSpec) -> String {
    const LONGEST: usize = 60;
    let name = &scenario.name;
    match name.char_indices().nth(LONGEST) {
        Some((end, _)) => format!("{}...", &name[..end]),
        None => name.clone(),
    }
}

/// Compares the scenarios that one thread drives with their record, and may film one of them.
pub struct Compare<'a> {
    directory: &'a RunDirectory,
    outcomes: &'a BTreeMap<u64, Outcome>,
    /// The steps in the trace of the scenario at hand.
    recorded: Vec<Step>,
    /// How many steps were driven again.
    seen: usize,
    difference: Option<Difference>,
    clip: Option<Clip<'a>>,
}

impl<'a> Compare<'a> {
    /// Compares with these outcomes and the traces in this folder; `clip` is the video to write.
    pub fn new(
        directory: &'a RunDirectory,
        outcomes: &'a BTreeMap<u64, Outcome>,
        clip: Option<&'a Path>,
    ) -> Self {
        Self {
            directory,
            outcomes,
            recorded: Vec::new(),
            seen: 0,
            difference: None,
            clip: clip.map(Clip::new),
        }
    }
}

impl Witness for Compare<'_> {
    type Verdict = Compared;

    fn start(&mut self, index: u64, camera: Camera) -> Result<Option<Compared>> {
        self.difference = None;
        self.seen = 0;
        let Some(outcome) = self.outcomes.get(&index) else {
            return Err(Error::new(format!("scenario {index} is not in the record")));
        };
        match read_steps(&self.directory.trace_path(index)) {
            Ok(steps) => self.recorded = steps,
            Err(error) => {
                return Ok(Some(compared(outcome, 0, Finding::Unreadable(error))));
            }
        }
        if let Some(clip) = &mut self.clip {
            clip.start(camera, outcome, &self.recorded)?;
        }
        Ok(None)
    }

    fn event(&mut self, _time: f64, _failure: bool, _text: &str) {}

    fn step(&mut self, step: &Step, raw: Frame<'_>, perturbed: Frame<'_>) {
        if self.difference.is_none() {
            self.difference = match self.recorded.get(self.seen) {
                Some(recorded) => step_difference(recorded, step),
                None => Some(another_end(step, "before", "after")),
            };
        }
        self.seen += 1;
        if let Some(clip) = &mut self.clip {
            clip.step(step, raw, perturbed);
        }
    }

    fn skipped(&self, sequence: u64) -> Option<u64> {
        // The record knows; behind its end there is nothing left to compare.
        let next = self.recorded.partition_point(|step| step.sequence <= sequence);
        Some(self.recorded.get(next).map_or(0, |step| step.sequence - sequence - 1))
    }

    fn finish(&mut self, outcome: Outcome) -> Result<Compared> {
        if let Some(clip) = &mut self.clip {
            clip.finish(&outcome)?;
        }
        let frames = outcome.frames;
        let next = usize::try_from(frames).ok().and_then(|frames| self.recorded.get(frames));
        let ends_early = || next.map(|step| another_end(step, "after", "before"));
        let found = self.difference.take().or_else(ends_early);
        let found = match (found, self.outcomes.get(&outcome.index)) {
            (None, Some(recorded)) => outcome_difference(recorded, &outcome)?,
            (found, _) => found,
        };
        let finding = found.map_or(Finding::Equal, Finding::Different);
        Ok(compared(&outcome, frames, finding))
    }
}

fn compared(outcome: &Outcome, frames: u64, finding: Finding) -> Compared {
    let (index, name) = (outcome.index, outcome.scenario.name.clone());
    Compared { index, name, short_name: short_name(&outcome.scenario), frames, finding }
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

/// The first thing that differs, in the order in which the loop makes them: state, frame, control.
fn step_difference(recorded: &Step, replayed: &Step) -> Option<Difference> {
    let found = |what: &str, was: String, is: String| {
        let frame = Some(replayed.sequence);
        // Where it is the time that differs, the time as recorded.
        let time = Some(recorded.state.time);
        Some(Difference { frame, time, what: what.to_owned(), recorded: was, replayed: is })
    };
    if recorded.sequence != replayed.sequence {
        return found("its number", recorded.sequence.to_string(), replayed.sequence.to_string());
    }
    let numbers = numbers(&recorded.state).into_iter().zip(numbers(&replayed.state));
    for ((what, was), (_, is)) in numbers {
        if was.to_bits() != is.to_bits() {
            return found(what, was.to_string(), is.to_string());
        }
    }
    for ((what, was), (_, is)) in flags(&recorded.state).into_iter().zip(flags(&replayed.state)) {
        if was != is {
            return found(what, was.to_string(), is.to_string());
        }
    }
    if recorded.frame_hash != replayed.frame_hash {
        let hash = |step: &Step| format!("{:016x}", step.frame_hash);
        return found("the hash of the frame", hash(recorded), hash(replayed));
    }
    for ((what, was), (_, is)) in controls(recorded.control).into_iter().zip(controls(replayed.control)) {
        if was.to_bits() != is.to_bits() {
            return found(what, was.to_string(), is.to_string());
        }
    }
    None
}

fn numbers(state: &State) -> [(&'static str, f64); 9] {
    let [x, height, z] = state.position;
    [
        ("time", state.time),
        ("x", x),
        ("height", height),
        ("z", z),
        ("heading", state.heading),
        ("speed", state.speed),
        ("cross_track_error", state.cross_track_error),
        ("progress", state.progress),
        ("vehicle_ahead", state.vehicle_ahead),
    ]
}

fn flags(state: &State) -> [(&'static str, bool); 3] {
    [("lane_departure", state.lane_departure), ("collision", state.collision), ("finished", state.finished)]
}

fn controls(control: Control) -> [(&'static str, f64); 2] {
    [("steering", control.steering), ("throttle", control.throttle)]
}

/// The first field of the outcome that differs.
fn outcome_difference(recorded: &Outcome, replayed: &Outcome) -> Result<Option<Difference>> {
    // Both as they come out of a file.
    let read =
        |outcome: &Outcome| -> Result<Value> { Ok(serde_json::from_str(&serde_json::to_string(outcome)?)?) };
    let found = difference("", &read(recorded)?, &read(replayed)?);
    Ok(found.map(|(what, was, is)| Difference {
        frame: None,
        time: None,
        what,
        recorded: was.to_string(),
        replayed: is.to_string(),
    }))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn step() -> Step {
        let state = State { time: 0.85, speed: 8.0, ..State::default() };
        Step { sequence: 17, state, control: Control::default(), frame_hash: 0xabc }
    }

    #[test]
    fn every_field_of_a_step_is_compared_bit_for_bit() {
        assert_eq!(step_difference(&step(), &step()), None);
        type Change = fn(&mut Step);
        let changes: [(&str, Change); 15] = [
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

    #[test]
    fn courses_of_intensity_are_left_out_of_names() {
        let mut scenario = ScenarioSpec {
            name: String::new(),
            road: Value::Null,
            perturbations: Vec::new(),
            duration: 1.0,
            seed: None,
        };
        scenario.name = "foggy".to_owned();
        assert_eq!(short_name(&scenario), "foggy");
        scenario.name = "ä".repeat(70);
        assert_eq!(short_name(&scenario), format!("{}...", "ä".repeat(60)));
    }
}
