//! How good the search strategies are on problems whose answers are known. Needs no simulator:
//!
//! ```sh
//! cargo build --release && cargo bench --bench search -- [fronts|regions|least] [--seeds N] [--evaluations N] [--only STRATEGY,...] [--problems PROBLEM,...]
//! ```
//!
//! [`fronts`]: NSGA-II on problems of the literature, by the hypervolume of its last population. `pymoo_reference.py`
//! runs the same with pymoo and writes what [`fronts`] compares with.
//!
//! [`regions`]: every strategy on problems with known critical regions, against random search. It ends with the tables of
//! `docs/search.md`.
//!
//! [`least`]: every strategy on problems whose cheapest failure is known.

// A benchmark may fail like a test.
#![allow(clippy::unwrap_used)]

#[path = "search/fronts.rs"]
mod fronts;
#[path = "search/least.rs"]
mod least;
#[path = "search/problems.rs"]
mod problems;
#[path = "search/regions.rs"]
mod regions;
#[path = "search/tables.rs"]
mod tables;

use std::collections::HashSet;
use std::num::NonZero;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use pdk_components::registry::Registry;
use pdk_components::search_path::SearchPath;
use pdk_model::search::{Evaluated, Problem, Range, Space, Variable};
use pdk_sdk::seed::Key;
use pdk_statistics::point::Point;
use serde_json::{Map, Value};

/// What is known of a candidate: objectives, and whether it is critical.
type Judge<'a> = &'a (dyn Fn(&[f64]) -> (Vec<f64>, bool) + Sync);

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    let after = |name: &str| {
        let place = arguments.iter().position(|argument| argument == name);
        place.map(|place| arguments[place + 1].as_str())
    };
    let number = |name: &str, default: u64| after(name).map_or(default, |text| text.parse().unwrap());
    let list = |name: &str| after(name).map_or(Vec::new(), |text| text.split(',').collect());
    let wants = |part: &str| {
        let parts = ["fronts", "regions", "least"];
        !arguments.iter().any(|argument| parts.contains(&argument.as_str()))
            || arguments.iter().any(|argument| argument == part)
    };
    let path = SearchPath::default();
    let registry = pdk_tests::registry(&path);
    let problems = list("--problems");
    if wants("fronts") {
        fronts::fronts(&registry, number("--seeds", 31), &problems);
    }
    if wants("regions") {
        regions::regions(
            &registry,
            number("--seeds", 20),
            number("--evaluations", 1000),
            &list("--only"),
            &problems,
        );
    }
    if wants("least") {
        least::least(&registry, number("--seeds", 20), &list("--only"));
    }
}

/// A search until this many candidates were evaluated, each once: all of them, and the time that the strategy took.
fn search(
    registry: &Registry,
    strategy: (&str, &Value),
    space: &Space,
    seed: u64,
    evaluations: u64,
    judge: Judge<'_>,
    objectives: usize,
) -> (Vec<Point>, Duration) {
    let (name, parameters) = strategy;
    let mut instance = registry.search(name, parameters.as_object().unwrap_or(&Map::new())).unwrap().0;
    let key = pdk_sdk::seed::key(seed, name, 0);
    let objectives: Vec<String> = (1..=objectives).map(|number| format!("f{number}")).collect();
    let problem = Problem { space: space.clone(), objectives, evaluations: Some(evaluations) };
    let mut own = Duration::ZERO;
    let clock = |own: &mut Duration, since: Instant| *own += since.elapsed();
    let since = Instant::now();
    instance.start(&problem, &Key(key.0)).unwrap();
    clock(&mut own, since);
    let (mut all, mut known, mut idle) = (Vec::new(), HashSet::new(), 0);
    while (all.len() as u64) < evaluations && idle < 10_000 {
        let since = Instant::now();
        let candidates = instance.ask(75).unwrap();
        clock(&mut own, since);
        if candidates.is_empty() {
            break;
        }
        let mut results = Vec::new();
        for candidate in candidates {
            let x = space.positions(&candidate.values).unwrap();
            let (objectives, critical) = judge(&x);
            let violations = space.violations(&x);
            idle += 1;
            if known.insert(format!("{x:?}")) && (all.len() as u64) < evaluations {
                let violation = violations.iter().map(|violation| violation.max(0.0)).sum();
                all.push(Point { x, f: objectives.clone(), violation, critical });
                idle = 0;
            }
            results.push(Evaluated { id: candidate.id, objectives, violations, critical, failure: None });
        }
        let since = Instant::now();
        instance.tell(&results).unwrap();
        clock(&mut own, since);
    }
    (all, own)
}

fn space(variables: usize, range: Range) -> Space {
    let variable = |i| Variable { name: format!("x{i:02}"), range: range.clone() };
    Space { variables: (0..variables).map(variable).collect(), constraints: Vec::new() }
}

const UNIT: Range = Range::Real { min: 0.0, max: 1.0 };

/// What comes of each seed, in their order, on all processors.
fn of_each<T: Send>(seeds: u64, of_seed: impl Fn(u64) -> T + Sync) -> Vec<T> {
    let next = AtomicU64::new(0);
    let workers = std::thread::available_parallelism().map_or(1, NonZero::get);
    let work = || {
        let mut done = Vec::new();
        loop {
            match next.fetch_add(1, Ordering::Relaxed) {
                seed if seed < seeds => done.push((seed, of_seed(seed))),
                _ => return done,
            }
        }
    };
    let mut all: Vec<(u64, T)> = std::thread::scope(|scope| {
        let workers: Vec<_> = (0..workers).map(|_| scope.spawn(work)).collect();
        workers.into_iter().flat_map(|worker| worker.join().unwrap()).collect()
    });
    all.sort_by_key(|(seed, _)| *seed);
    all.into_iter().map(|(_, result)| result).collect()
}

/// The middle of sorted values.
fn median(sorted: &[f64]) -> f64 {
    let middle = sorted.len() / 2;
    if sorted.len() % 2 == 1 { sorted[middle] } else { (sorted[middle - 1] + sorted[middle]) / 2.0 }
}
