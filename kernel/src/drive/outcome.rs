//! What happened in a scenario.

use pdk_sdk::prelude::{Control, State};
use serde::{Deserialize, Serialize};

use super::plan::{Mode, ScenarioSpec};
use crate::component::ComponentSpec;

/// Seconds of simulation time between two samples of the telemetry that metrics are computed from.
pub const TELEMETRY_INTERVAL: f64 = 0.25;

/// A vehicle that covers less than this share of a metre a second makes no progress.
const STANDSTILL_SPEED: f64 = 0.1;

/// So many seconds of standing still end a scenario.
const STANDSTILL_SECONDS: f64 = 5.0;

/// How a scenario ended.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Cause {
    /// The end of the road was reached: the only success.
    Finished,
    /// The vehicle left its lane.
    LaneDeparture,
    /// The vehicle hit something.
    Collision,
    /// The vehicle stood still.
    NoProgress,
    /// The time limit came before the end of the road.
    TimeOut,
    /// A component failed; nothing can be said about the driver.
    Error,
}

impl Cause {
    /// As it is written in tables.
    pub fn text(self) -> &'static str {
        match self {
            Cause::Finished => "finished",
            Cause::LaneDeparture => "lane departure",
            Cause::Collision => "collision",
            Cause::NoProgress => "no progress",
            Cause::TimeOut => "time-out",
            Cause::Error => "error",
        }
    }
}

/// One line of `scenarios.jsonl`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// The number of the scenario in its run.
    pub index: u64,
    /// What was driven.
    pub scenario: ScenarioSpec,
    /// The simulator that it was driven in.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub simulator: Option<ComponentSpec>,
    /// The driver that drove.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub driver: Option<ComponentSpec>,
    /// Every how many frames there is an image in the trace; 0 for none.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub images_every: Option<u64>,
    /// What happened while the driver was thinking.
    #[serde(default, skip_serializing_if = "Mode::is_lockstep")]
    pub mode: Mode,
    /// Frames that the driver did not see, because it was still at work on an earlier one.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub skipped_frames: u64,
    /// Whether the end of the road was reached.
    pub success: bool,
    /// How it ended.
    pub cause: Cause,
    /// What failed, where a component did.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
    /// Simulation time at the end in seconds.
    pub time: f64,
    /// Frames that were driven.
    pub frames: u64,
    /// The share of the road that was driven, 0 to 1.
    pub progress: f64,
    /// Mean of the absolute cross-track error over the telemetry, in metres.
    pub mean_cross_track_error: f64,
    /// Largest absolute cross-track error over the telemetry, in metres.
    pub max_cross_track_error: f64,
    /// Hash over every frame that the driver saw and every control it gave: equal for equal runs.
    pub digest: String,
    /// The telemetry, sampled every quarter of a second and at the end.
    pub telemetry: Vec<Sample>,
    /// The road that was driven: `x,height,z@x,height,z@...` in metres; empty where the simulator does not tell.
    pub waypoints: String,
}

fn is_zero(count: &u64) -> bool {
    *count == 0
}

/// One sample of the telemetry.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct Sample {
    /// The number of the frame.
    pub frame: u64,
    /// What the vehicle did.
    #[serde(flatten)]
    pub state: State,
    /// What the driver decided.
    #[serde(flatten)]
    pub control: Control,
}

/// Watches a scenario for its end and collects its telemetry.
pub struct Observer {
    duration: f64,
    next_sample: f64,
    standing_since: Option<f64>,
    samples: Vec<Sample>,
}

impl Observer {
    /// An observer of a scenario with this time limit in seconds.
    pub fn new(duration: f64) -> Self {
        let capacity = (duration / TELEMETRY_INTERVAL) as usize + 2;
        Self { duration, next_sample: 0.0, standing_since: None, samples: Vec::with_capacity(capacity) }
    }

    /// Notes a step, and says whether the scenario ends with it.
    pub fn step(&mut self, frame: u64, state: State, control: Control) -> Option<Cause> {
        let end = self.end(&state);
        // Half a millisecond allows for times that are sums of rounded frame times.
        if end.is_some() || state.time + 0.0005 >= self.next_sample {
            self.samples.push(Sample { frame, state, control });
            self.next_sample += TELEMETRY_INTERVAL;
        }
        end
    }

    fn end(&mut self, state: &State) -> Option<Cause> {
        if state.speed.abs() >= STANDSTILL_SPEED {
            self.standing_since = None;
        }
        let standing_since = match (self.standing_since, state.speed.abs() < STANDSTILL_SPEED) {
            (None, true) => *self.standing_since.insert(state.time),
            (since, _) => since.unwrap_or(state.time),
        };
        if state.collision {
            Some(Cause::Collision)
        } else if state.lane_departure {
            Some(Cause::LaneDeparture)
        } else if state.finished {
            Some(Cause::Finished)
        } else if state.time - standing_since >= STANDSTILL_SECONDS {
            Some(Cause::NoProgress)
        } else if state.time + 0.0005 >= self.duration {
            Some(Cause::TimeOut)
        } else {
            None
        }
    }

    /// Mean and largest absolute cross-track error.
    pub fn cross_track_error(&self) -> (f64, f64) {
        let errors = self.samples.iter().map(|sample| sample.state.cross_track_error.abs());
        let (sum, max) = errors.fold((0.0, 0.0), |(sum, max): (f64, f64), e| (sum + e, max.max(e)));
        (sum / self.samples.len().max(1) as f64, max)
    }

    /// The telemetry.
    pub fn into_samples(self) -> Vec<Sample> {
        self.samples
    }
}

/// The road as a waypoint string.
pub fn waypoint_string(points: &[[f64; 3]]) -> String {
    let points: Vec<_> = points.iter().map(|[x, y, z]| format!("{x},{y},{z}")).collect();
    points.join("@")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn state(time: f64) -> State {
        State { time, speed: 5.0, ..State::default() }
    }

    #[test]
    fn telemetry_is_sampled_every_quarter_second_and_at_the_end() {
        let mut observer = Observer::new(1.0);
        let mut end = None;
        for frame in 0..100 {
            end = observer.step(frame, state(frame as f64 / 30.0), Control::default());
            if end.is_some() {
                break;
            }
        }
        assert_eq!(end, Some(Cause::TimeOut));
        let times: Vec<_> = observer.into_samples().iter().map(|s| s.state.time).collect();
        assert_eq!(times.len(), 5, "{times:?}");
    }

    #[test]
    fn failures_end_a_scenario() {
        let control = Control::default();
        let departed = State { lane_departure: true, finished: true, ..state(1.0) };
        assert_eq!(Observer::new(9.0).step(0, departed, control), Some(Cause::LaneDeparture));
        let mut observer = Observer::new(60.0);
        let standing = |time| State { speed: 0.0, ..state(time) };
        assert_eq!(observer.step(0, standing(1.0), control), None);
        assert_eq!(observer.step(1, standing(5.9), control), None);
        assert_eq!(observer.step(2, standing(6.0), control), Some(Cause::NoProgress));
    }

    #[test]
    fn a_pause_that_ends_is_no_standstill() {
        let mut observer = Observer::new(60.0);
        let control = Control::default();
        observer.step(0, State { speed: 0.0, ..state(1.0) }, control);
        observer.step(1, state(3.0), control);
        assert_eq!(observer.step(2, State { speed: 0.0, ..state(7.0) }, control), None);
    }
}
