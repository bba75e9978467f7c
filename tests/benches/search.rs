//! How good the search strategies are on problems whose answers are known. Needs no simulator:
//!
//! ```sh
//! cargo build --release && cargo bench -p pdk-tests --bench search -- [fronts|regions] [--seeds N] [--evaluations N] [--only STRATEGY,...] [--problems PROBLEM,...]
//! ```
//!
//! `fronts`: NSGA-II on problems of the literature, by the hypervolume of its last population. `tests/benches/pymoo_reference.py`
//! runs the same with pymoo, and `PYMOO` holds what that gave.
//!
//! `regions`: every strategy on problems with known critical regions, against random search: the share of the regions that was
//! found, the share of the critical volume that is near a critical candidate, and the evaluations until the first one.

// A benchmark may fail like a test.
#![allow(clippy::unwrap_used)]

use std::collections::HashSet;
use std::num::NonZero;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};

use pdk_analysis::hypervolume::hypervolume;
use pdk_analysis::point::Point;
use pdk_analysis::ranking::survivors;
use pdk_core::registry::Registry;
use pdk_core::search_path::SearchPath;
use pdk_lua::LuaScripts;
use pdk_model::search::{Evaluated, Problem, Range, Space, Variable};
use pdk_sdk::ops::Key;
use pdk_statistics::independent::{Independent, compare};
use serde_json::{Map, Value, json};

/// What is known of a candidate: objectives, and whether it is critical.
type Judge = fn(&[f64]) -> (Vec<f64>, bool);

/// The medians of the hypervolume that `pymoo_reference.py` printed (pymoo 0.6.2, population 75, 200 generations, 20 seeds).
const PYMOO: &[(&str, f64)] = &[
    ("zdt1", 0.864_574),
    ("zdt2", 0.529_934),
    ("zdt3", 1.323_132),
    ("dtlz2", 0.686_819),
    ("integer", 35.660_214),
];

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).filter(|argument| argument != "--bench").collect();
    let number = |name: &str, default: u64| {
        let place = arguments.iter().position(|argument| argument == name);
        place.map_or(default, |place| arguments[place + 1].parse().unwrap())
    };
    let wants = |part: &str| {
        let parts = ["fronts", "regions"];
        !arguments.iter().any(|argument| parts.contains(&argument.as_str()))
            || arguments.iter().any(|a| a == part)
    };
    let path = SearchPath::default();
    let registry = Registry::discover(&path, Box::new(LuaScripts::new(&path))).unwrap();
    let seeds = number("--seeds", 20);
    if wants("fronts") {
        fronts(&registry, seeds);
    }
    let list = |name: &str| -> Vec<&str> {
        let place = arguments.iter().position(|argument| argument == name);
        place.map_or(Vec::new(), |place| arguments[place + 1].split(',').collect())
    };
    let (only, problems) = (list("--only"), list("--problems"));
    if wants("regions") {
        let given = number("--evaluations", 0);
        for evaluations in if given > 0 { vec![given] } else { vec![1000, 7500] } {
            regions(&registry, seeds, evaluations, (&only, &problems));
        }
    }
}

/// A search until so many candidates were evaluated, each once: all of them, and the time that the strategy took.
fn search(
    registry: &Registry,
    strategy: (&str, &Value),
    space: &Space,
    seed: u64,
    evaluations: u64,
    judge: Judge,
) -> (Vec<Point>, Duration) {
    let (name, parameters) = strategy;
    let mut instance = registry.search(name, parameters.as_object().unwrap_or(&Map::new())).unwrap().0;
    let key = pdk_sdk::seed::key(seed, name, 0);
    let objectives = vec!["f1".to_owned(), "f2".to_owned()];
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
            idle += 1;
            if known.insert(format!("{x:?}")) && (all.len() as u64) < evaluations {
                all.push(Point { x, f: objectives.clone(), violation: 0.0, critical });
                idle = 0;
            }
            results.push(Evaluated {
                id: candidate.id,
                objectives,
                violations: vec![],
                critical,
                failure: None,
            });
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

// ---- Fronts ---------------------------------------------------------------------------------------------------------

fn fronts(registry: &Registry, seeds: u64) {
    const POPULATION: usize = 75;
    const GENERATIONS: usize = 200;
    let problems: [(&str, Space, Judge, Vec<f64>); 5] = [
        ("zdt1", space(30, UNIT), |x| (zdt(x, |f, g| 1.0 - (f / g).sqrt()), false), vec![1.1; 2]),
        ("zdt2", space(30, UNIT), |x| (zdt(x, |f, g| 1.0 - (f / g) * (f / g)), false), vec![1.1; 2]),
        (
            "zdt3",
            space(30, UNIT),
            |x| {
                (zdt(x, |f, g| 1.0 - (f / g).sqrt() - f / g * (10.0 * std::f64::consts::PI * f).sin()), false)
            },
            vec![1.1; 2],
        ),
        ("dtlz2", space(12, UNIT), |x| (dtlz2(x), false), vec![1.1; 3]),
        ("integer", space(8, Range::Integer { min: 0, max: 100 }), |x| (between(x), false), vec![6.0; 2]),
    ];
    println!("NSGA-II: population {POPULATION}, {GENERATIONS} generations, {seeds} seeds");
    println!(
        "{:<10} {:>10} {:>10} {:>10} {:>10} {:>12} {:>16}",
        "problem", "lowest", "median", "highest", "pymoo", "ratio", "ms a generation"
    );
    for (name, space, judge, reference) in problems {
        let parameters = json!({"population": POPULATION, "eta_crossover": 15, "eta_mutation": 20});
        let mut volumes = Vec::new();
        let mut time = Duration::ZERO;
        for seed in 0..seeds {
            let evaluations = (POPULATION * GENERATIONS) as u64;
            let (all, own) = search(registry, ("nsga2", &parameters), &space, seed, evaluations, judge);
            time += own;
            // What survives of each generation, as in the strategy.
            let mut population: Vec<Point> = Vec::new();
            for generation in all.chunks(POPULATION) {
                let both: Vec<&Point> = population.iter().chain(generation).collect();
                population = survivors(&both, POPULATION).into_iter().map(|ranked| ranked.point).collect();
            }
            let front: Vec<Vec<f64>> = population.into_iter().map(|point| point.f).collect();
            volumes.push(hypervolume(&front, &reference));
        }
        volumes.sort_by(f64::total_cmp);
        let median = median(&volumes);
        let peer = PYMOO.iter().find(|(peer, _)| *peer == name).map(|(_, volume)| *volume);
        println!(
            "{name:<10} {:>10.5} {median:>10.5} {:>10.5} {:>10} {:>12} {:>16.3}",
            volumes[0],
            volumes[volumes.len() - 1],
            peer.map_or_else(|| "-".to_owned(), |peer| format!("{peer:.5}")),
            peer.map_or_else(|| "-".to_owned(), |peer| format!("{:.4}", median / peer)),
            time.as_secs_f64() * 1000.0 / (seeds as f64 * GENERATIONS as f64)
        );
    }
}

fn zdt(x: &[f64], shape: impl Fn(f64, f64) -> f64) -> Vec<f64> {
    let g = 1.0 + 9.0 * x[1..].iter().sum::<f64>() / (x.len() - 1) as f64;
    vec![x[0], g * shape(x[0], g)]
}

fn dtlz2(x: &[f64]) -> Vec<f64> {
    let g: f64 = x[2..].iter().map(|x| (x - 0.5) * (x - 0.5)).sum();
    let angle = |i: usize| x[i] * std::f64::consts::FRAC_PI_2;
    let (a, b) = (angle(0), angle(1));
    vec![(1.0 + g) * a.cos() * b.cos(), (1.0 + g) * a.cos() * b.sin(), (1.0 + g) * a.sin()]
}

/// The squared distances from two points of whole numbers, neither of which is at a bound.
fn between(x: &[f64]) -> Vec<f64> {
    let squares = |aim: fn(usize) -> f64| {
        x.iter().enumerate().map(|(i, x)| (x - aim(i)) / 100.0 * ((x - aim(i)) / 100.0)).sum::<f64>()
    };
    vec![squares(|i| 20.0 + 3.0 * i as f64), squares(|i| 85.0 - 5.0 * i as f64)]
}

// ---- Regions --------------------------------------------------------------------------------------------------------

/// A problem with boxes in which candidates are critical.
struct Regions {
    name: &'static str,
    /// Middle and side of each box.
    boxes: &'static [([f64; 4], f64)],
    judge: Judge,
}

/// One box of 10 % of the volume.
const LARGE: &[([f64; 4], f64)] = &[([0.35, 0.6, 0.65, 0.4], 0.562_34)];
/// Three of .3 % each.
const THREE: &[([f64; 4], f64)] =
    &[([0.2, 0.25, 0.7, 0.8], 0.234), ([0.75, 0.8, 0.25, 0.3], 0.234), ([0.8, 0.2, 0.8, 0.2], 0.234)];
/// One of .02 %.
const NEEDLE: &[([f64; 4], f64)] = &[([0.63, 0.37, 0.58, 0.71], 0.118_92)];
/// A ridge: long in two variables, narrow in the others.
const RIDGE: [(f64, f64); 4] = [(0.05, 0.95), (0.1, 0.9), (0.55, 0.65), (0.3, 0.42)];

fn inside(boxes: &[([f64; 4], f64)], x: &[f64]) -> bool {
    boxes.iter().any(|(middle, side)| middle.iter().zip(x).all(|(m, x)| (x - m).abs() <= side / 2.0))
}

/// How far it is to the nearest box, and what speaks for staying away from all.
fn leads(boxes: &[([f64; 4], f64)], x: &[f64]) -> (Vec<f64>, bool) {
    let miss = |(middle, side): &([f64; 4], f64)| {
        middle.iter().zip(x).map(|(m, x)| ((x - m).abs() - side / 2.0).max(0.0)).sum::<f64>()
    };
    let nearest = boxes.iter().map(miss).fold(f64::INFINITY, f64::min);
    (vec![nearest, x[0] * 0.2 + x[3] * 0.1], inside(boxes, x))
}

/// A number from 0 to 1 that nothing tells beforehand.
fn noise(x: &[f64]) -> f64 {
    let mut state = 0xcbf2_9ce4_8422_2325_u64;
    for byte in x.iter().flat_map(|x| x.to_bits().to_le_bytes()) {
        state = (state ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
    }
    (state ^ (state >> 29)).wrapping_mul(0xbf58_476d_1ce4_e5b9) as f64 / u64::MAX as f64
}

const PROBLEMS: &[Regions] = &[
    Regions { name: "large", boxes: LARGE, judge: |x| leads(LARGE, x) },
    Regions { name: "three", boxes: THREE, judge: |x| leads(THREE, x) },
    Regions { name: "needle", boxes: NEEDLE, judge: |x| leads(NEEDLE, x) },
    Regions {
        name: "ridge",
        boxes: &[],
        judge: |x| {
            let miss: f64 =
                RIDGE.iter().zip(x).map(|((low, high), x)| (low - x).max(x - high).max(0.0)).sum();
            (vec![miss + 0.2 * noise(x), x[0] * 0.1], miss == 0.0)
        },
    },
    Regions {
        name: "hidden",
        boxes: NEEDLE,
        judge: |x| (vec![noise(x), noise(&[x[0], x[1]])], inside(NEEDLE, x)),
    },
];

/// The whole numbers of the integer problems: 0 to this.
const WHOLE: f64 = 40.0;

/// How far a critical candidate may be from a part of the volume that it covers, in each variable.
const NEAR: f64 = 0.05;

impl Regions {
    /// Corners of the boxes.
    fn corners(&self) -> Vec<[(f64, f64); 4]> {
        match self.boxes {
            [] => vec![RIDGE],
            boxes => boxes.iter().map(|(m, side)| m.map(|m| (m - side / 2.0, m + side / 2.0))).collect(),
        }
    }
}

struct Quality {
    found: f64,
    covered: f64,
    first: f64,
}

fn quality(problem: &Regions, critical: &[(usize, Vec<f64>)], evaluations: u64) -> Quality {
    let corners = problem.corners();
    let within =
        |corners: &[(f64, f64); 4], x: &[f64]| corners.iter().zip(x).all(|((l, h), x)| l <= x && x <= h);
    let found = corners.iter().filter(|corners| critical.iter().any(|(_, x)| within(corners, x))).count();
    // Reference points: the same for all, evenly spread over the boxes.
    let per_box = 1200 / corners.len();
    let mut random = Key([9; 32]).sequence();
    let mut covered = 0;
    for corners in &corners {
        for _ in 0..per_box {
            let point = corners.map(|(low, high)| random.uniform(low, high));
            let near = |(_, x): &&(usize, Vec<f64>)| x.iter().zip(&point).all(|(a, b)| (a - b).abs() <= NEAR);
            covered += usize::from(critical.iter().find(near).is_some());
        }
    }
    Quality {
        found: found as f64 / corners.len() as f64,
        covered: covered as f64 / (per_box * corners.len()) as f64,
        first: critical.first().map_or(evaluations as f64, |(number, _)| *number as f64 + 1.0),
    }
}

fn regions(registry: &Registry, seeds: u64, evaluations: u64, (only, problems): (&[&str], &[&str])) {
    let strategies: Vec<(&str, &str, Value)> = vec![
        ("random", "random", json!({})),
        ("grid", "grid", json!({})),
        ("sobol", "sobol", json!({})),
        ("latin_hypercube", "latin_hypercube", json!({})),
        ("nsga2", "nsga2", json!({})),
        ("nsga2_dt", "nsga2_dt", json!({})),
        (
            "published",
            "nsga2_dt",
            json!({"variant": "published", "generations": 5, "mutation": 0.25, "eta_mutation": 15, "crossover": 0.7}),
        ),
        ("map_elites", "map_elites", json!({})),
        ("surrogate", "surrogate", json!({})),
    ];
    println!(
        "\n{evaluations} evaluations, {seeds} seeds: means; A: the probability that it covers more than random does"
    );
    println!(
        "{:<8} {:<8} {:<20} {:>9} {:>9} {:>9} {:>6} {:>9} {:>8}",
        "problem", "numbers", "strategy", "found", "covered", "first", "A", "p", "s"
    );
    for problem in PROBLEMS.iter().filter(|problem| problems.is_empty() || problems.contains(&problem.name)) {
        for whole in [false, true] {
            let mut chance: Vec<f64> = Vec::new();
            for (label, name, parameters) in &strategies {
                // With many evaluations its own time counts: a quarter of a minute a search.
                let slow = evaluations > 2000 && *label == "surrogate";
                if !only.contains(label) && (slow || !only.is_empty()) {
                    continue;
                }
                let of_seed = |seed| {
                    let (points, own) =
                        search_regions(registry, (name, parameters), problem, whole, seed, evaluations);
                    (quality(problem, &points, evaluations), own)
                };
                let (all, own): (Vec<Quality>, Vec<Duration>) = of_each(seeds, of_seed).into_iter().unzip();
                let mean = |value: fn(&Quality) -> f64| all.iter().map(value).sum::<f64>() / seeds as f64;
                let covered: Vec<f64> = all.iter().map(|q| q.covered).collect();
                if *label == "random" {
                    chance.clone_from(&covered);
                }
                let Independent { effect_size: effect, p } = compare(&covered, &chance).unwrap();
                println!(
                    "{:<8} {:<8} {label:<20} {:>9.3} {:>9.3} {:>9.0} {effect:>6.2} {p:>9.1e} {:>8.2}",
                    problem.name,
                    if whole { "whole" } else { "real" },
                    mean(|q| q.found),
                    mean(|q| q.covered),
                    mean(|q| q.first),
                    own.iter().sum::<Duration>().as_secs_f64() / seeds as f64,
                );
            }
        }
    }
}

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

thread_local! {
    /// The problem at hand, for [`Judge`], which holds nothing itself.
    static JUDGE: std::cell::Cell<Judge> = const { std::cell::Cell::new(|_| (Vec::new(), false)) };
}

/// The critical candidates with their numbers, in shares of the ranges.
fn search_regions(
    registry: &Registry,
    strategy: (&str, &Value),
    problem: &Regions,
    whole: bool,
    seed: u64,
    evaluations: u64,
) -> (Vec<(usize, Vec<f64>)>, Duration) {
    JUDGE.set(problem.judge);
    let shares = |x: &[f64]| x.iter().map(|x| x / WHOLE).collect::<Vec<f64>>();
    let (range, judge): (Range, Judge) = match whole {
        true => (Range::Integer { min: 0, max: WHOLE as i64 }, |x| {
            let shares: Vec<f64> = x.iter().map(|x| x / WHOLE).collect();
            JUDGE.get()(&shares)
        }),
        false => (UNIT, problem.judge),
    };
    let (all, own) = search(registry, strategy, &space(4, range), seed, evaluations, judge);
    let critical = all.into_iter().enumerate().filter(|(_, point)| point.critical);
    (critical.map(|(number, point)| (number, if whole { shares(&point.x) } else { point.x })).collect(), own)
}

fn median(sorted: &[f64]) -> f64 {
    let middle = sorted.len() / 2;
    if sorted.len() % 2 == 1 { sorted[middle] } else { (sorted[middle - 1] + sorted[middle]) / 2.0 }
}
