//! Every strategy on problems whose cheapest failure is known: what the cheapest that it found costs, divided by that.

use pdk_components::registry::Registry;
use pdk_model::search::{Constraint, Range};
use serde_json::{Value, json};

use crate::problems::noise;
use crate::tables::{against, holm, mark};
use crate::{UNIT, median, of_each, search, space};

/// The numbers of evaluations after which the results are compared.
const AFTER: [usize; 2] = [100, 300];
/// The objective is capped this far beyond the border, so that it says nothing more about what fails.
const BEYOND: f64 = 1.05;
/// Below this nothing counts, in the problem with a threshold.
const THRESHOLD: f64 = 0.3;

/// A problem over variables from 0 to 1, which cost their sum, and lists, which cost nothing. A candidate is critical if its `danger` is at least 1.
struct Problem {
    about: &'static str,
    variables: usize,
    danger: fn(&[f64]) -> f64,
    /// What the cheapest failure costs.
    least: f64,
    /// The space, if not all variables are real.
    ranges: Option<Vec<Range>>,
    constraints: Vec<Constraint>,
}

impl Problem {
    fn judge(&self, x: &[f64]) -> (Vec<f64>, bool) {
        let danger = (self.danger)(x);
        let costs =
            |i: &usize| !matches!(self.ranges.as_ref().map(|all| &all[*i]), Some(Range::Choice { .. }));
        let cost = (0..x.len()).filter(costs).map(|i| x[i]).sum();
        (vec![-danger.min(BEYOND), cost], danger >= 1.0)
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

/// Three of six variables have to exceed the threshold; it does not matter which.
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

/// Places in a list of four, in which those that help most are neither first nor last.
fn choices(x: &[f64]) -> f64 {
    let effect = [0.2, 0.1, 0.5, 0.0][x[0] as usize] + [0.1, 0.4, 0.0, 0.2][x[1] as usize];
    effect + 0.9 * x[2] + 0.3 * x[3]
}

/// Whether each of six switches is on, which costs as much as a level, beside two levels.
fn switches(x: &[f64]) -> f64 {
    let on: f64 = x[..6].iter().zip([0.3, 0.1, 0.5, 0.05, 0.2, 0.1]).map(|(on, effect)| on * effect).sum();
    (on + 0.4 * x[6] + 0.2 * x[7]) / 0.8
}

fn problems() -> Vec<Problem> {
    let problem = |about, variables, danger, least| Problem {
        about,
        variables,
        danger,
        least,
        ranges: None,
        constraints: Vec::new(),
    };
    let list = || Range::Choice { values: (0..4).map(Value::from).collect() };
    let whole = |max| Range::Integer { min: 0, max };
    // The cheapest failure takes two thirds of what all may add up to.
    let bound = Constraint {
        weights: (0..6).map(|i| (format!("x{i:02}"), 1.0)).collect(),
        at_most: 1.5 * least_weighted(6),
    };
    vec![
        problem("unequal weights", 6, weighted, least_weighted(6)),
        problem("unequal weights, 12 variables", 12, weighted, least_weighted(12)),
        problem("diminishing effect", 6, roots, least_roots(6)),
        problem("no effect below a threshold", 6, threshold, 2.5 * (1.0 - THRESHOLD) + 3.0 * THRESHOLD),
        problem("two of six, and only together", 6, both, 1.0),
        problem("two separate ways to fail", 6, either, 1.2),
        problem("unequal weights, noise of 10 %", 6, rough, least_weighted(6)),
        problem("unequal weights, nothing leads", 6, hidden, least_weighted(6)),
        Problem {
            constraints: vec![bound],
            ..problem(
                "unequal weights, all together at most 1.5 times the least",
                6,
                weighted,
                least_weighted(6),
            )
        },
        Problem {
            ranges: Some(vec![list(), list(), UNIT, UNIT]),
            ..problem("two choices of four and two levels", 4, choices, 0.1 / 0.9)
        },
        Problem {
            ranges: Some([vec![whole(1); 6], vec![UNIT; 2]].concat()),
            ..problem("six switches and two levels", 8, switches, 1.75)
        },
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
    let problems = problems();
    for problem in &problems {
        let of_strategy = |(name, parameters): &(&str, Value)| {
            let of_seed = |seed| one(registry, (name, parameters), problem, seed);
            let found = of_each(seeds, of_seed);
            [0, 1].map(|when| found.iter().map(|found| found[when]).collect())
        };
        all.push(strategies.iter().map(of_strategy).collect());
    }
    let compared = |searches: &[[Vec<f64>; 2]], strategy: usize, when: usize| {
        against(&searches[strategy][when], &searches[0][when])
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
    for (problem, searches) in problems.iter().zip(&all) {
        let cells = (0..strategies.len()).map(|strategy| {
            let cells = [0, 1].map(|when| {
                let (larger, p) = compared(searches, strategy, when);
                let mark = mark(1.0 - larger, p, largest);
                let mut costs = searches[strategy][when].clone();
                costs.sort_by(f64::total_cmp);
                match median(&costs) {
                    cost if cost.is_finite() => format!("{mark}{cost:.2}{mark}"),
                    _ => "–".to_owned(),
                }
            });
            cells.join(", ")
        });
        println!("| {} | {} |", problem.about, cells.collect::<Vec<_>>().join(" | "));
    }
}

/// What the cheapest failure that one search found costs, divided by the cheapest there is; infinite if it found none.
fn one(registry: &Registry, strategy: (&str, &Value), problem: &Problem, seed: u64) -> [f64; 2] {
    let mut space = space(problem.variables, UNIT);
    space.constraints.clone_from(&problem.constraints);
    for (variable, range) in space.variables.iter_mut().zip(problem.ranges.iter().flatten()) {
        variable.range = range.clone();
    }
    let judge = |x: &[f64]| problem.judge(x);
    let most = AFTER[1] as u64;
    let (all, _) = search(registry, strategy, &space, seed, most, &judge, 2);
    AFTER.map(|after| {
        let critical = all.iter().take(after).filter(|point| point.critical && point.violation == 0.0);
        critical.map(|point| point.f[1] / problem.least).fold(f64::INFINITY, f64::min)
    })
}
