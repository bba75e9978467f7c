//! Searches as a page shows them, from the files that they leave in the record.

use std::collections::HashMap;
use std::fs;
use std::path::Path;

use pdk_model::canonical::canonical;
use pdk_model::component::ComponentSpec;
use pdk_model::scenario::Scenario;
use pdk_model::search::{Space, label};
use pdk_record::directory::RunDirectory;
use pdk_record::ledger::Line;
use pdk_sdk::error::{Place, Result};
use pdk_terminal::shell;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};

use crate::view::{Branch, Reached, Region, Search, Test};

/// What a search left.
#[derive(Deserialize)]
struct Found {
    name: String,
    strategy: Value,
    /// Whether the strategy learns nothing.
    #[serde(default)]
    baseline: bool,
    seed: u64,
    space: Space,
    objectives: Vec<Objective>,
    stopped: String,
    evaluations: usize,
    duplicates: usize,
    failures: usize,
    critical: usize,
    first_critical: Option<usize>,
    distinct_failures: Vec<usize>,
    front: Vec<usize>,
    /// None if none was given.
    hypervolume_reference: Option<Vec<f64>>,
    convergence: Vec<Convergence>,
    tree: Option<Tree>,
    tests: Vec<Tested>,
}

#[derive(Serialize, Deserialize)]
struct Objective {
    name: String,
    direction: String,
}

#[derive(Deserialize)]
struct Convergence {
    evaluations: usize,
    hypervolume: Option<f64>,
    distinct_failures: usize,
}

#[derive(Deserialize)]
struct Tree {
    nodes: Vec<Node>,
    critical_regions: Vec<Leaf>,
}

#[derive(Deserialize)]
struct Node {
    evaluations: usize,
    critical: usize,
    split: Option<Split>,
}

#[derive(Deserialize)]
struct Split {
    condition: String,
    below: usize,
    above: usize,
}

#[derive(Deserialize)]
struct Leaf {
    region: String,
    evaluations: usize,
    critical: usize,
}

#[derive(Deserialize)]
struct Tested {
    values: Map<String, Value>,
    #[serde(default)]
    objectives: Map<String, Value>,
    #[serde(default)]
    critical: bool,
    #[serde(default)]
    cause: String,
    #[serde(default)]
    scenario: String,
}

/// The searches of a run, by their names: each has a table and a JSON file of the same name. The lines hold the scenarios that
/// they drove.
///
/// # Errors
/// If a file cannot be read.
pub fn read(directory: &RunDirectory, folder: &Path, lines: &[Line]) -> Result<Vec<Search>> {
    let scenarios: HashMap<String, &Scenario> =
        lines.iter().map(|line| (line.id.to_string(), &line.scenario)).collect();
    let mut tables = Vec::new();
    for entry in fs::read_dir(directory.path()).place(directory.path().display())? {
        let path = entry.place(directory.path().display())?.path();
        if path.extension().is_some_and(|ending| ending == "csv") && path.with_extension("json").is_file() {
            tables.push(path.with_extension("json"));
        }
    }
    tables.sort();
    let search = |path: &std::path::PathBuf| {
        let text = fs::read(path).place(path.display())?;
        let found: Found = serde_json::from_slice(&text).place(path.display())?;
        let driven = found.tests.iter().filter_map(|test| scenarios.get(&test.scenario).copied());
        let shared = shared(driven);
        Ok(view(found, folder, &shared))
    };
    tables.iter().map(search).collect()
}

/// What decides the outcomes of all these scenarios, but for road and perturbations; null if there are none. A parameter that
/// a search varies is left out.
fn shared<'a>(scenarios: impl Iterator<Item = &'a Scenario>) -> Value {
    let setting = |scenario: &Scenario| {
        json!({
            "simulator": scenario.simulator, "driver": scenario.driver, "duration": scenario.duration,
            "failure": scenario.failure, "mode": scenario.mode,
        })
    };
    let mut scenarios = scenarios.map(setting);
    let Some(first) = scenarios.next() else { return Value::Null };
    scenarios.fold(first, |mut shared, other| {
        keep_shared(&mut shared, &other);
        shared
    })
}

/// Removes the fields that are not the same in both, within fields as well.
fn keep_shared(shared: &mut Value, other: &Value) {
    let (Value::Object(fields), Value::Object(others)) = (shared, other) else { return };
    fields.retain(|name, value| match others.get(name) {
        Some(other) if value.is_object() && other.is_object() => {
            keep_shared(value, other);
            true
        }
        other => other == Some(&*value),
    });
}

/// A component that all scenarios share, for people; empty if they do not.
fn component(value: &Value) -> String {
    ComponentSpec::deserialize(value).map_or_else(|_| String::new(), |component| component.to_string())
}

fn view(found: Found, folder: &Path, shared: &Value) -> Search {
    let mut tree = Vec::new();
    if let Some(found) = &found.tree {
        walk(&found.nodes, 0, 0, "all tests", &mut tree);
    }
    let leaf = |leaf: &Leaf| Region {
        words: leaf.region.clone(),
        evaluations: leaf.evaluations,
        critical: leaf.critical,
    };
    let test = |test: &Tested| Test {
        values: found
            .space
            .variables
            .iter()
            .map(|variable| test.values.get(&variable.name).map(label).unwrap_or_default())
            .collect(),
        positions: found.space.positions(&test.values).unwrap_or_default(),
        objectives: found.objectives.iter().filter_map(|o| test.objectives.get(&o.name)?.as_f64()).collect(),
        critical: test.critical,
        cause: test.cause.replace('_', " "),
        replay: match test.scenario.is_empty() {
            true => String::new(),
            false => shell::replay(folder, &test.scenario),
        },
    };
    Search {
        strategy: strategy(&found.strategy),
        baseline: found.baseline,
        seed: found.seed,
        stopped: found.stopped.clone(),
        evaluations: found.evaluations,
        duplicates: found.duplicates,
        failures: found.failures,
        critical: found.critical,
        first_critical: found.first_critical,
        setting: canonical(&json!([found.space, found.objectives, found.hypervolume_reference, shared])),
        simulator: component(&shared["simulator"]),
        driver: component(&shared["driver"]),
        has_reference: found.hypervolume_reference.is_some(),
        ranges: found.space.variables.iter().map(|variable| variable.range.to_string()).collect(),
        variables: found.space.variables.iter().map(|variable| variable.name.clone()).collect(),
        objectives: found.objectives.iter().map(|objective| objective.name.clone()).collect(),
        tests: found.tests.iter().map(test).collect(),
        distinct: found.distinct_failures.clone(),
        front: found.front.clone(),
        regions: found.tree.iter().flat_map(|tree| tree.critical_regions.iter().map(leaf)).collect(),
        tree,
        convergence: found
            .convergence
            .iter()
            .map(|point| Reached {
                evaluations: point.evaluations,
                hypervolume: point.hypervolume.unwrap_or_default(),
                distinct: point.distinct_failures,
            })
            .collect(),
        name: found.name,
    }
}

/// The nodes of a tree from the root, each before those beneath it.
fn walk(nodes: &[Node], place: usize, depth: usize, words: &str, lines: &mut Vec<Branch>) {
    let Some(node) = nodes.get(place) else { return };
    lines.push(Branch {
        depth,
        words: words.to_owned(),
        evaluations: node.evaluations,
        critical: node.critical,
    });
    // Each node stands before those beneath it, so that this also ends for a file that was written by hand.
    if let Some(split) = node.split.as_ref().filter(|split| split.below > place && split.above > place) {
        walk(nodes, split.below, depth + 1, &split.condition, lines);
        walk(nodes, split.above, depth + 1, &format!("not {}", split.condition), lines);
    }
}

fn strategy(value: &Value) -> String {
    match value {
        Value::String(name) => name.clone(),
        value => ComponentSpec::from_json("strategy", &flat(value))
            .map_or_else(|_| value.to_string(), |spec| spec.to_string()),
    }
}

/// A component with its parameters beside its name.
fn flat(value: &Value) -> Value {
    let mut table = value.as_object().cloned().unwrap_or_default();
    if let Some(Value::Object(parameters)) = table.remove("parameters") {
        table.extend(parameters);
    }
    Value::Object(table)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scenario(width: u64, light: &str, driver: &str) -> Scenario {
        let value = json!({
            "simulator": {"name": "lane", "parameters": {"width": width, "light": light}},
            "driver": {"name": driver}, "duration": 3.0, "seed": 0,
        });
        serde_json::from_value(value).unwrap()
    }

    fn search(scenarios: &[Scenario], change: impl Fn(&mut Value)) -> Search {
        let mut found = json!({
            "name": "search", "strategy": "functions", "seed": 0, "stopped": "evaluations", "evaluations": 0, "duplicates": 0,
            "failures": 0, "critical": 0, "first_critical": null, "distinct_failures": [], "front": [],
            "space": {"variables": [{"name": "x", "type": "real", "min": 0.0, "max": 4.0}]},
            "objectives": [{"name": "f", "direction": "minimise"}], "hypervolume_reference": [1.0], "convergence": [],
            "tree": null, "tests": [],
        });
        change(&mut found);
        view(serde_json::from_value(found).unwrap(), Path::new("run"), &shared(scenarios.iter()))
    }

    #[test]
    fn the_setting_is_all_that_does_not_vary_within_a_search() {
        // The light is searched as well.
        let one = search(&[scenario(320, "day", "a"), scenario(320, "dusk", "a")], |_| ());
        let two = search(&[scenario(320, "dusk", "a"), scenario(320, "overcast", "a")], |_| ());
        assert_eq!(one.setting, two.setting);
        assert_eq!((one.simulator.as_str(), one.driver.as_str()), ("lane (width=320)", "a"));
        assert!(one.has_reference);
        let none = search(&[], |_| ());
        assert!(none.simulator.is_empty() && none.driver.is_empty());
        let both = search(&[scenario(320, "day", "a"), scenario(320, "dusk", "b")], |_| ());
        assert!(both.driver.is_empty(), "{}", both.driver);
        let size = search(&[scenario(640, "day", "a"), scenario(640, "dusk", "a")], |_| ());
        let driver = search(&[scenario(320, "day", "b"), scenario(320, "dusk", "b")], |_| ());
        for other in [none, both, size, driver] {
            assert_ne!(one.setting, other.setting);
        }
    }

    #[test]
    fn the_setting_has_ranges_directions_and_the_reference() {
        let changed = |pointer: &str, value: Value| {
            search(&[], |found| *found.pointer_mut(pointer).unwrap() = value.clone())
        };
        let one = search(&[], |_| ());
        assert_eq!(one.setting, changed("/seed", json!(7)).setting);
        for (pointer, value) in [
            ("/space/variables/0/max", json!(3.0)),
            ("/objectives/0/direction", json!("maximise")),
            ("/hypervolume_reference", json!([2.0])),
            ("/hypervolume_reference", Value::Null),
        ] {
            assert_ne!(one.setting, changed(pointer, value).setting, "{pointer}");
        }
        assert!(!changed("/hypervolume_reference", Value::Null).has_reference);
    }
}
