//! Every strategy on problems whose cheapest failure is known: what the cheapest that it found costs, divided by that.

use pdk_components::registry::Registry;
use pdk_statistics::independent::compare;
use serde_json::{Value, json};

use crate::problems::noise;
use crate::tables::holm;
use crate::{UNIT, of_each, search, space};

/// After how many evaluations is looked.
const AFTER: [usize; 2] = [100, 300];
/// What fails says no more than that it does: the objective ends this far beyond the border.
const BEYOND: f64 = 1.05;
/// Below this nothing counts, in the problem with a threshold.
const THRESHOLD: f64 = 0.3;

/// A problem over variables from 0 to 1, which cost their sum. It is critical where `danger` is at least 1.
struct Problem {
    about: &'static str,
    variables: usize,
    danger: fn(&[f64]) -> f64,
    /// What the cheapest failure costs.
    least: f64,
}

impl Problem {
    fn judge(&self, x: &[f64]) -> (Vec<f64>, bool) {
        let danger = (self.danger)(x);
        (vec![-danger.min(BEYOND), x.iter().sum()], danger >= 1.0)
    }
}

/// The weight of each variable: a half, a third ... of the first.
fn weights(n: usize) -> impl Iterator<Item = f64> {
    (1..=n).map(|i| 1.0 / i as f64)
}

fn weighted(x: &[f64]) -> f64 {
    let all: f64 = weights(x.len()).sum();
    x.iter().zip(weights(x.len())).map(|(x, weight)| x * weight).sum::<f64>() / (0.5 * all)
}

/// What [`weighted`] takes at least: the largest weights first.
fn least_weighted(n: usize) -> f64 {
    let mut missing = 0.5 * weights(n).sum::<f64>();
    weights(n).fold(0.0, |cost, weight| {
        let x = (missing / weight).clamp(0.0, 1.0);
        missing -= x * weight;
        cost + x
    })
}

/// Three of six variables have to exceed the threshold; which of them is all the same.
fn threshold(x: &[f64]) -> f64 {
    let over = x.iter().map(|x| (x - THRESHOLD).max(0.0)).sum::<f64>();
    over / (2.5 * (1.0 - THRESHOLD))
}

fn roots(x: &[f64]) -> f64 {
    let all: f64 = weights(x.len()).sum();
    x.iter().zip(weights(x.len())).map(|(x, weight)| x.sqrt() * weight).sum::<f64>() / (0.5 * all)
}

/// What [`roots`] takes at least: as much of each as its weight squared, times what is enough.
fn least_roots(n: usize) -> f64 {
    let squares: f64 = weights(n).map(|weight| weight * weight).sum();
    let factor = 0.5 * weights(n).sum::<f64>() / squares;
    factor * factor * squares
}

fn both(x: &[f64]) -> f64 {
    x[0] * x[1] / 0.25
}

/// Enough of the first three, or less of the other three.
fn either(x: &[f64]) -> f64 {
    let [first, other] = [&x[..3], &x[3..]].map(|part| part.iter().sum::<f64>());
    (first / 2.0).max(other / 1.2)
}

fn rough(x: &[f64]) -> f64 {
    weighted(x) + 0.1 * (noise(x) - 0.5)
}

/// The objective says nothing but whether it fails.
fn hidden(x: &[f64]) -> f64 {
    if weighted(x) >= 1.0 { 1.0 } else { 0.0 }
}

fn problems() -> Vec<Problem> {
    let problem = |about, variables, danger, least| Problem { about, variables, danger, least };
    vec![
        problem("unequal weights", 6, weighted, least_weighted(6)),
        problem("unequal weights, 12 variables", 12, weighted, least_weighted(12)),
        problem("diminishing effect", 6, roots, least_roots(6)),
        problem("no effect below a threshold", 6, threshold, 2.5 * (1.0 - THRESHOLD) + 3.0 * THRESHOLD),
        problem("two of six, and only together", 6, both, 1.0),
        problem("two separate ways to fail", 6, either, 1.2),
        problem("unequal weights, noise of 10 %", 6, rough, least_weighted(6)),
        problem("unequal weights, nothing leads", 6, hidden, least_weighted(6)),
    ]
}

fn strategies() -> Vec<(&'static str, Value)> {
    let towards = json!({"towards": "f1"});
    let plain = ["random", "sobol", "nsga2", "nsga2_dt", "map_elites", "surrogate"];
    plain.into_iter().map(|name| (name, json!({}))).chain([("descent", towards)]).collect()
}

/// Searches, and prints a table.
pub fn least(registry: &Registry, seeds: u64, only: &[&str]) {
    let strategies: Vec<_> = strategies()
        .into_iter()
        .filter(|(name, _)| only.is_empty() || only.contains(name) || *name == "random")
        .collect();
    println!(
        "\nThe cheapest failure found, divided by the cheapest there is, after {AFTER:?} evaluations: medians of {seeds} seeds"
    );
    // By problem, strategy and number of evaluations, of each seed.
    let mut all: Vec<Vec<[Vec<f64>; 2]>> = Vec::new();
    for problem in problems() {
        let of_strategy = |(name, parameters): &(&str, Value)| {
            let of_seed = |seed| one(registry, (name, parameters), &problem, seed);
            let found = of_each(seeds, of_seed);
            [0, 1].map(|when| found.iter().map(|found| found[when]).collect())
        };
        all.push(strategies.iter().map(of_strategy).collect());
    }
    let compared = |searches: &[[Vec<f64>; 2]], strategy: usize, when: usize| {
        compare(&searches[strategy][when], &searches[0][when])
            .map_or((0.5, 1.0), |found| (found.effect_size, found.p))
    };
    let mut tests: Vec<f64> = all
        .iter()
        .flat_map(|searches| {
            (1..strategies.len())
                .flat_map(move |strategy| [0, 1].map(|when| compared(searches, strategy, when).1))
        })
        .collect();
    let largest = holm(&mut tests);
    println!(
        "\n| problem | {} |",
        strategies.iter().map(|(name, _)| format!("`{name}`")).collect::<Vec<_>>().join(" | ")
    );
    println!("|---|{}", "---|".repeat(strategies.len()));
    for (problem, searches) in problems().iter().zip(&all) {
        let cells = (0..strategies.len()).map(|strategy| {
            let cells = [0, 1].map(|when| {
                let (effect, p) = compared(searches, strategy, when);
                let mark = match p <= largest {
                    true if effect < 0.5 => "**",
                    true if effect > 0.5 => "*",
                    _ => "",
                };
                match median(&searches[strategy][when]) {
                    cost if cost < NONE => format!("{mark}{cost:.2}{mark}"),
                    _ => "–".to_owned(),
                }
            });
            cells.join(", ")
        });
        println!("| {} | {} |", problem.about, cells.collect::<Vec<_>>().join(" | "));
    }
}

/// Stands for the cost where nothing was critical.
const NONE: f64 = 1e6;

fn one(registry: &Registry, strategy: (&str, &Value), problem: &Problem, seed: u64) -> [f64; 2] {
    let space = space(problem.variables, UNIT);
    let judge = |x: &[f64]| problem.judge(x);
    let most = AFTER[1] as u64;
    let (all, _) = search(registry, strategy, &space, seed, most, &judge, 2);
    AFTER.map(|after| {
        let critical = all.iter().take(after).filter(|point| point.critical);
        critical.map(|point| point.f[1] / problem.least).fold(NONE, f64::min)
    })
}

fn median(values: &[f64]) -> f64 {
    let mut values = values.to_vec();
    values.sort_by(f64::total_cmp);
    values[values.len() / 2]
}
