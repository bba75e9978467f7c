//! Suites of what failed before: fixed scenarios that a driver has to pass from now on.

use pdk_model::scenario::Scenario;
use pdk_record::ledger::Line;
use pdk_sdk::error::{Error, Result};
use serde_json::{Map, Value};

use crate::requirement::{Kind, Requirement};
use crate::suite::{Suite, Test};

/// A suite of the scenarios in which a driver failed.
///
/// # Errors
/// If none did, or a scenario cannot be TOML.
pub fn of_failures(lines: &[&Line], name: &str, place: &str) -> Result<String> {
    let failed = lines.iter().filter(|line| line.outcome.cause.verdict().failed());
    let scenarios: Vec<&Scenario> = failed.map(|line| &line.scenario).collect();
    if scenarios.is_empty() {
        return Err(Error::new(format!(
            "no driver failed in {place}, so there is nothing to make a suite of"
        )));
    }
    of_scenarios(scenarios, name, &format!("What failed in {place} has to pass from now on"))
}

/// A suite of scenarios, each once.
///
/// # Errors
/// If a scenario cannot be TOML.
pub fn of_scenarios<'a>(
    scenarios: impl IntoIterator<Item = &'a Scenario>,
    name: &str,
    about: &str,
) -> Result<String> {
    let mut tables: Vec<Map<String, Value>> = Vec::new();
    for scenario in scenarios {
        let mut table = match serde_json::to_value(scenario)? {
            Value::Object(table) => table,
            _ => Map::new(),
        };
        // The driver is the one under test, and files are hashed anew.
        table.shift_remove("driver");
        table.shift_remove("files");
        if !tables.contains(&table) {
            tables.push(table);
        }
    }
    let suite = Suite {
        name: name.to_owned(),
        version: 1,
        about: about.to_owned(),
        perturbations: Vec::new(),
        levels: Vec::new(),
        nominal: 0.0,
        places: Vec::new(),
        recordings: Vec::new(),
        test: Test::default(),
        requirements: vec![Requirement::of(Kind::Passes { allowed: 0 })],
        scenarios: tables,
    };
    toml::to_string(&suite)
        .map_err(|error| Error::new(format!("the scenarios cannot be written as TOML ({error})")))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::suite;
    use crate::series::Series;
    use crate::step::steps;
    use serde_json::json;

    fn line(seed: u64, cause: &str) -> Line {
        let value = json!({
            "id": "00000000000000000000000000000001", "name": "x", "images_every": 0, "success": false, "cause": cause, "time": 1.0,
            "frames": 5, "progress": 0.5, "mean_cross_track_error": 0.1, "max_cross_track_error": 0.2, "digest": "",
            "scenario": {
                "simulator": {"name": "flat", "parameters": {"light": "dusk"}}, "driver": {"name": "x"},
                "road": {"angles": [0, -1.5, 3], "segment": 25.0},
                "perturbations": [{"name": "fog", "level": 2.5, "parameters": {"size": 3}}],
                "duration": 12.5, "failure": {"lane_departure": 4.0}, "seed": seed,
            },
        });
        serde_json::from_value(value).unwrap()
    }

    #[test]
    fn what_failed_comes_back_as_it_was() {
        let lines = [
            line(1, "lane_departure"),
            line(2, "finished"),
            line((1 << 53) - 1, "time_out"),
            line(1, "lane_departure"),
        ];
        let text = of_failures(&lines.iter().collect::<Vec<_>>(), "never_again", "runs/x").unwrap();
        let loaded = suite(&text).unwrap();
        let steps: Vec<_> = steps(&loaded).collect::<Result<Vec<_>>>().unwrap();
        assert_eq!(steps.len(), 2, "{text}");
        for (step, line) in steps.iter().zip([&lines[0], &lines[2]]) {
            let mut scenario = step.scenario.clone();
            scenario.driver = line.scenario.driver.clone();
            assert_eq!((scenario.id(), step.series), (line.scenario.id(), Series::Fixed));
        }
        let error = of_failures(&[&lines[1]], "a", "runs/x").unwrap_err().to_string();
        assert!(error.contains("no driver failed in runs/x"), "{error}");
    }
}
