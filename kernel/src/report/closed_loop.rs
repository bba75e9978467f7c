//! Scenarios as a page shows them.

use std::collections::BTreeMap;
use std::path::Path;

use pdk_report::{Drive, Place as Position, Scenario, Verdict};

use super::ClipFolder;
use crate::chain::Spec;
use crate::component::ComponentSpec;
use crate::drive::{Cause, Outcome};

/// The scenarios of each pair of simulator and driver, in the order in which the pairs come first.
pub fn drives(outcomes: &[Outcome], folder: &Path, clips: &ClipFolder) -> Vec<Drive> {
    let mut drives: Vec<(Drive, BTreeMap<&str, usize>)> = Vec::new();
    for outcome in outcomes {
        let (simulator, driver) = (component(outcome.simulator.as_ref()), component(outcome.driver.as_ref()));
        let known =
            drives.iter().position(|(drive, _)| drive.simulator == simulator && drive.driver == driver);
        let known = known.unwrap_or_else(|| {
            drives.push((Drive { simulator, driver, ..Drive::default() }, BTreeMap::new()));
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
}
