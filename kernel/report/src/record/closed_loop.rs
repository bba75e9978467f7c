//! Scenarios as a page shows them.

use std::collections::BTreeMap;
use std::path::Path;

use pdk_report::{Drive, Place as Position, Scenario, Verdict};

use super::ClipFolder;
use crate::chain::Spec;
use crate::component::ComponentSpec;
use crate::drive::plan::Mode;
use crate::drive::{Cause, Outcome};

/// The scenarios of each simulator, driver and mode, in the order in which these come first.
pub fn drives(outcomes: &[Outcome], folder: &Path, clips: &ClipFolder) -> Vec<Drive> {
    let mut drives: Vec<(Drive, BTreeMap<&str, usize>)> = Vec::new();
    for outcome in outcomes {
        let (simulator, driver) = (component(outcome.simulator.as_ref()), component(outcome.driver.as_ref()));
        let mode = match outcome.mode {
            Mode::Lockstep => "lockstep",
            Mode::Realtime => "real time",
        };
        let known = drives.iter().position(|(drive, _)| {
            drive.simulator == simulator && drive.driver == driver && drive.mode == mode
        });
        let known = known.unwrap_or_else(|| {
            drives.push((
                Drive { simulator, driver, mode: mode.to_owned(), ..Drive::default() },
                BTreeMap::new(),
            ));
            drives.len() - 1
        });
        let (drive, roads) = &mut drives[known];
        let mut scenario = scenario(outcome, folder, clips);
        scenario.road = match roads.get(outcome.waypoints.as_str()) {
            Some(number) => Some(*number),
            None => road(outcome).map(|road| {
                drive.roads.push(road);
                roads.insert(&outcome.waypoints, drive.roads.len() - 1);
                drive.roads.len() - 1
            }),
        };
        drive.scenarios.push(scenario);
    }
    drives.into_iter().map(|(drive, _)| drive).collect()
}

/// The centre line of the road, seen from above; none where the simulator did not tell, or no line.
fn road(outcome: &Outcome) -> Option<Vec<[f64; 2]>> {
    if outcome.waypoints.is_empty() {
        return None;
    }
    match pdk_road::parse(&outcome.waypoints) {
        Ok(points) => Some(points.into_iter().map(|[x, _, z]| [x, z]).collect()),
        Err(error) => {
            eprintln!("pdk: warning: scenario {} is shown without its road: {error}", outcome.index);
            None
        }
    }
}

/// A component with its parameters, as a pipeline writes it in short.
fn component(spec: Option<&ComponentSpec>) -> String {
    // Records of earlier versions do not say.
    let Some(spec) = spec else { return "not recorded".to_owned() };
    let parameters: Vec<String> =
        spec.parameters.iter().map(|(key, value)| format!("{key}={value}")).collect();
    match parameters.is_empty() {
        true => spec.name.clone(),
        false => format!("{} ({})", spec.name, parameters.join(", ")),
    }
}

fn scenario(outcome: &Outcome, folder: &Path, clips: &ClipFolder) -> Scenario {
    let (perturbation, level) = condition(&outcome.scenario.perturbations);
    let clip = format!("scenario-{}.mp4", outcome.index);
    let there = clips.path.join(&clip).is_file();
    Scenario {
        index: outcome.index,
        name: outcome.scenario.name.clone(),
        perturbation,
        level,
        road: None,
        verdict: match outcome.cause {
            Cause::Error => Verdict::Void,
            _ if outcome.success => Verdict::Passed,
            _ => Verdict::Failed,
        },
        cause: outcome.cause.text().to_owned(),
        error: outcome.error.clone().unwrap_or_default(),
        time: outcome.time,
        skipped_frames: outcome.skipped_frames,
        progress: outcome.progress,
        mean_error: outcome.mean_cross_track_error,
        max_error: outcome.max_cross_track_error,
        path: outcome
            .telemetry
            .iter()
            .map(|sample| {
                let [x, _, z] = sample.state.position;
                Position { x, z, error: sample.state.cross_track_error }
            })
            .collect(),
        replay: super::replay(folder, outcome.index),
        clip: if there { pdk_report::address(&format!("{}/{clip}", clips.address)) } else { String::new() },
        shots: Vec::new(),
    }
}

/// The row and the column of a scenario: what perturbs it without the level, and the level, where all have the same.
fn condition(specs: &[Spec]) -> (Option<String>, Option<f64>) {
    let Some(first) = specs.first() else { return (None, None) };
    let joined = |text: &dyn Fn(&Spec) -> String| specs.iter().map(text).collect::<Vec<_>>().join(" + ");
    let level = first.level.constant().filter(|_| specs.iter().all(|spec| spec.level == first.level));
    match level {
        Some(_) => (Some(joined(&Spec::label)), level),
        None => (Some(joined(&Spec::to_string)), None),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_level_that_all_share_is_the_column() {
        let specs =
            |texts: &[&str]| texts.iter().map(|text| Spec::parse(text, 0.0).unwrap()).collect::<Vec<_>>();
        let of = |texts: &[&str]| condition(&specs(texts));
        assert_eq!(of(&[]), (None, None));
        assert_eq!(of(&["fog@2,thick=3"]), (Some("fog,thick=3".into()), Some(2.0)));
        assert_eq!(of(&["fog@2", "rain@2"]), (Some("fog + rain".into()), Some(2.0)));
        assert_eq!(of(&["fog@2", "rain@1"]), (Some("fog@2 + rain@1".into()), None));
        let (name, level) = of(&[r#"fog@{"ramp":{"from":0,"to":4,"end":10}}"#]);
        assert!(name.unwrap().starts_with("fog@{\"ramp\"") && level.is_none());
    }

    #[test]
    fn what_was_driven_otherwise_stands_apart_and_roads_are_shared() {
        let outcome = |index: u64, mode: &str, waypoints: &str| -> Outcome {
            let value = serde_json::json!({
                "index": index, "mode": mode, "waypoints": waypoints, "success": false, "cause": "time_out",
                "scenario": { "name": "x", "road": null, "perturbations": [], "duration": 1.0, "seed": null },
                "time": 1.0, "frames": 20, "progress": 0.5, "mean_cross_track_error": 0.1,
                "max_cross_track_error": 0.2, "digest": "", "telemetry": [],
            });
            serde_json::from_value(value).unwrap()
        };
        let line = "0,0,0@1,5,20";
        let outcomes = [
            outcome(0, "lockstep", line),
            outcome(1, "realtime", line),
            outcome(2, "lockstep", line),
            outcome(3, "lockstep", ""),
            outcome(4, "lockstep", "0,0,inf"),
        ];
        let clips = ClipFolder { path: "/nonexistent".into(), address: "clips".into() };
        let drives = drives(&outcomes, Path::new("run"), &clips);
        let modes: Vec<_> = drives.iter().map(|drive| drive.mode.as_str()).collect();
        assert_eq!(modes, ["lockstep", "real time"]);
        assert_eq!(drives[0].roads, [[[0.0, 0.0], [1.0, 20.0]]]);
        let roads: Vec<_> = drives[0].scenarios.iter().map(|scenario| scenario.road).collect();
        assert_eq!(roads, [Some(0), Some(0), None, None]);
        assert_eq!(drives[0].scenarios[1].replay, "pdk replay run --scenario 2");
        assert!(
            drives
                .iter()
                .flat_map(|d| &d.scenarios)
                .all(|s| s.verdict == Verdict::Failed && s.clip.is_empty())
        );
    }
}
