//! Descent: gradients lead to a failure, and along the border of the failures to one that costs least.
//!
//! One objective leads to failures; the sum of the others is what a failure costs, such as the levels that it takes. From the best of a few candidates that are
//! drawn, the first objective is followed downwards until a candidate is critical. From there on the search stays at the border between what is
//! critical and what is not. At a place just outside, a candidate beside it in each variable gives both gradients. With these, the cheapest step that stays
//! critical is a linear programme with bounds and one constraint, which is a fractional knapsack. It is solved for some reaches and margins, since
//! nothing is quite linear, and the cheapest critical candidate among these is next (sequential linear programming: R. E. Griffith, R. A. Stewart, 1961; in
//! the analysis of reliability, the place that it leads to is the design point: A. M. Hasofer, N. C. Lind, 1974). Once that leads nowhere, all begins anew
//! elsewhere.
//!
//! Variables without an order keep the value that was drawn for them until then.

use std::collections::{HashMap, VecDeque};

use pdk_sdk::prelude::*;
use pdk_sdk::seed::Random;
use pdk_statistics::point::Point;

use crate::domain::Domain;
use crate::strategy::{Next, Rule};

/// Objectives that lead to failures, the most telling first, if `towards` names none.
const MEASURES: [&str; 4] =
    ["max_cross_track_error", "criticality", "mean_cross_track_error", "time_to_failure"];
/// Candidates that are drawn, of which the best is where a descent begins.
const DRAWN: usize = 8;
/// The first steps towards a failure, as shares of each range.
const SEEKING: [f64; 4] = [0.1, 0.2, 0.4, 0.8];
/// By how much they become shorter if none leads nearer, and how short they become.
const SHORTER: f64 = 6.0;
const SHORTEST: f64 = 0.02;
/// How far inside the border a step along it is to lead, as parts of the largest change of the objective that its reach allows.
const MARGINS: [f64; 4] = [-0.15, 0.0, 0.15, 0.4];
/// How far back from a critical candidate the border is looked for, in the same parts.
const BACK: [f64; 2] = [-0.3, -0.8];
/// How much cheaper a step has to be, as a share of the cost.
const GAIN: f64 = 0.01;
/// After this many steps in a row that gain less, a descent is over.
const PATIENCE: usize = 2;
/// The most steps of a descent.
const STEPS: usize = 100;
/// After this many descents in a row that led to nothing new, the space is exhausted.
const EXHAUSTED: usize = 1000;

/// See the [module](self).
pub struct Descent {
    towards: String,
    step: f64,
    reach: f64,
    /// The place of the objective that leads to failures.
    main: usize,
    /// Which results belong to which positions.
    known: HashMap<Vec<u64>, usize>,
    /// How many of the results that covers.
    read: usize,
    /// Where this descent began, as shares of the ranges.
    starts: Vec<Vec<f64>>,
    /// How many descents led to nothing new.
    fruitless: usize,
    rest: VecDeque<Vec<f64>>,
}

impl Rule for Descent {
    fn description() -> Description {
        Description::search(
            "descent",
            "Follows gradients, by candidates beside each other, to a failure and along the border of failures to the cheapest",
        )
        .source("R. E. Griffith, R. A. Stewart (1961), A. M. Hasofer, N. C. Lind (1974)")
        .parameter(Parameter::text(
            "towards",
            "the objective that leads to failures; the sum of the others is what a failure costs; empty: a measure of the drive, if one is among them, or \
             else the first",
        ))
        .parameter(
            Parameter::number("step", 0.05, "how far apart the candidates of a gradient are, as a share of a range")
                .range(0.001, 0.5),
        )
        .parameter(Parameter::number("reach", 0.3, "the largest first step along the border, as a share of each range").range(0.001, 1.0))
    }

    fn new(config: &Config) -> Result<Self> {
        Ok(Self {
            towards: config.text("towards").to_owned(),
            step: config.number("step"),
            reach: config.number("reach"),
            main: 0,
            known: HashMap::new(),
            read: 0,
            starts: Vec::new(),
            fruitless: 0,
            rest: VecDeque::new(),
        })
    }

    fn start(&mut self, problem: &Problem, _domain: &Domain) -> Result<()> {
        let names = &problem.objectives;
        let place = |name: &str| names.iter().position(|other| other == name);
        self.main = match self.towards.as_str() {
            "" => MEASURES.iter().find_map(|name| place(name)).unwrap_or_default(),
            name => place(name).ok_or_else(|| {
                Error::new(format!(
                    "`towards` is `{name}`, which is not an objective; name one of {}",
                    names.join(", ")
                ))
            })?,
        };
        self.known.clear();
        self.read = 0;
        self.starts.clear();
        self.rest.clear();
        self.fruitless = 0;
        Ok(())
    }

    fn next(&mut self, domain: &Domain, random: &mut Random, proposed: usize, told: &[Point]) -> Next {
        while self.rest.is_empty() {
            if told.len() < proposed {
                return Next::Wait;
            }
            for (number, point) in told.iter().enumerate().skip(self.read) {
                self.known.insert(bits(&point.x), number);
            }
            self.read = told.len();
            if self.starts.is_empty() {
                let spread = domain.latin_hypercube(domain.bounds(), DRAWN, random);
                let drawn = spread.into_iter().map(|x| match domain.keeps_constraints(&x) {
                    true => x,
                    false => domain.draw(domain.bounds(), random),
                });
                self.starts = drawn.map(|x| domain.shares(&x)).collect();
            }
            match Run::new(self, domain, told).descend() {
                Err(Unknown(candidates)) => {
                    self.fruitless = 0;
                    self.rest = candidates.into();
                }
                Ok(()) if self.fruitless == EXHAUSTED => return Next::End,
                Ok(()) => {
                    self.fruitless += 1;
                    self.starts.clear();
                }
            }
        }
        self.rest.pop_front().map_or(Next::End, Next::Propose)
    }
}

/// Positions by which results are found again.
fn bits(x: &[f64]) -> Vec<u64> {
    x.iter().map(|position| position.to_bits()).collect()
}

/// Positions whose results have to be known before a descent goes on.
struct Unknown(Vec<Vec<f64>>);

/// An evaluated candidate.
#[derive(Debug, Clone)]
struct Place {
    /// Its positions, as shares of the ranges.
    x: Vec<f64>,
    /// The objective that leads to failures.
    f: f64,
    /// The sum of the others.
    cost: f64,
    critical: bool,
}

/// How objective and cost change with each variable, for all of its range.
struct Gradients {
    f: Vec<f64>,
    cost: Vec<f64>,
}

impl Gradients {
    /// The largest change of the objective within a reach of 1.
    fn largest(&self) -> f64 {
        self.f.iter().map(|by| by.abs()).sum()
    }
}

/// A descent from its start. It is gone through again from there whenever further results are known, up to the first that are not: so it reads as if
/// candidates were evaluated on the spot.
struct Run<'a> {
    rule: &'a Descent,
    domain: &'a Domain,
    told: &'a [Point],
    /// The cheapest critical candidate of this descent.
    best: Option<Place>,
}

impl<'a> Run<'a> {
    fn new(rule: &'a Descent, domain: &'a Domain, told: &'a [Point]) -> Self {
        Self { rule, domain, told, best: None }
    }

    fn descend(&mut self) -> Result<(), Unknown> {
        let Some(mut outside) = self.begin()? else { return Ok(()) };
        let (mut reach, mut idle, mut scale) = (self.rule.reach, 0, 1.0);
        for _ in 0..STEPS {
            let by = self.gradients(&outside)?;
            if by.largest() == 0.0 {
                return Ok(());
            }
            let Some(best) = self.best.clone() else {
                match self.seek(&outside, &by, scale)? {
                    Some(next) => outside = next,
                    None if scale < SHORTEST => return Ok(()),
                    None => scale /= SHORTER,
                }
                continue;
            };
            if by.cost.iter().all(|by| *by == 0.0) {
                return Ok(());
            }
            let step = self.along(&outside, &by, reach)?;
            match step {
                Some((next, far)) if self.is_cheaper_than(&best) => {
                    let Some(next) = next else { return Ok(()) };
                    outside = next;
                    idle = 0;
                    reach = if far { (1.5 * reach).min(1.0) } else { reach / 2.0 };
                }
                _ => {
                    idle += 1;
                    reach /= 3.0;
                }
            }
            if idle == PATIENCE {
                return Ok(());
            }
        }
        Ok(())
    }

    fn is_cheaper_than(&self, before: &Place) -> bool {
        self.best.as_ref().is_some_and(|best| best.cost < before.cost - GAIN * before.cost.abs())
    }

    /// A place that is not critical: the best that was drawn, or one at the border if something that was drawn is critical. None if there is none.
    fn begin(&mut self) -> Result<Option<Place>, Unknown> {
        let drawn = self.evaluate(self.rule.starts.clone())?;
        let Some(critical) = self.best.clone() else {
            return Ok(drawn.into_iter().flatten().min_by(|a, b| a.f.total_cmp(&b.f)));
        };
        // Towards the corner that costs least.
        let by = self.gradients(&critical)?;
        let corner = self.cheapest(&critical, &Gradients { f: vec![0.0; by.f.len()], ..by }, 1.0, 0.0);
        let way = [0.25, 0.5, 0.75, 1.0].map(|part| between(&critical.x, &corner, part));
        let mut inside = critical;
        for place in self.evaluate(way.to_vec())?.into_iter().flatten() {
            if !place.critical {
                return Ok(Some(self.border(place, inside)?));
            }
            inside = place;
        }
        Ok(None)
    }

    /// A place that is nearer to failing, or at the border if a failure was found. None if nothing is nearer.
    fn seek(&mut self, from: &Place, by: &Gradients, scale: f64) -> Result<Option<Place>, Unknown> {
        let steps = SEEKING.map(|reach| self.cheapest(from, by, scale * reach, f64::INFINITY));
        let mut lowest = from.clone();
        for place in self.evaluate(steps.to_vec())?.into_iter().flatten() {
            if place.critical {
                return Ok(Some(self.border(lowest, place)?));
            }
            if place.f < lowest.f {
                lowest = place;
            }
        }
        Ok((lowest.f < from.f).then_some(lowest))
    }

    /// A step along the border: the place outside of it where the cheapest critical candidate lies, if there is one, and whether the longer of two
    /// reaches led there. None if no candidate was critical.
    fn along(
        &mut self,
        from: &Place,
        by: &Gradients,
        reach: f64,
    ) -> Result<Option<(Option<Place>, bool)>, Unknown> {
        let reaches = [reach, reach / 3.0];
        let steps = reaches.into_iter().flat_map(|reach| MARGINS.map(|margin| (reach, margin)));
        let steps =
            steps.map(|(reach, margin)| self.cheapest(from, by, reach, margin * reach * by.largest()));
        let places = self.evaluate(steps.collect())?;
        let mut found: Option<(Option<Place>, Place, f64)> = None;
        for (reach, places) in reaches.into_iter().zip(places.chunks(MARGINS.len())) {
            let mut outside = None;
            for place in places.iter().flatten() {
                if !place.critical {
                    outside = Some(place.clone());
                    continue;
                }
                if found.as_ref().is_none_or(|(_, found, _)| place.cost < found.cost) {
                    found = Some((outside, place.clone(), reach));
                }
                break;
            }
        }
        let Some((outside, inside, led)) = found else { return Ok(None) };
        let outside = match outside {
            Some(outside) => Some(self.border(outside, inside)?),
            None => self.back(&inside, by, led)?,
        };
        Ok(Some((outside, led == reach)))
    }

    /// The border outside of a critical place; none if it is not found nearby.
    fn back(&mut self, inside: &Place, by: &Gradients, reach: f64) -> Result<Option<Place>, Unknown> {
        let steps = BACK.map(|margin| self.cheapest(inside, by, reach, margin * reach * by.largest()));
        let places = self.evaluate(steps.to_vec())?;
        let outside = places.into_iter().flatten().find(|place| !place.critical);
        outside.map(|outside| self.border(outside, inside.clone())).transpose()
    }

    /// The place just outside of the border on the straight line to a critical one.
    fn border(&mut self, mut outside: Place, mut inside: Place) -> Result<Place, Unknown> {
        for _ in 0..2 {
            let line = [0.25, 0.5, 0.75].map(|part| between(&outside.x, &inside.x, part));
            for place in self.evaluate(line.to_vec())?.into_iter().flatten() {
                if place.critical {
                    inside = place;
                    break;
                }
                outside = place;
            }
        }
        Ok(outside)
    }

    /// How objective and cost change, by a candidate beside a place in each variable that has an order.
    fn gradients(&mut self, at: &Place) -> Result<Gradients, Unknown> {
        let moved: Vec<usize> =
            (0..at.x.len()).filter(|i| !self.domain.is_choice(*i) && self.domain.unit(*i) > 0.0).collect();
        let beside = moved.iter().map(|&i| {
            let step = match self.domain.is_discrete(i) {
                true => self.rule.step.max(self.domain.unit(i)),
                false => self.rule.step,
            };
            let mut x = at.x.clone();
            x[i] += if x[i] + step <= 1.0 { step } else { -step };
            x
        });
        let places = self.evaluate(beside.collect())?;
        let mut by = Gradients { f: vec![0.0; at.x.len()], cost: vec![0.0; at.x.len()] };
        for (i, place) in moved.into_iter().zip(places) {
            let Some(place) = place else { continue };
            let step = place.x[i] - at.x[i];
            if step != 0.0 {
                by.f[i] = (place.f - at.f) / step;
                by.cost[i] = (place.cost - at.cost) / step;
            }
        }
        Ok(by)
    }

    /// Of the steps within a reach by which the objective falls by this much, the one that costs least, if both are linear; if none
    /// falls by so much, the one by which it falls most. A linear cost, one linear constraint and bounds are a fractional knapsack.
    fn cheapest(&self, at: &Place, by: &Gradients, reach: f64, fall: f64) -> Vec<f64> {
        let mut x = at.x.clone();
        let mut fallen = 0.0;
        let mut rest = Vec::new();
        for (i, share) in x.iter_mut().enumerate() {
            let [low, high] = [(at.x[i] - reach).max(0.0), (at.x[i] + reach).min(1.0)];
            // First what costs least, then what of that has to be given up.
            match by.cost[i] {
                cost if cost > 0.0 => *share = low,
                cost if cost < 0.0 => *share = high,
                _ => {}
            }
            fallen -= by.f[i] * (*share - at.x[i]);
            let to = if by.f[i] < 0.0 { high } else { low };
            let gain = by.f[i] * (*share - to);
            if gain > 0.0 {
                rest.push((by.cost[i] * (to - *share) / gain, i, to, gain));
            }
        }
        rest.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        for (_, i, to, gain) in rest {
            if fallen >= fall {
                break;
            }
            let part = ((fall - fallen) / gain).min(1.0);
            x[i] += part * (to - x[i]);
            fallen += part * gain;
        }
        x
    }

    /// What candidates at these shares of the ranges come to: none for one that breaks a constraint or cannot be evaluated.
    fn evaluate(&mut self, shares: Vec<Vec<f64>>) -> Result<Vec<Option<Place>>, Unknown> {
        let mut places = Vec::with_capacity(shares.len());
        let mut unknown: Vec<Vec<f64>> = Vec::new();
        for shares in shares {
            let x = self.domain.settle(self.domain.at_shares(&shares));
            if !self.domain.keeps_constraints(&x) {
                places.push(None);
            } else if let Some(number) = self.rule.known.get(&bits(&x)) {
                places.push(self.place(x, &self.told[*number]));
            } else if !unknown.contains(&x) {
                unknown.push(x);
            }
        }
        if !unknown.is_empty() {
            return Err(Unknown(unknown));
        }
        let cheapest = places.iter().flatten().filter(|place| place.critical).chain(&self.best);
        self.best = cheapest.min_by(|a, b| a.cost.total_cmp(&b.cost)).cloned();
        Ok(places)
    }

    fn place(&self, x: Vec<f64>, point: &Point) -> Option<Place> {
        let f = *point.f.get(self.rule.main)?;
        let others = point.f.iter().enumerate().filter(|(i, _)| *i != self.rule.main);
        let cost = others.map(|(_, objective)| objective).sum();
        let x = self.domain.shares(&x);
        (point.violation <= 0.0).then_some(Place { x, f, cost, critical: point.critical })
    }
}

/// The place this part of the way from one to another.
fn between(from: &[f64], to: &[f64], part: f64) -> Vec<f64> {
    from.iter().zip(to).map(|(from, to)| from + (to - from) * part).collect()
}

#[cfg(test)]
mod tests {
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
            assert!(least(&found) < 1.54, "seed {seed}: {}", least(&found));
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
                    let (objectives, critical) =
                        weighted(&problem.space.positions(&candidate.values).unwrap());
                    Evaluated {
                        id: candidate.id,
                        objectives,
                        violations: Vec::new(),
                        critical,
                        failure: None,
                    }
                })
                .collect();
            strategy.tell(&results).unwrap();
        }
        assert!(count <= 4, "{count}");
    }

    #[test]
    fn the_objective_that_leads_to_failures_is_one_of_the_problem() {
        let mut strategy: Strategy<Descent> = make(&[("towards", "speed".into())]);
        let error = strategy.start(&two_objectives(reals(2)), &key(1)).unwrap_err().to_string();
        assert!(error.contains("`speed`") && error.contains("one of effort, danger"), "{error}");
    }
}
