//! NSGA-II on problems of the literature, beside that of pymoo.

use std::time::Duration;

use pdk_components::registry::Registry;
use pdk_model::search::{Range, Space};
use pdk_statistics::hypervolume::hypervolume;
use pdk_statistics::independent::compare;
use pdk_statistics::point::Point;
use pdk_statistics::ranking::survivors;
use serde_json::{Value, json};

use crate::{UNIT, median, of_each, search, space};

/// The hypervolumes that `pymoo_reference.py` wrote: pymoo 0.6.2, population 75, 200 generations.
const PYMOO: &str = include_str!("pymoo.json");
/// A hypervolume below this share of pymoo's median: a part of the front was not found.
const LOCAL: f64 = 0.96;

/// A problem of the literature: its name, space, objectives, and the reference of its hypervolume.
type Front = (&'static str, Space, fn(&[f64]) -> Vec<f64>, Vec<f64>);

/// Runs NSGA-II, and compares the hypervolumes of its last populations with those of pymoo.
pub fn fronts(registry: &Registry, seeds: u64, only: &[&str]) {
    const POPULATION: usize = 75;
    const GENERATIONS: usize = 200;
    let peers: Value = serde_json::from_str(PYMOO).unwrap();
    let problems: [Front; 5] = [
        ("zdt1", space(30, UNIT), |x| zdt(x, |f, g| 1.0 - (f / g).sqrt()), vec![1.1; 2]),
        ("zdt2", space(30, UNIT), |x| zdt(x, |f, g| 1.0 - (f / g) * (f / g)), vec![1.1; 2]),
        (
            "zdt3",
            space(30, UNIT),
            |x| zdt(x, |f, g| 1.0 - (f / g).sqrt() - f / g * libm::sin(10.0 * std::f64::consts::PI * f)),
            vec![1.1; 2],
        ),
        ("dtlz2", space(12, UNIT), dtlz2, vec![1.1; 3]),
        ("integer", space(8, Range::Integer { min: 0, max: 100 }), between, vec![6.0; 2]),
    ];
    println!("NSGA-II: population {POPULATION}, {GENERATIONS} generations, {seeds} seeds");
    println!(
        "{:<8} {:>9} {:>9} {:>9} {:>6} {:>14} {:>14} {:>6} {:>7} {:>8}",
        "problem", "lowest", "median", "highest", "local", "pymoo: median", "pymoo: local", "A", "p", "ms"
    );
    for (name, space, values, reference) in
        problems.into_iter().filter(|(name, ..)| only.is_empty() || only.contains(name))
    {
        let parameters = json!({"population": POPULATION});
        let all: Vec<(f64, Duration)> = of_each(seeds, |seed| {
            let evaluations = (POPULATION * GENERATIONS) as u64;
            let judge = |x: &[f64]| (values(x), false);
            let strategy = ("nsga2", &parameters);
            let (all, own) = search(registry, strategy, &space, seed, evaluations, &judge, reference.len());
            // What survives of each generation, as in the strategy.
            let mut population: Vec<Point> = Vec::new();
            for generation in all.chunks(POPULATION) {
                let both: Vec<&Point> = population.iter().chain(generation).collect();
                population = survivors(&both, POPULATION).into_iter().map(|ranked| ranked.point).collect();
            }
            let front: Vec<Vec<f64>> = population.into_iter().map(|point| point.f).collect();
            (hypervolume(&front, &reference), own)
        });
        let milliseconds = all.iter().map(|(_, own)| own.as_secs_f64() * 1000.0).sum::<f64>();
        let mut volumes: Vec<f64> = all.into_iter().map(|(volume, _)| volume).collect();
        volumes.sort_by(f64::total_cmp);
        let mut peer: Vec<f64> = serde_json::from_value(peers[name].clone()).unwrap();
        peer.sort_by(f64::total_cmp);
        // A part of the front is missing.
        let best = median(&peer);
        let local = |volumes: &[f64]| volumes.iter().filter(|&&volume| volume < LOCAL * best).count();
        let compared = compare(&volumes, &peer).unwrap();
        println!(
            "{name:<8} {:>9.5} {:>9.5} {:>9.5} {:>6} {best:>14.5} {:>14} {:>6.2} {:>7.3} {:>8.3}",
            volumes[0],
            median(&volumes),
            volumes[volumes.len() - 1],
            local(&volumes),
            format!("{} of {}", local(&peer), peer.len()),
            compared.effect_size,
            compared.p,
            milliseconds / (seeds as f64 * GENERATIONS as f64)
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
    vec![
        (1.0 + g) * libm::cos(a) * libm::cos(b),
        (1.0 + g) * libm::cos(a) * libm::sin(b),
        (1.0 + g) * libm::sin(a),
    ]
}

/// The squared distances from two points of whole numbers, neither of which is at a bound.
fn between(x: &[f64]) -> Vec<f64> {
    let squares = |aim: fn(usize) -> f64| {
        x.iter().enumerate().map(|(i, x)| (x - aim(i)) / 100.0 * ((x - aim(i)) / 100.0)).sum::<f64>()
    };
    vec![squares(|i| 20.0 + 3.0 * i as f64), squares(|i| 85.0 - 5.0 * i as f64)]
}
