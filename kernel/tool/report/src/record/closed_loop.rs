//! Scenarios as a page shows them, as far as the ledger tells; their traces tell the rest.

use std::path::Path;

use pdk_model::canonical::canonical;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_model::scenario::Mode;
use pdk_record::ledger::Line;
use pdk_terminal::shell;

use super::clips::ClipFolder;
use crate::named::Named;
use crate::view::{Drive, Scenario};

/// The scenarios of each simulator, driver and mode, in the order in which these come first. The number of a scenario is its
/// place among the lines.
pub fn drives(lines: &[Line], folder: &Path, clips: &ClipFolder) -> Vec<Drive> {
    let mut drives: Vec<Drive> = Vec::new();
    let named = Named::of(lines.iter().map(|line| &line.scenario.driver));
    for (number, line) in (0..).zip(lines) {
        let (simulator, driver) = (line.scenario.simulator.to_string(), named.name(&line.scenario.driver));
        let mode = match line.scenario.mode {
            Mode::Lockstep => "lockstep",
            Mode::Realtime => "real time",
        };
        let same =
            |drive: &Drive| drive.simulator == simulator && drive.driver == driver && drive.mode == mode;
        let place = drives.iter().position(same).unwrap_or_else(|| {
            let driver_spec = Some(line.scenario.driver.clone());
            drives.push(Drive { simulator, driver, driver_spec, mode: mode.to_owned(), ..Drive::default() });
            drives.len() - 1
        });
        drives[place].scenarios.push(scenario(number, line, folder, clips));
    }
    drives
}

fn scenario(number: u64, line: &Line, folder: &Path, clips: &ClipFolder) -> Scenario {
    let (perturbation, level) = condition(&line.scenario.perturbations);
    let outcome = &line.outcome;
    Scenario {
        index: number,
        name: line.name.clone(),
        perturbation,
        level,
        road_id: canonical(&line.scenario.road),
        seed: line.scenario.seed,
        repeat: line.scenario.repeat,
        verdict: outcome.cause.verdict(),
        cause: outcome.cause.text().to_owned(),
        error: outcome.error.clone().unwrap_or_default(),
        time: outcome.time,
        skipped_frames: outcome.skipped_frames,
        progress: outcome.progress,
        mean_error: outcome.mean_cross_track_error,
        max_error: outcome.max_cross_track_error,
        measures: outcome.measures.as_deref().copied(),
        replay: shell::replay(folder, number),
        clip: clips.address(number),
        ..Scenario::default()
    }
}

/// The row and the column of a scenario: what perturbs it without the level, and the level, where all have the same.
fn condition(applied: &[AppliedPerturbation]) -> (Option<String>, Option<f64>) {
    let Some(first) = applied.first() else { return (None, None) };
    let joined = |text: &dyn Fn(&AppliedPerturbation) -> String| {
        applied.iter().map(text).collect::<Vec<_>>().join(" + ")
    };
    let level = first.level.constant().filter(|_| applied.iter().all(|one| one.level == first.level));
    match level {
        Some(_) => (Some(joined(&AppliedPerturbation::label)), level),
        None => (Some(joined(&AppliedPerturbation::to_string)), None),
    }
}

#[cfg(test)]
mod tests {
    use super::super::clips::clip_folder;
    use super::*;
    use crate::view::Verdict;

    #[test]
    fn a_level_that_all_share_is_the_column() {
        let of = |texts: &[&str]| {
            let applied: Vec<_> =
                texts.iter().map(|text| AppliedPerturbation::parse(text).unwrap()).collect();
            condition(&applied)
        };
        assert_eq!(of(&[]), (None, None));
        assert_eq!(of(&["fog@2,thick=3"]), (Some("fog,thick=3".into()), Some(2.0)));
        assert_eq!(of(&["fog@2", "rain@2"]), (Some("fog + rain".into()), Some(2.0)));
        assert_eq!(of(&["fog@2", "rain@1"]), (Some("fog@2 + rain@1".into()), None));
        let (name, level) = of(&[r#"fog@{"ramp":{"from":0,"to":4,"end":10}}"#]);
        assert!(name.unwrap().starts_with("fog,level={\"ramp\"") && level.is_none());
    }

    #[test]
    fn what_was_driven_otherwise_stands_apart() {
        let line = |mode: &str, light: &str| -> Line {
            let value = serde_json::json!({
                "id": "00".repeat(16), "name": "x", "images_every": 0, "success": false, "cause": "time_out",
                "time": 1.0, "frames": 20, "progress": 0.5, "mean_cross_track_error": 0.1,
                "max_cross_track_error": 0.2, "digest": "", "scenario": {
                    "simulator": {"name": "lane", "parameters": {"light": light}}, "driver": {"name": "d"},
                    "duration": 1.0, "seed": 0, "mode": mode,
                },
            });
            serde_json::from_value(value).unwrap()
        };
        let lines = [
            line("lockstep", "dusk"),
            line("realtime", "dusk"),
            line("lockstep", "dusk"),
            line("lockstep", "day"),
        ];
        let here = Path::new(env!("CARGO_MANIFEST_DIR"));
        let clips = clip_folder(here, &here.join("report.html")).unwrap();
        let drives = drives(&lines, Path::new("run"), &clips);
        let told: Vec<_> = drives
            .iter()
            .map(|drive| {
                let numbers: Vec<_> = drive.scenarios.iter().map(|scenario| scenario.index).collect();
                (drive.simulator.as_str(), drive.mode.as_str(), numbers)
            })
            .collect();
        let dusk = "lane (light=dusk)";
        let expected = [
            (dusk, "lockstep", vec![0, 2]),
            (dusk, "real time", vec![1]),
            ("lane (light=day)", "lockstep", vec![3]),
        ];
        assert_eq!(told, expected);
        assert_eq!(drives[0].scenarios[1].replay, "pdk replay run --scenario 2");
        let mut all = drives.iter().flat_map(|d| &d.scenarios);
        assert!(all.all(|s| s.verdict == Verdict::Late && s.clip.is_empty() && s.road.is_none()));
    }
}
