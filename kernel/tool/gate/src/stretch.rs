//! The recordings that a suite names, and the stretches of them that take the place of roads.

use pdk_loop::protocol::{EvaluateFrames, Subject};
use pdk_model::scenario::Scenario;
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// A recording whose blocks are drawn.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Recording {
    /// A folder or a file, or a reader as a table.
    pub dataset: Value,
    /// How many of its frames, from the first; all if it is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub frames: Option<usize>,
    /// Frames of a block.
    #[serde(default = "default_block")]
    pub block: usize,
    /// Frames before a block that a driver sees as well, so that it has what it remembers of them.
    #[serde(default = "default_warm_up")]
    pub warm_up: usize,
    /// A driver fails a block if its steering is off by more than this on average.
    #[serde(default = "default_steering_error")]
    pub steering_error: f64,
}

fn default_block() -> usize {
    100
}

fn default_warm_up() -> usize {
    20
}

fn default_steering_error() -> f64 {
    0.1
}

/// Which frames of a recording a block has, and what counts as a failure: the road of its scenario.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Stretch {
    /// The first frame of the sequence without a gap to which the block belongs.
    pub sequence: usize,
    /// The first frame that the driver sees.
    pub from: usize,
    /// The first frame that counts.
    pub start: usize,
    /// The frame behind the last.
    pub end: usize,
    /// The block is failed if the steering is off by more than this on average.
    pub steering_error: f64,
}

impl Stretch {
    /// The stretch of a scenario; none if it is driven on a road.
    pub fn of(scenario: &Scenario) -> Option<Self> {
        serde_json::from_value(scenario.road.clone()).ok()
    }

    /// The job that has a driver look at the frames of a scenario.
    pub fn job(&self, scenario: &Scenario) -> EvaluateFrames {
        EvaluateFrames {
            dataset: scenario.simulator.clone(),
            subject: Subject::Driver(scenario.driver.clone()),
            perturbation: scenario.perturbations.first().cloned(),
            seed: scenario.seed,
            sequence: self.sequence,
            earliest: None,
            from: self.from,
            start: self.start,
            end: self.end,
        }
    }

    /// What is wrong with it in a recording of this many frames; none if nothing is.
    pub fn mistake(&self, frames: usize) -> Option<String> {
        let Self { sequence, from, start, end, .. } = *self;
        let ordered = sequence <= from && from <= start && start < end;
        (!ordered || end > frames).then(|| {
            format!("frames {start} to {end} of a sequence from {sequence} are not among its {frames} frames")
        })
    }
}
