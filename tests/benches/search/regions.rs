//! Every strategy on problems with known critical regions, against random search.

use std::time::Duration;

use pdk_components::registry::Registry;
use pdk_model::search::Range;
use serde_json::{Value, json};

use crate::problems::{Known, all};
use crate::tables::{Cell, tables};
use crate::{UNIT, of_each, search, space};

/// The largest of the whole numbers, from 0.
const WHOLE: f64 = 40.0;
/// Two failures are of different kinds if they are farther apart than this, as in the record of a search.
const DISTINCT: f64 = 0.1;

/// The measures of a search.
pub const MEASURES: [&str; 4] =
    ["share of the regions found", "share of their volume covered", "failures", "kinds of failures"];

/// Strategies by their label, and by name and parameters.
fn strategies() -> Vec<(&'static str, &'static str, Value)> {
    let published = json!({"variant": "published", "generations": 5, "mutation": 0.25, "eta_mutation": 15, "crossover": 0.7});
    vec![
        ("random", "random", json!({})),
        ("grid", "grid", json!({})),
        ("sobol", "sobol", json!({})),
        ("latin_hypercube", "latin_hypercube", json!({})),
        ("nsga2", "nsga2", json!({})),
        ("nsga2_dt", "nsga2_dt", json!({})),
        ("published", "nsga2_dt", published),
        ("map_elites", "map_elites", json!({})),
        ("surrogate", "surrogate", json!({})),
    ]
}

/// Searches, prints a line for each problem and strategy, and at the end the tables.
pub fn regions(registry: &Registry, seeds: u64, evaluations: u64, only: &[&str], problems: &[&str]) {
    println!("\n{evaluations} evaluations, {seeds} seeds: means");
    println!(
        "{:<12} {:<6} {:<16} {:>7} {:>8} {:>9} {:>7} {:>7} {:>7}",
        "problem", "", "strategy", "found", "covered", "failures", "kinds", "first", "s"
    );
    let strategies: Vec<_> = strategies()
        .into_iter()
        .filter(|(label, ..)| only.is_empty() || only.contains(label) || *label == "random")
        .collect();
    let mut cells = Vec::new();
    for problem in all().iter().filter(|problem| problems.is_empty() || problems.contains(&problem.name)) {
        for whole in [false, true] {
            for (label, name, parameters) in &strategies {
                let all = of_each(seeds, |seed| {
                    one(registry, (name, parameters), problem, whole, seed, evaluations)
                });
                let numbers = if whole { "whole" } else { "real" };
                let mean = |of: fn(&Measured) -> f64| all.iter().map(of).sum::<f64>() / seeds as f64;
                println!(
                    "{:<12} {numbers:<6} {label:<16} {:>7.3} {:>8.3} {:>9.1} {:>7.1} {:>7.0} {:>7.2}",
                    problem.name,
                    mean(|m| m.measures[0]),
                    mean(|m| m.measures[1]),
                    mean(|m| m.measures[2]),
                    mean(|m| m.measures[3]),
                    mean(|m| m.first),
                    mean(|m| m.own.as_secs_f64()),
                );
                cells.push(Cell {
                    problem: problem.name,
                    about: problem.about,
                    numbers,
                    strategy: label,
                    searches: all.into_iter().map(|measured| measured.measures).collect(),
                });
            }
        }
    }
    tables(&cells);
}

/// What came of a search.
struct Measured {
    measures: [f64; 4],
    /// Evaluations until the first failure; one more than there were if there was none.
    first: f64,
    /// The strategy's own time.
    own: Duration,
}

fn one(
    registry: &Registry,
    strategy: (&str, &Value),
    problem: &Known,
    whole: bool,
    seed: u64,
    evaluations: u64,
) -> Measured {
    let (range, most) =
        if whole { (Range::Integer { min: 0, max: WHOLE as i64 }, WHOLE) } else { (UNIT, 1.0) };
    let space = space(problem.variables, range);
    let shares = |x: &[f64]| x.iter().map(|x| x / most).collect::<Vec<f64>>();
    let judge = |x: &[f64]| problem.judge(&shares(x));
    let (all, own) = search(registry, strategy, &space, seed, evaluations, &judge, problem.objectives);
    let mut kinds: Vec<&[f64]> = Vec::new();
    for point in all.iter().filter(|point| point.critical) {
        if kinds.iter().all(|other| space.distance(other, &point.x) > DISTINCT) {
            kinds.push(&point.x);
        }
    }
    let critical: Vec<Vec<f64>> =
        all.iter().filter(|point| point.critical).map(|point| shares(&point.x)).collect();
    let regions = &problem.regions;
    let found = regions.iter().filter(|region| critical.iter().any(|x| region.holds(x))).count();
    let covered: f64 = regions.iter().map(|region| region.covered(&critical)).sum();
    let first = all.iter().position(|point| point.critical).unwrap_or(all.len()) + 1;
    let measures = [
        found as f64 / regions.len() as f64,
        covered / regions.len() as f64,
        critical.len() as f64,
        kinds.len() as f64,
    ];
    Measured { measures, first: first as f64, own }
}
