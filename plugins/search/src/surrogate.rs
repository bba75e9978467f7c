//! Search with a surrogate: a model of all results so far says what is worth evaluating. For expensive evaluations.
//!
//! Candidates go in batches, which alternate between two aims. One is a good compromise of the objectives, by weights that are
//! drawn for each batch (J. Knowles, "ParEGO", 2006), where the model promises much or is unsure. The other, once something
//! critical is known, is what is likely to be critical and unlike all that is known. The model is a [`Forest`], as in
//! F. Hutter, H. Hoos, K. Leyton-Brown, "Sequential model-based optimization for general algorithm configuration" (2011).
//!
//! A batch depends on all results but those of the batch before it, so that workers have something to do meanwhile.

use std::collections::VecDeque;

use pdk_analysis::point::Point;
use pdk_sdk::ops::Random;
use pdk_sdk::prelude::*;

use crate::domain::{Domain, Seen};
use crate::forest::Forest;
use crate::nsga2::initial;
use crate::strategy::{Next, Rule};

/// Trees of a model.
const TREES: usize = 24;
/// Candidates of which the model chooses.
const POOL: usize = 400;
/// The most results that a model is made from: the best half of them, and others that are drawn.
const MOST_RESULTS: usize = 800;
/// How many of the best results candidates are looked for nearby.
const BEST: usize = 12;
/// Farther than this from all that is known, a candidate is no better for being farther.
const FAR: f64 = 0.15;

/// See the [module](self).
pub struct Surrogate {
    initial: usize,
    batch: usize,
    batches: u64,
    seen: Seen,
    rest: VecDeque<Vec<f64>>,
    /// What was proposed after the results that the model knows.
    pending: Vec<Vec<f64>>,
}

impl Rule for Surrogate {
    fn description() -> Description {
        Description::search(
            "surrogate",
            "Evaluates what a model of the results so far finds promising or new; for expensive evaluations",
        )
        .source("J. Knowles (2006), F. Hutter, H. Hoos, K. Leyton-Brown (2011), P. Geurts, D. Ernst, L. Wehenkel (2006)")
        .parameter(
            Parameter::integer(
                "initial",
                0,
                "candidates before there is a model, as a Latin hypercube; 0: 10 for each variable, at least 20",
            )
            .range(0.0, 100_000.0),
        )
        .parameter(
            Parameter::integer("batch", 8, "candidates that are proposed with one model; at least as many as there are workers")
                .range(1.0, 10_000.0),
        )
    }

    fn new(config: &Config) -> Result<Self> {
        let whole = |name: &str| usize::try_from(config.integer(name)).unwrap_or_default();
        Ok(Self {
            initial: whole("initial"),
            batch: whole("batch"),
            batches: 0,
            seen: Seen::default(),
            rest: VecDeque::new(),
            pending: Vec::new(),
        })
    }

    fn start(&mut self, _problem: &Problem, domain: &Domain) -> Result<()> {
        if self.initial == 0 {
            self.initial = (10 * domain.len()).max(20);
        }
        (self.batches, self.seen) = (0, Seen::default());
        self.rest.clear();
        self.pending.clear();
        Ok(())
    }

    fn next(&mut self, domain: &Domain, random: &mut Random, proposed: usize, told: &[Point]) -> Next {
        if self.rest.is_empty() {
            let batch = if proposed == 0 {
                initial(domain, self.initial, &mut self.seen, random)
            } else {
                let known = proposed - self.batch.min(self.initial / 2);
                if told.len() < known {
                    return Next::Wait;
                }
                self.batch(domain, random, &told[..known])
            };
            self.pending.extend_from_slice(&batch);
            let keep = self.batch.min(self.initial / 2) + batch.len();
            self.pending.drain(..self.pending.len().saturating_sub(keep));
            self.rest = batch.into();
        }
        self.rest.pop_front().map_or(Next::End, Next::Propose)
    }
}

impl Surrogate {
    fn batch(&mut self, domain: &Domain, random: &mut Random, told: &[Point]) -> Vec<Vec<f64>> {
        self.batches += 1;
        let values = compromise(told, random);
        let mut order: Vec<usize> = (0..told.len()).collect();
        order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
        let any_critical = told.iter().any(|point| point.critical);
        let after_critical = any_critical && self.batches.is_multiple_of(2);
        // The model is made from the best, and from others that chance picks.
        let mut rows = order.clone();
        if rows.len() > MOST_RESULTS {
            let (_, others) = rows.split_at_mut(MOST_RESULTS / 2);
            random.shuffle(others);
            rows.truncate(MOST_RESULTS);
        }
        let points: Vec<&[f64]> = rows.iter().map(|&row| told[row].x.as_slice()).collect();
        let targets: Vec<f64> = rows
            .iter()
            .map(|&row| if after_critical { f64::from(u8::from(told[row].critical)) } else { values[row] })
            .collect();
        let forest = Forest::new(&points, &targets, TREES, random);
        let near: Vec<usize> = match after_critical {
            true => (0..told.len()).filter(|&row| told[row].critical).collect(),
            false => order.into_iter().take(BEST).collect(),
        };
        let mut pool = self.pool(domain, random, told, &near);
        let mut known: Vec<&[f64]> = told.iter().filter(|p| p.critical).map(|p| p.x.as_slice()).collect();
        let pending = std::mem::take(&mut self.pending);
        known.extend(pending.iter().map(Vec::as_slice));
        // How far each of the pool is from what is known.
        let mut apart: Vec<f64> = pool
            .iter()
            .map(|x| {
                known.iter().map(|other| domain.space().distance(x, other)).fold(f64::INFINITY, f64::min)
            })
            .collect();
        drop(known);
        self.pending = pending;
        let predicted: Vec<(f64, f64)> = pool.iter().map(|x| forest.predict(x)).collect();
        let mut batch: Vec<Vec<f64>> = Vec::with_capacity(self.batch);
        let mut taken = vec![false; pool.len()];
        for number in 0..self.batch {
            // From trusting the model to preferring what it is unsure of.
            let boldness = 2.0 * number as f64 / self.batch as f64;
            let score = |place: usize| {
                let (mean, deviation) = predicted[place];
                let room = apart[place].min(FAR) / FAR;
                match after_critical {
                    true => (mean + boldness * deviation) * room,
                    false => -(mean - boldness * deviation) + 0.1 * room,
                }
            };
            let best = (0..pool.len()).filter(|&place| !taken[place]).max_by(|&a, &b| {
                // Of equal ones the first.
                score(a).total_cmp(&score(b)).then(b.cmp(&a))
            });
            let Some(best) = best else { break };
            taken[best] = true;
            let x = std::mem::take(&mut pool[best]);
            for (place, apart) in apart.iter_mut().enumerate() {
                if !taken[place] {
                    *apart = apart.min(domain.space().distance(&pool[place], &x));
                }
            }
            self.seen.add(&x);
            batch.push(x);
        }
        while batch.len() < self.batch {
            batch.push(crate::nsga2::draw_new(domain, domain.bounds(), &mut self.seen, random));
        }
        batch
    }

    /// New positions, half of them drawn from the whole space, half near these results.
    fn pool(&self, domain: &Domain, random: &mut Random, told: &[Point], near: &[usize]) -> Vec<Vec<f64>> {
        let mut pool: Vec<Vec<f64>> = Vec::with_capacity(POOL);
        let mut in_pool = Seen::default();
        for number in 0..2 * POOL {
            if pool.len() >= POOL {
                break;
            }
            let x = if number % 2 == 0 || near.is_empty() {
                domain.draw(domain.bounds(), random)
            } else {
                let start = &told[near[random.below(near.len() as u32) as usize]].x;
                nearby(domain, start, random)
            };
            let x = domain.settle(x);
            if !self.seen.has(&x) && in_pool.add(&x) {
                pool.push(x);
            }
        }
        pool
    }
}

/// A position near another one: some variables are moved, by a step whose size is drawn.
fn nearby(domain: &Domain, x: &[f64], random: &mut Random) -> Vec<f64> {
    let step = 0.3 * libm::pow(0.03, random.unit());
    let share = random.uniform(0.3, 1.0);
    let moved = |i: usize| {
        let (low, high) = domain.bounds()[i];
        let (which, by, anew) = (random.unit(), random.normal(), random.unit());
        match domain.is_choice(i) {
            _ if which >= share => x[i],
            true if by.abs() > 1.0 => domain.at_share(domain.bounds(), i, anew),
            true => x[i],
            // At least to the next whole number now and then.
            false if domain.is_discrete(i) => x[i] + by * (step * (high - low)).max(0.7),
            false => x[i] + by * step * (high - low),
        }
    };
    (0..domain.len()).map(moved).collect()
}

/// One number for each result, smaller is better: the objectives by weights that are drawn, in shares of their extent. What
/// violates a constraint is worse than what does not, and what has no objectives is worst.
fn compromise(told: &[Point], random: &mut Random) -> Vec<f64> {
    let count = told.iter().map(|point| point.f.len()).max().unwrap_or_default();
    let mut weights: Vec<f64> = (0..count).map(|_| -libm::log(1.0 - random.unit())).collect();
    let sum: f64 = weights.iter().sum();
    weights.iter_mut().for_each(|weight| *weight /= sum.max(f64::MIN_POSITIVE));
    let extent = |m: usize| {
        let values = told.iter().filter_map(|point| point.f.get(m));
        values.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| {
            (low.min(*value), high.max(*value))
        })
    };
    let extents: Vec<(f64, f64)> = (0..count).map(extent).collect();
    let value = |point: &Point| {
        if point.f.is_empty() {
            return if point.violation.is_finite() { 1.1 + point.violation } else { 2.1 };
        }
        let part = |m: usize| {
            let (low, high) = extents[m];
            if high > low { weights[m] * (point.f[m] - low) / (high - low) } else { 0.0 }
        };
        let parts: Vec<f64> = (0..point.f.len()).map(part).collect();
        let worst = parts.iter().copied().fold(0.0, f64::max);
        worst + 0.05 * parts.iter().sum::<f64>() + point.violation.min(1.0)
    };
    told.iter().map(value).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::RandomSearch;
    use crate::strategy::Strategy;
    use crate::testing::{make, problem, reals, search};

    #[test]
    fn few_evaluations_lead_to_the_optimum() {
        let bowl = |x: &[f64]| (vec![x.iter().map(|x| (x - 0.7) * (x - 0.7)).sum::<f64>()], false);
        let best = |all: Vec<(Vec<f64>, Vec<f64>, bool)>| {
            all.iter().map(|(_, f, _)| f[0]).fold(f64::INFINITY, f64::min)
        };
        let problem = problem(reals(4));
        for seed in 0..3 {
            let mut surrogate: Strategy<Surrogate> = make(&[]);
            let with = best(search(&mut surrogate, &problem, seed, 200, bowl));
            let mut random: Strategy<RandomSearch> = make(&[]);
            let without = best(search(&mut random, &problem, seed, 200, bowl));
            assert!(with < without / 3.0, "{with} {without}");
        }
    }
}
