//! Searches as a page shows them, from the files that they leave in the record.

use std::fs;
use std::path::Path;

use pdk_core::directory::RunDirectory;
use pdk_model::search::{Space, label};
use pdk_sdk::error::{Place, Result};
use serde::Deserialize;
use serde_json::{Map, Value};

use super::shell::quoted;
use crate::view::{Branch, Reached, Region, Search, Test};

/// What a search left.
#[derive(Deserialize)]
struct Found {
    name: String,
    strategy: Value,
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
    convergence: Vec<Convergence>,
    tree: Option<Tree>,
    tests: Vec<Tested>,
}

#[derive(Deserialize)]
struct Objective {
    name: String,
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

/// The searches of a run, by their names: each has a table and a JSON file of the same name.
///
/// # Errors
/// Where a file cannot be read.
pub fn read(directory: &RunDirectory, folder: &Path) -> Result<Vec<Search>> {
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
        Ok(view(found, folder))
    };
    tables.iter().map(search).collect()
}

fn view(found: Found, folder: &Path) -> Search {
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
            false => format!("pdk replay {} --scenario {}", quoted(&folder.to_string_lossy()), test.scenario),
        },
    };
    Search {
        strategy: strategy(&found.strategy),
        seed: found.seed,
        stopped: found.stopped.clone(),
        evaluations: found.evaluations,
        duplicates: found.duplicates,
        failures: found.failures,
        critical: found.critical,
        first_critical: found.first_critical,
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
    // Each node stands before those beneath it, so that this ends also for a file that somebody wrote.
    if let Some(split) = node.split.as_ref().filter(|split| split.below > place && split.above > place) {
        walk(nodes, split.below, depth + 1, &split.condition, lines);
        walk(nodes, split.above, depth + 1, &format!("not {}", split.condition), lines);
    }
}

fn strategy(value: &Value) -> String {
    match value {
        Value::String(name) => name.clone(),
        value => pdk_model::component::ComponentSpec::from_json("strategy", &flat(value))
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
