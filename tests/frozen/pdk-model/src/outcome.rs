//! What came of a scenario.

use serde::{Deserialize, Serialize};

use crate::error::ErrorKind;

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

/// What came of a scenario.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Outcome {
    /// Whether the end of the road was reached.
    pub success: bool,
    /// How it ended.
    pub cause: Cause,
    /// What failed, where a component did.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
    /// In which way it failed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub error_kind: Option<ErrorKind>,
    /// Simulation time at the end in seconds.
    pub time: f64,
    /// Frames that were driven.
    pub frames: u64,
    /// Frames that the driver did not see, because it was still at work on an earlier one.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub skipped_frames: u64,
    /// The share of the road that was driven, 0 to 1.
    pub progress: f64,
    /// Mean of the absolute cross-track error in metres.
    pub mean_cross_track_error: f64,
    /// Largest absolute cross-track error in metres.
    pub max_cross_track_error: f64,
    /// Hash over every frame that the driver saw and every control it gave: equal for equal runs.
    pub digest: String,
}

impl Outcome {
    /// That of a scenario in which a component failed before anything could be measured.
    pub fn of_error(kind: ErrorKind, message: String) -> Self {
        Self {
            success: false,
            cause: Cause::Error,
            error: Some(message),
            error_kind: Some(kind),
            time: 0.0,
            frames: 0,
            skipped_frames: 0,
            progress: 0.0,
            mean_cross_track_error: 0.0,
            max_cross_track_error: 0.0,
            digest: String::new(),
        }
    }
}

fn is_zero(count: &u64) -> bool {
    *count == 0
}
