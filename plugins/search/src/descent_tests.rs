//! [`Descent`] on problems whose cheapest failure is known.

use super::*;
use crate::strategy::Strategy;
use crate::testing::{integers, key, make, reals, search};

/// Danger has to exceed 0.5, and each variable adds less of it than the one before.
fn weighted(x: &[f64]) -> (Vec<f64>, bool) {
    let weights: Vec<f64> = (1..=x.len()).map(|i| 1.0 / i as f64).collect();
    let danger: f64 = x.iter().zip(&weights).map(|(x, weight)| x * weight).sum();
    let danger = danger / weights.iter().sum::<f64>();
    // What fails says no more than that.
    (vec![x.iter().sum(), -danger.min(0.55)], danger > 0.5)
}

fn two_objectives(space: Space) -> Problem {
    Problem { space, objectives: vec!["effort".into(), "danger".into()], evaluations: None }
}

fn least(found: &[(Vec<f64>, Vec<f64>, bool)]) -> f64 {
    let critical = found.iter().filter(|(_, _, critical)| *critical);
    critical.map(|(_, objectives, _)| objectives[0]).fold(f64::INFINITY, f64::min)
}

#[test]
fn the_cheapest_failure_is_found_in_few_evaluations() {
    // 1 + 0.45: all of the first variable, and so much of the second that it is enough.
    for seed in 1..=5 {
        let mut strategy: Strategy<Descent> = make(&[("towards", "danger".into())]);
        let found = search(&mut strategy, &two_objectives(reals(6)), seed, 200, weighted);
        assert!(least(&found) < 1.46, "seed {seed}: {}", least(&found));
    }
}

#[test]
fn a_failure_is_found_where_draws_do_not_find_it() {
    let corner = |x: &[f64]| {
        let far: f64 = x.iter().map(|x| (x - 0.97) * (x - 0.97)).sum();
        (vec![far], far < 1e-2)
    };
    let problem = crate::testing::problem(reals(8));
    let mut strategy: Strategy<Descent> = make(&[]);
    let found = search(&mut strategy, &problem, 3, 150, corner);
    assert!(found.iter().any(|(_, _, critical)| *critical));
}

#[test]
fn whole_numbers_and_constraints_are_kept_to() {
    let mut space = integers(4, 20);
    space.constraints =
        vec![pdk_sdk::search::Constraint { weights: [("x0".to_owned(), 1.0)].into(), at_most: 12.0 }];
    let problem = two_objectives(space);
    let mut strategy: Strategy<Descent> = make(&[("towards", "danger".into())]);
    let evaluate = |x: &[f64]| {
        assert!(x[0] <= 12.0 && x.iter().all(|x| x.fract() == 0.0), "{x:?}");
        let shares: Vec<f64> = x.iter().map(|x| x / 20.0).collect();
        weighted(&shares)
    };
    let found = search(&mut strategy, &problem, 2, 150, evaluate);
    // With 12 of 20 of the first, the second is used up, and a bit of the third as well.
    let every = (0..=12).flat_map(|a| {
        (0..=20).flat_map(move |b| (0..=20).flat_map(move |c| (0..=20).map(move |d| [a, b, c, d])))
    });
    let best = every.map(|x| weighted(&x.map(|x| f64::from(x) / 20.0)));
    let best = best.filter(|(_, critical)| *critical).map(|(f, _)| f[0]).fold(f64::INFINITY, f64::min);
    assert!(least(&found) <= best + 0.05 + 1e-9, "{} {best}", least(&found));
}

#[test]
fn a_search_ends_when_the_space_is_exhausted() {
    let problem = two_objectives(integers(2, 1));
    let mut strategy: Strategy<Descent> = make(&[("towards", "danger".into())]);
    strategy.start(&problem, &key(1)).unwrap();
    let mut count = 0;
    loop {
        let candidates = strategy.ask(16).unwrap();
        if candidates.is_empty() {
            break;
        }
        count += candidates.len();
        let results: Vec<Evaluated> = candidates
            .iter()
            .map(|candidate| {
                let (objectives, critical) = weighted(&problem.space.positions(&candidate.values).unwrap());
                Evaluated { id: candidate.id, objectives, violations: Vec::new(), critical, failure: None }
            })
            .collect();
        strategy.tell(&results).unwrap();
    }
    assert!(count <= 4, "{count}");
}

#[test]
fn values_of_two_and_values_without_an_order_are_switched() {
    let mut space = integers(6, 1);
    for (name, values) in [("a", 4), ("b", 4)] {
        let values = (0..values).map(Into::into).collect();
        space.variables.push(Variable { name: name.to_owned(), range: Range::Choice { values } });
    }
    space.variables.push(Variable { name: "level".to_owned(), range: Range::Real { min: 0.0, max: 1.0 } });
    // The choices come in no order: the third value of `a` and the second of `b` help most.
    let evaluate = |x: &[f64]| {
        let choices = [0.2, 0.1, 0.5, 0.0][x[6] as usize] + [0.1, 0.4, 0.0, 0.2][x[7] as usize];
        let danger = choices + 0.1 * x[..3].iter().sum::<f64>() + x[8];
        (vec![x[..6].iter().sum::<f64>() + 3.0 * x[8], -danger.min(1.1)], danger > 1.0)
    };
    for seed in 1..=5 {
        let mut strategy: Strategy<Descent> = make(&[("towards", "danger".into())]);
        let found = search(&mut strategy, &two_objectives(space.clone()), seed, 200, evaluate);
        // 0.9 by the choices, and the rest by the level.
        assert!(least(&found) < 0.36, "seed {seed}: {}", least(&found));
    }
}

#[test]
fn the_objective_that_leads_to_failures_is_one_of_the_problem() {
    let error = |towards: &str, objectives: &[&str]| {
        let mut strategy: Strategy<Descent> = make(&[("towards", towards.into())]);
        let objectives = objectives.iter().map(|name| (*name).to_owned()).collect();
        let problem = Problem { space: reals(2), objectives, evaluations: None };
        strategy.start(&problem, &key(1)).err().map(|error| error.to_string()).unwrap_or_default()
    };
    let unknown = error("speed", &["effort", "danger"]);
    assert!(unknown.contains("`speed`") && unknown.contains("one of effort, danger"), "{unknown}");
    for open in [&["danger", "effort"][..], &["criticality", "max_cross_track_error"]] {
        assert!(error("", open).contains("cannot tell which"), "{open:?}");
    }
    for clear in [&["danger"][..], &["effort", "max_cross_track_error"]] {
        assert_eq!(error("", clear), "");
    }
}
