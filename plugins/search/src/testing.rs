//! What tests of strategies share.

use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::{Map, Value};

use crate::strategy::{Rule, Strategy};

/// A key that tests tell apart by a number.
pub fn key(number: u8) -> Key {
    Key([number; 32])
}

/// This many reals from 0 to 1, `x0`, `x1` ...
pub fn reals(n: usize) -> Space {
    space(n, || Range::Real { min: 0.0, max: 1.0 })
}

/// This many whole numbers from 0, `x0`, `x1` ...
pub fn integers(n: usize, max: i64) -> Space {
    space(n, || Range::Integer { min: 0, max })
}

fn space(n: usize, range: impl Fn() -> Range) -> Space {
    let variables = (0..n).map(|i| Variable { name: format!("x{i}"), range: range() }).collect();
    Space { variables, constraints: Vec::new() }
}

/// A problem with one objective.
pub fn problem(space: Space) -> Problem {
    Problem { space, objectives: vec!["f".into()], evaluations: None }
}

/// A strategy with parameters.
pub fn make<R: Rule>(parameters: &[(&str, Value)]) -> Strategy<R> {
    let given: Map<String, Value> =
        parameters.iter().map(|(name, value)| ((*name).to_owned(), value.clone())).collect();
    Strategy::new(&Config::check(&R::description(), &given).unwrap()).unwrap()
}

/// Searches until this many candidates were evaluated, and returns positions and results.
pub fn search<R: Rule>(
    strategy: &mut Strategy<R>,
    problem: &Problem,
    seed: u8,
    evaluations: usize,
    evaluate: impl Fn(&[f64]) -> (Vec<f64>, bool),
) -> Vec<(Vec<f64>, Vec<f64>, bool)> {
    strategy.start(problem, &key(seed)).unwrap();
    let mut all = Vec::new();
    while all.len() < evaluations {
        let candidates = strategy.ask((evaluations - all.len()).min(16)).unwrap();
        assert!(!candidates.is_empty(), "the search is over after {} candidates", all.len());
        let mut results = Vec::new();
        for candidate in candidates {
            let x = problem.space.positions(&candidate.values).unwrap();
            let (objectives, critical) = evaluate(&x);
            all.push((x, objectives.clone(), critical));
            results.push(Evaluated {
                id: candidate.id,
                objectives,
                violations: Vec::new(),
                critical,
                failure: None,
            });
        }
        strategy.tell(&results).unwrap();
    }
    all
}

/// Runs the test kit on a rule with its defaults.
pub fn check<R: Rule + 'static>(parameters: &[(&str, Value)]) {
    let given: Map<String, Value> =
        parameters.iter().map(|(name, value)| ((*name).to_owned(), value.clone())).collect();
    let config = Config::check(&R::description(), &given).unwrap();
    let mut make = |config: &Config| Ok(Box::new(Strategy::<R>::new(config)?) as Box<dyn Search>);
    pdk_sdk::search::check(&R::description(), &config, &mut make).unwrap();
}

#[test]
fn every_strategy_passes_the_test_kit() {
    check::<crate::random::RandomSearch>(&[]);
    check::<crate::grid::Grid>(&[]);
    check::<crate::sobol::Sobol>(&[]);
    check::<crate::latin_hypercube::LatinHypercube>(&[]);
    check::<crate::nsga2::Nsga2>(&[("population", 20.into())]);
    check::<crate::nsga2_dt::Nsga2Dt>(&[("population", 20.into())]);
    check::<crate::nsga2_dt::Nsga2Dt>(&[("population", 20.into()), ("variant", "published".into())]);
    check::<crate::surrogate::Surrogate>(&[]);
    check::<crate::map_elites::MapElites>(&[]);
    check::<crate::descent::Descent>(&[]);
}
