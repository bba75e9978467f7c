//! Scenarios in the JSON shape of the published tool (PerturbationDrive 1.0), so that scripts written for it go on
//! working.

use std::path::Path;

use pdk_model::outcome::Cause;
use pdk_record::directory::RunDirectory;
use pdk_record::ledger::{self, Line};
use pdk_record::trace::reader::{Owner, read_recorded};
use pdk_record::trace::step::Step;
use pdk_sdk::error::{Place, Result};
use serde::Serialize;

use crate::telemetry::samples;

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
    /// Its level: that of the first if there are several, that at the start if it changes, 0 if there is none.
    pub perturbation_scale: f64,
}

impl PublishedOutcome {
    /// A scenario with these steps in its trace.
    fn new(line: &Line, steps: &[Step], waypoints: String) -> Self {
        let samples = samples(steps);
        let perturbations = &line.scenario.perturbations;
        let names: Vec<_> = perturbations.iter().map(|p| p.name.as_str()).collect();
        let position = |step: &Step| {
            let [x, height, z] = step.state.position;
            [x, z, height]
        };
        Self {
            frames: samples.iter().map(|s| s.sequence).collect(),
            pos: samples.iter().map(position).collect(),
            xte: samples.iter().map(|s| s.state.cross_track_error).collect(),
            speeds: samples.iter().map(|s| s.state.speed).collect(),
            actions: samples.iter().map(|s| s.control.numbers()).collect(),
            scenario: PublishedScenario {
                perturbation_function: names.join("+"),
                perturbation_scale: perturbations.first().and_then(|p| p.level.at(0.0)).unwrap_or_default(),
                waypoints,
            },
            is_success: line.outcome.success,
            timeout: line.outcome.cause == Cause::TimeOut,
        }
    }
}

/// All scenarios of a run in the published shape, in order, and whether a last line that was cut off is left out; their samples
/// come from the traces.
///
/// # Errors
/// If the folder holds no record of a closed loop, or a trace is missing or damaged.
pub fn outcomes(directory: &RunDirectory) -> Result<(Vec<PublishedOutcome>, bool)> {
    let (lines, cut_off) = ledger::read(directory)?;
    let read = |line: &Line| {
        let (steps, waypoints) = read_recorded(&directory.trace_path(&line.id), Owner::of(line))?;
        Ok(PublishedOutcome::new(line, &steps, waypoints))
    };
    let outcomes = pdk_parallel::map(&lines, read).into_iter().collect::<Result<_>>()?;
    Ok((outcomes, cut_off))
}

/// Writes them to a file.
///
/// # Errors
/// If it cannot be written.
pub fn write(path: &Path, outcomes: &[PublishedOutcome]) -> Result<()> {
    let text = serde_json::to_vec_pretty(outcomes)?;
    pdk_sdk::file::write(path, &text).place(format_args!("cannot write {}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_record::ledger::Ledger;
    use pdk_record::trace::writer::Trace;
    use pdk_sdk::prelude::{Control, State};
    use serde_json::json;

    #[test]
    fn scenarios_are_exported_with_the_samples_of_their_traces() {
        let folder = std::env::temp_dir().join(format!("pdk-published-{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&folder);
        let directory = RunDirectory::create(&folder).unwrap();
        let fog = json!({"name": "fog", "level": 2.0});
        let rain = json!({"name": "rain", "level": 1.0});
        let mut line: Line = serde_json::from_value(json!({
            "id": "00".repeat(16), "name": "x", "images_every": 0, "success": false, "cause": "time_out",
            "time": 0.5, "frames": 6, "progress": 0.5, "mean_cross_track_error": 0.1,
            "max_cross_track_error": 0.2, "digest": "", "scenario": {
                "simulator": {"name": "lane"}, "driver": {"name": "d"}, "duration": 0.5, "seed": 0,
                "perturbations": [fog, rain],
            },
        }))
        .unwrap();
        line.id = line.scenario.id();
        Ledger::open(&directory).unwrap().add(&line).unwrap();
        let error = outcomes(&directory).unwrap_err().to_string();
        assert!(error.contains("is missing"), "{error}");
        let mut trace = Trace::create(&directory.trace(&line.id).unwrap(), &line.id).unwrap();
        for sequence in 0..6 {
            let time = sequence as f64 / 10.0;
            let state = State {
                time,
                position: [1.0, 2.0, time],
                cross_track_error: -0.5,
                speed: 8.0,
                ..State::default()
            };
            let control = Control { steering: 0.25, throttle: 0.75 };
            trace.step(&Step { sequence, state, control, ..Step::default() }).unwrap();
        }
        trace.road("0,0,0@1,5,20").unwrap();
        trace.event(0.5, true, "time out").unwrap();
        trace.finish().unwrap();
        let expected = json!([{
            "frames": [0, 3, 5], "pos": [[1.0, 0.0, 2.0], [1.0, 0.3, 2.0], [1.0, 0.5, 2.0]],
            "xte": [-0.5, -0.5, -0.5], "speeds": [8.0, 8.0, 8.0],
            "actions": [[0.25, 0.75], [0.25, 0.75], [0.25, 0.75]],
            "scenario": {
                "waypoints": "0,0,0@1,5,20", "perturbation_function": "fog+rain", "perturbation_scale": 2.0,
            },
            "isSuccess": false, "timeout": true,
        }]);
        assert_eq!(serde_json::to_value(outcomes(&directory).unwrap().0).unwrap(), expected);
        std::fs::remove_dir_all(folder).unwrap();
    }
}
