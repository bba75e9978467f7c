//! Search with a surrogate: a model of all results so far says what is worth evaluating. For expensive evaluations.
//!
//! Candidates go in batches. Some seek: by each objective in turn, and by a compromise of all whose weights are drawn (J. Knowles,
//! "ParEGO", 2006), the model says what promises much or is unsure. So that not all climb one peak, a few of them look anywhere, and
//! the others away from what is known to be critical, and around each of several places that are better than what lies next to them
//! ([`promising`]). Once something critical is known, every second batch looks for what is likely to be critical too and unlike all
//! that is known. The model is a [`Forest`], as in F. Hutter, H. Hoos, K. Leyton-Brown, "Sequential model-based optimization for
//! general algorithm configuration" (2011).
//!
//! A share of every batch explores: it lies far from all others. The share grows if what was sought turns out no better than what
//! explored, since then nothing in the results leads anywhere.
//!
//! A batch depends on all results but those of the batch before it, so that workers have something to do meanwhile.

use std::collections::VecDeque;

use pdk_sdk::prelude::*;
use pdk_sdk::seed::Random;
use pdk_statistics::point::Point;

use crate::domain::{Domain, Seen};
use crate::forest::Forest;
use crate::niches::promising;
use crate::nsga2::{draw_new, initial};
use crate::pool::{Candidate, Pool};
use crate::strategy::{Next, Rule};

/// Trees of a model.
const TREES: usize = 24;
/// Candidates of which the model chooses.
const POOL: usize = 400;
/// The most results that a model is made from: the best half of them, and others that are drawn.
const MOST_RESULTS: usize = 800;
/// How many of the best results candidates are looked for nearby.
const BEST: usize = 12;
/// What room is worth to a candidate that is sought, beside what the model promises.
const ROOM: f64 = 0.03;
/// Critical candidates are of different kinds if they are farther apart than this: see [`Space::distance`].
const KIND: f64 = 0.1;
/// What is nearer than this to a critical candidate belongs to a region that is known.
const CLEAR: f64 = 0.1;
/// Around a place this many candidates are enough.
const ENOUGH: usize = 60;
/// Of how many draws the most isolated is taken.
const DRAWS: usize = 4;
/// So many of the last candidates tell whether anything leads somewhere.
const COMPARED: usize = 100;
/// How likely what was sought is better than what was drawn where something leads somewhere.
const LEADS: f64 = 0.75;
/// The share of candidates that are drawn if nothing does.
const MOST_EXPLORATION: f64 = 0.85;

/// See the [module](self).
pub struct Surrogate {
    initial: usize,
    batch: usize,
    explore: f64,
    batches: u64,
    /// What exploration still has coming, in candidates.
    owed: f64,
    /// Whose turn it is among the places.
    turn: usize,
    /// How many batches sought.
    seeks: usize,
    /// What each candidate was proposed for.
    aims: Vec<Aim>,
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
        .version(2)
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
        .parameter(
            Parameter::number(
                "explore",
                0.4,
                "the share of candidates that are drawn far from all others; more if nothing in the results leads anywhere",
            )
            .range(0.0, 1.0),
        )
    }

    fn new(config: &Config) -> Result<Self> {
        let whole = |name: &str| usize::try_from(config.integer(name)).unwrap_or_default();
        Ok(Self {
            initial: whole("initial"),
            batch: whole("batch"),
            explore: config.number("explore"),
            batches: 0,
            owed: 0.0,
            turn: 0,
            seeks: 0,
            aims: Vec::new(),
            seen: Seen::default(),
            rest: VecDeque::new(),
            pending: Vec::new(),
        })
    }

    fn start(&mut self, _problem: &Problem, domain: &Domain) -> Result<()> {
        if self.initial == 0 {
            self.initial = (10 * domain.len()).max(20);
        }
        (self.batches, self.seeks, self.owed, self.turn, self.seen) = (0, 0, 0.0, 0, Seen::default());
        self.aims.clear();
        self.rest.clear();
        self.pending.clear();
        Ok(())
    }

    fn next(&mut self, domain: &Domain, random: &mut Random, proposed: usize, told: &[Point]) -> Next {
        if self.rest.is_empty() {
            let batch = if proposed == 0 {
                self.aims = vec![Aim::Explore; self.initial];
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
        let values = compromise(told, self.weights(told, random).as_slice());
        let any_critical = told.iter().any(|point| point.critical);
        let aim = if any_critical && self.batches.is_multiple_of(2) { Aim::Extend } else { Aim::Seek };
        self.seeks += usize::from(aim == Aim::Seek);
        let explore = match aim {
            Aim::Seek => self.exploration(&values),
            _ => self.explore,
        };
        // Whole candidates, and over many batches the share.
        self.owed += explore * self.batch as f64;
        let drawn = (libm::floor(self.owed) as usize).min(self.batch);
        self.owed -= drawn as f64;
        let mut batch = match aim {
            _ if drawn == self.batch => Vec::new(),
            Aim::Extend => self.extended(domain, random, told, &values, self.batch - drawn),
            _ => self.sought(domain, random, told, &values, self.batch - drawn),
        };
        self.aims.extend(batch.iter().map(|_| aim));
        while batch.len() < self.batch {
            batch.push(self.isolated(domain, random, told, &batch));
            self.aims.push(Aim::Explore);
        }
        batch
    }

    /// The weights of the objectives for this batch: each objective alone in turn, because what is critical may show in one of them
    /// alone, and then a compromise that is drawn.
    fn weights(&self, told: &[Point], random: &mut Random) -> Vec<f64> {
        let count = told.iter().map(|point| point.f.len()).max().unwrap_or_default();
        let turn = self.seeks % (count + 1);
        if count > 1 && turn < count {
            return (0..count).map(|m| f64::from(u8::from(m == turn))).collect();
        }
        let mut weights: Vec<f64> = (0..count).map(|_| -libm::log(1.0 - random.unit())).collect();
        let sum: f64 = weights.iter().sum();
        weights.iter_mut().for_each(|weight| *weight /= sum.max(f64::MIN_POSITIVE));
        weights
    }

    /// The share of candidates that are drawn. It grows where what was sought is no better than what was drawn, because nothing
    /// in the results leads anywhere.
    fn exploration(&self, values: &[f64]) -> f64 {
        let last = |aim: Aim| {
            let numbers = (0..values.len()).rev().filter(move |&number| self.aims[number] == aim);
            numbers.take(COMPARED).map(|number| values[number]).collect::<Vec<f64>>()
        };
        let (sought, drawn) = (last(Aim::Seek), last(Aim::Explore));
        if sought.len() < COMPARED / 4 {
            return self.explore;
        }
        let mut wins = 0.0;
        for a in &sought {
            for b in &drawn {
                wins += if a < b {
                    1.0
                } else if a == b {
                    0.5
                } else {
                    0.0
                };
            }
        }
        let better = wins / (sought.len() * drawn.len()) as f64;
        let doubt = ((LEADS - better) / (LEADS - 0.5)).clamp(0.0, 1.0);
        self.explore + (MOST_EXPLORATION - self.explore).max(0.0) * doubt
    }

    /// Candidates that are likely to be critical, and unlike all that are known to be.
    fn extended(
        &mut self,
        domain: &Domain,
        random: &mut Random,
        told: &[Point],
        values: &[f64],
        n: usize,
    ) -> Vec<Vec<f64>> {
        let targets: Vec<f64> = told.iter().map(|point| f64::from(u8::from(point.critical))).collect();
        // What is critical comes before all others.
        let order: Vec<f64> =
            values.iter().zip(&targets).map(|(value, target)| value - 10.0 * target).collect();
        let forest = model(told, &order, &targets, random);
        // One of each kind, so that a region counts by its extent and not by how often it was hit.
        let mut kinds: Vec<usize> = Vec::new();
        for number in (0..told.len()).filter(|&number| told[number].critical) {
            if kinds.iter().all(|&kind| domain.space().distance(&told[kind].x, &told[number].x) > KIND) {
                kinds.push(number);
            }
        }
        let near: Vec<&[f64]> = kinds.iter().map(|&number| told[number].x.as_slice()).collect();
        let mut pool = Pool::default();
        pool.fill(domain, random, &self.seen, 0, &[], POOL / 2);
        pool.fill(domain, random, &self.seen, 0, &near, POOL / 2);
        pool.predict(&forest);
        let known = told.iter().filter(|point| point.critical).map(|point| point.x.as_slice());
        pool.keep_away(domain, known.chain(self.pending.iter().map(Vec::as_slice)));
        (0..n)
            .filter_map(|number| {
                let boldness = 2.0 * number as f64 / n as f64;
                pool.take(domain, |one| (one.mean + boldness * one.deviation) * one.room())
            })
            .inspect(|x| {
                self.seen.add(x);
            })
            .collect()
    }

    /// Candidates that the model expects to be good: the first of all, the others in turn away from what is known to be critical,
    /// and around each of several places that are better than what is around them.
    fn sought(
        &mut self,
        domain: &Domain,
        random: &mut Random,
        told: &[Point],
        values: &[f64],
        n: usize,
    ) -> Vec<Vec<f64>> {
        let forest = model(told, values, values, random);
        let mut order: Vec<usize> = (0..told.len()).collect();
        order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
        let best: Vec<&[f64]> = order.iter().take(BEST).map(|&number| told[number].x.as_slice()).collect();
        let places = promising(domain, told, &[values.to_vec()], ENOUGH);
        let groups = places.len() + 1;
        let mut pool = Pool::default();
        pool.fill(domain, random, &self.seen, 0, &[], POOL / 2);
        pool.fill(domain, random, &self.seen, 0, &best, POOL / 2);
        for (number, &place) in places.iter().enumerate() {
            pool.fill(domain, random, &self.seen, number + 1, &[told[place].x.as_slice()], POOL / groups);
        }
        pool.predict(&forest);
        let critical: Vec<&[f64]> =
            told.iter().filter(|point| point.critical).map(|point| point.x.as_slice()).collect();
        pool.keep_away(domain, critical.iter().copied().chain(self.pending.iter().map(Vec::as_slice)));
        for one in &mut pool.candidates {
            one.known = critical.iter().any(|x| domain.space().distance(x, &one.x) < CLEAR);
        }
        let turn = self.turn;
        self.turn += n;
        (0..n)
            .filter_map(|number| {
                let boldness = number as f64 / n as f64;
                let score = |one: &Candidate| boldness * one.deviation - one.mean + ROOM * one.room();
                // As long as nothing is critical, half of them go on from the best.
                let number = turn + number;
                let (first, group) = match critical.is_empty() {
                    true => (number.is_multiple_of(2), number / 2 % groups),
                    false => (number % (groups + 1) == groups, number % (groups + 1)),
                };
                if first {
                    return pool.take(domain, score);
                }
                let away = |one: &Candidate| {
                    if one.group == group && !one.known { score(one) } else { f64::NEG_INFINITY }
                };
                pool.take(domain, away)
            })
            .inspect(|x| {
                self.seen.add(x);
            })
            .collect()
    }

    /// A new position far from all others: of several draws the most isolated.
    fn isolated(
        &mut self,
        domain: &Domain,
        random: &mut Random,
        told: &[Point],
        batch: &[Vec<f64>],
    ) -> Vec<f64> {
        let space = domain.space();
        let mut best: Option<(f64, Vec<f64>)> = None;
        for _ in 0..DRAWS {
            let x = domain.settle(domain.draw(domain.bounds(), random));
            if self.seen.has(&x) {
                continue;
            }
            let others = told.iter().map(|point| &point.x).chain(&self.pending).chain(batch);
            let isolation = others.map(|other| space.distance(&x, other)).fold(f64::INFINITY, f64::min);
            if best.as_ref().is_none_or(|(most, _)| isolation > *most) {
                best = Some((isolation, x));
            }
        }
        let Some((_, x)) = best else {
            return draw_new(domain, domain.bounds(), &mut self.seen, random);
        };
        self.seen.add(&x);
        x
    }
}

/// A model of the results: made from the best, and from others that chance picks.
fn model(told: &[Point], values: &[f64], targets: &[f64], random: &mut Random) -> Forest {
    let mut rows: Vec<usize> = (0..told.len()).collect();
    rows.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    if rows.len() > MOST_RESULTS {
        let (_, others) = rows.split_at_mut(MOST_RESULTS / 2);
        random.shuffle(others);
        rows.truncate(MOST_RESULTS);
    }
    let points: Vec<&[f64]> = rows.iter().map(|&row| told[row].x.as_slice()).collect();
    let targets: Vec<f64> = rows.iter().map(|&row| targets[row]).collect();
    Forest::new(&points, &targets, TREES, random)
}

/// What a candidate is proposed for.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Aim {
    /// To see what nothing tells.
    Explore,
    /// To find what is critical, or better than all.
    Seek,
    /// To see how far a critical region extends.
    Extend,
}

/// One number for each result, smaller is better: the objectives by their weights, in shares of their extent. What
/// violates a constraint is worse than what does not, and what has no objectives is worst.
fn compromise(told: &[Point], weights: &[f64]) -> Vec<f64> {
    let count = weights.len();
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

    /// Three balls of .8 % in a cube; what happens in the first is far more severe.
    fn peaks(x: &[f64]) -> (Vec<f64>, bool) {
        let middles = [[0.2, 0.3, 0.75], [0.75, 0.8, 0.3], [0.8, 0.2, 0.8]];
        let squares = |middle: &[f64; 3]| middle.iter().zip(x).map(|(m, x)| (x - m) * (x - m)).sum::<f64>();
        let height = |(middle, height): (&[f64; 3], f64)| {
            height * libm::exp(-libm::log(2.0 * height) * squares(middle) / (0.124 * 0.124))
        };
        let highest = middles.iter().zip([1.0, 0.7, 0.55]).map(height).fold(0.0, f64::max);
        (vec![-highest], highest >= 0.5)
    }

    fn of_each_peak(all: &[(Vec<f64>, Vec<f64>, bool)]) -> [usize; 3] {
        let critical = || all.iter().filter(|(_, _, critical)| *critical);
        let count = |within: fn(&[f64]) -> bool| critical().filter(|(x, ..)| within(x)).count();
        [count(|x| x[0] < 0.5), count(|x| x[0] > 0.5 && x[1] > 0.5), count(|x| x[0] > 0.5 && x[1] < 0.5)]
    }

    #[test]
    fn all_peaks_are_found_and_more_failures_than_by_chance() {
        let problem = problem(reals(3));
        for seed in 0..6 {
            let mut surrogate: Strategy<Surrogate> = make(&[]);
            let with = of_each_peak(&search(&mut surrogate, &problem, seed, 500, peaks));
            let mut random: Strategy<RandomSearch> = make(&[]);
            let without = of_each_peak(&search(&mut random, &problem, seed, 500, peaks));
            assert!(with.iter().all(|&count| count >= 3), "seed {seed}: {with:?}");
            assert!(with.iter().sum::<usize>() > 3 * without.iter().sum::<usize>(), "{with:?} {without:?}");
        }
    }

    #[test]
    fn where_nothing_leads_anywhere_it_looks_everywhere() {
        fn bits(x: &[f64]) -> u64 {
            x.iter().fold(7, |bits, x| (bits ^ x.to_bits()).wrapping_mul(0x9e37_79b9_7f4a_7c15))
        }
        let noise = |x: &[f64]| (vec![(bits(x) >> 40) as f64], false);
        let bowl = |x: &[f64]| (vec![x.iter().map(|x| (x - 0.7) * (x - 0.7)).sum::<f64>()], false);
        let cells = |all: Vec<(Vec<f64>, Vec<f64>, bool)>| {
            let cell = |x: Vec<f64>| x.iter().fold(0, |cell, x| cell * 6 + (x * 6.0) as usize);
            all.into_iter().map(|(x, ..)| cell(x)).collect::<std::collections::BTreeSet<_>>().len()
        };
        let problem = problem(reals(3));
        for seed in 0..3 {
            let searched = |evaluate: fn(&[f64]) -> (Vec<f64>, bool)| {
                let mut surrogate: Strategy<Surrogate> = make(&[]);
                cells(search(&mut surrogate, &problem, seed, 500, evaluate))
            };
            let mut random: Strategy<RandomSearch> = make(&[]);
            let random = cells(search(&mut random, &problem, seed, 500, noise));
            let (everywhere, led) = (searched(noise), searched(bowl));
            assert!(everywhere as f64 > 0.95 * random as f64, "seed {seed}: {everywhere} {random}");
            assert!(led < everywhere, "seed {seed}: {led} {everywhere}");
        }
    }
}
