//! Scenarios in the JSON shape of the published tool (PerturbationDrive 1.0), so that scripts written for it go on
//! working.

use pdk_sdk::error::{Place, Result};
use serde::Serialize;

use super::RunDirectory;
use crate::drive::{Cause, Outcome};

/// One scenario as the published tool writes it.
#[derive(Debug, Serialize)]
pub struct PublishedOutcome {
    /// Numbers of the sampled frames.
    pub frames: Vec<u64>,
    /// Positions as `[x, z, height]` in metres, in the published order of axes.
    pub pos: Vec<[f64; 3]>,
    /// Cross-track errors in metres.
    pub xte: Vec<f64>,
    /// Speeds in metres per second.
    pub speeds: Vec<f64>,
    /// `[steering, throttle]`.
    pub actions: Vec<[f64; 2]>,
    /// What was driven.
    pub scenario: PublishedScenario,
    /// Whether the end of the road was reached.
    #[serde(rename = "isSuccess")]
    pub is_success: bool,
    /// Whether the time limit came first.
    pub timeout: bool,
}

/// What was driven, as the published tool writes it.
#[derive(Debug, Serialize)]
pub struct PublishedScenario {
    /// The road as a waypoint string.
    pub waypoints: String,
    /// The perturbation; several are joined with a plus sign, and none is empty.
    pub perturbation_function: String,
    /// Its level: that of the first where there are several, that at the start where it changes, 0 where there is none.
    pub perturbation_scale: f64,
}

impl From<Outcome> for PublishedOutcome {
    fn from(outcome: Outcome) -> Self {
        let samples = &outcome.telemetry;
        let perturbations = &outcome.scenario.perturbations;
        let names: Vec<_> = perturbations.iter().map(|p| p.name.as_str()).collect();
        Self {
            frames: samples.iter().map(|s| s.frame).collect(),
            pos: samples
                .iter()
                .map(|s| [s.state.position[0], s.state.position[2], s.state.position[1]])
                .collect(),
            xte: samples.iter().map(|s| s.state.cross_track_error).collect(),
            speeds: samples.iter().map(|s| s.state.speed).collect(),
            actions: samples.iter().map(|s| [s.control.steering, s.control.throttle]).collect(),
            scenario: PublishedScenario {
                perturbation_function: names.join("+"),
                perturbation_scale: perturbations.first().and_then(|p| p.level.at(0.0)).unwrap_or_default(),
                waypoints: outcome.waypoints,
            },
            is_success: outcome.success,
            timeout: outcome.cause == Cause::TimeOut,
        }
    }
}

/// All scenarios of a run in the published shape, in order.
///
/// # Errors
/// Where the folder holds no record of a closed loop.
pub fn outcomes(directory: &RunDirectory) -> Result<Vec<PublishedOutcome>> {
    Ok(super::read_outcomes(directory)?.into_iter().map(PublishedOutcome::from).collect())
}

/// Writes them to a file.
///
/// # Errors
/// Where it cannot be written.
pub fn write(path: &std::path::Path, outcomes: &[PublishedOutcome]) -> Result<()> {
    let text = serde_json::to_vec_pretty(outcomes)?;
    std::fs::write(path, text).place(format_args!("cannot write {}", path.display()))
}
