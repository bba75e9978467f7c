//! Descent: gradients lead to a failure, and along the border of the failures to one that costs least.
//!
//! One objective leads to failures; the sum of the others is what a failure costs, such as the levels that it takes. From the best of a few candidates that are
//! drawn, the first objective is followed downwards until a candidate is critical. From there on the search stays at the border between what is
//! critical and what is not. At a place just outside, a candidate beside it in each variable gives both gradients. With these, the cheapest step that stays
//! critical is a linear programme with bounds and one constraint, which is a fractional knapsack. It is solved for some reaches and margins, since
//! nothing is quite linear, and the cheapest critical candidate among these is next (sequential linear programming: R. E. Griffith, R. A. Stewart, 1961; in
//! the analysis of reliability, the place that it leads to is the design point: A. M. Hasofer, N. C. Lind, 1974). Once that leads nowhere, the other
//! values of variables without an order are tried. If they lead nowhere either, all begins anew elsewhere.

use std::collections::{HashMap, VecDeque};

use pdk_sdk::prelude::*;
use pdk_sdk::seed::Random;
use pdk_statistics::point::Point;

use crate::domain::Domain;
use crate::strategy::{Next, Rule};

/// Objectives that lead to failures in drives.
const MEASURES: [&str; 4] =
    ["max_cross_track_error", "mean_cross_track_error", "time_to_failure", "criticality"];
/// Candidates that are drawn, of which the best is where a descent begins. They are twice as many after each descent that led to no failure, up to a limit.
const DRAWN: usize = 8;
const MOST_DRAWN: usize = 256;
/// The first steps towards a failure, as shares of each range.
const SEEKING: [f64; 4] = [0.1, 0.2, 0.4, 0.8];
/// By how much they become shorter if none leads nearer, and how short they become.
const SHORTER: f64 = 6.0;
const SHORTEST: f64 = 0.02;
/// How far inside the border a step along it is to lead, as parts of the largest change of the objective that its reach allows.
const MARGINS: [f64; 4] = [-0.1, 0.05, 0.25, 0.7];
/// How far a critical candidate is moved to what costs least, to leave what is critical, as shares of each range.
const LEAVING: [f64; 3] = [1.0, 0.3, 0.1];
/// How much a step has to gain, as a share of the differences between all candidates so far.
const GAIN: f64 = 0.005;
/// After this many steps in a row that gain less, a descent is over.
const PATIENCE: usize = 3;
/// The most steps of a descent.
const STEPS: usize = 100;
/// How often the way to a place that breaks a constraint is halved.
const HALVINGS: usize = 20;
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
    /// How many are drawn.
    drawn: usize,
    /// Whether these starts were drawn for the candidates that are proposed now.
    is_drawn: bool,
    /// What a step of this descent has to gain, in the objective and in the cost.
    gain: [f64; 2],
    /// How many descents led to nothing new.
    fruitless: usize,
    rest: VecDeque<Vec<f64>>,
}

impl Rule for Descent {
    fn description() -> Description {
        Description::search(
            "descent",
            "Follows finite-difference gradients to a failure, then along the border of the failures to the cheapest one",
        )
        .source("R. E. Griffith, R. A. Stewart (1961), A. M. Hasofer, N. C. Lind (1974)")
        .parameter(Parameter::text(
            "towards",
            "the objective that leads to failures; the sum of the others is what a failure costs, which has to be continuous; empty: the only objective, or \
             the only one of max_cross_track_error, mean_cross_track_error, time_to_failure and criticality",
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
            drawn: DRAWN,
            is_drawn: false,
            gain: [0.0; 2],
            fruitless: 0,
            rest: VecDeque::new(),
        })
    }

    fn start(&mut self, problem: &Problem, _domain: &Domain) -> Result<()> {
        let names = &problem.objectives;
        let list = || names.join(", ");
        self.main = match self.towards.as_str() {
            "" => {
                let is_measure = |(_, name): &(usize, &String)| MEASURES.contains(&name.as_str());
                let measures: Vec<usize> =
                    names.iter().enumerate().filter(is_measure).map(|(i, _)| i).collect();
                match (measures.as_slice(), names.len()) {
                    ([place], _) => *place,
                    (_, 1) => 0,
                    _ => {
                        return Err(Error::new(format!(
                            "it cannot tell which objective leads to failures; name it in `towards`, one of {}, and let the others say what a failure costs",
                            list()
                        )));
                    }
                }
            }
            name => names.iter().position(|other| other == name).ok_or_else(|| {
                Error::new(format!(
                    "`towards` is `{name}`, which is not an objective; name one of {}",
                    list()
                ))
            })?,
        };
        self.known.clear();
        self.read = 0;
        self.starts.clear();
        (self.drawn, self.is_drawn, self.gain) = (DRAWN, false, [0.0; 2]);
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
            if self.is_drawn {
                // Once for all of a descent, which has to come out the same when it is replayed.
                self.gain = [self.range(told, Self::objective), self.range(told, Self::cost)]
                    .map(|range| GAIN * range);
                self.is_drawn = false;
            }
            if self.starts.is_empty() {
                let spread = domain.latin_hypercube(domain.bounds(), self.drawn, random);
                let drawn = spread.into_iter().map(|x| match domain.keeps_constraints(&x) {
                    true => x,
                    false => domain.draw(domain.bounds(), random),
                });
                self.starts = drawn.map(|x| domain.shares(&x)).collect();
                self.is_drawn = true;
            }
            let mut run = Run::new(self, domain, told);
            match run.descend() {
                Err(Unknown(candidates)) => {
                    self.fruitless = 0;
                    self.rest = candidates.into();
                }
                Ok(()) if self.fruitless == EXHAUSTED => return Next::End,
                Ok(()) => {
                    self.drawn = if run.best.is_some() { DRAWN } else { (2 * self.drawn).min(MOST_DRAWN) };
                    self.fruitless += 1;
                    self.starts.clear();
                }
            }
        }
        self.rest.pop_front().map_or(Next::End, Next::Propose)
    }
}

impl Descent {
    /// The difference between the smallest and the largest value of all results.
    fn range(&self, told: &[Point], of: fn(&Self, &Point) -> f64) -> f64 {
        let valid = told.iter().filter(|point| point.violation <= 0.0 && !point.f.is_empty());
        let ends = valid.map(|point| of(self, point)).fold(None, |ends: Option<(f64, f64)>, value| {
            let (low, high) = ends.unwrap_or((value, value));
            Some((low.min(value), high.max(value)))
        });
        ends.map_or(0.0, |(low, high)| high - low)
    }

    fn objective(&self, point: &Point) -> f64 {
        point.f[self.main]
    }

    fn cost(&self, point: &Point) -> f64 {
        let others = point.f.iter().enumerate().filter(|(i, _)| *i != self.main);
        others.map(|(_, objective)| objective).sum()
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

/// A descent from its start. It is replayed from there whenever new results arrive, up to the first candidates without any: so it reads as if
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
        let mut switched_at = f64::INFINITY;
        for _ in 0..STEPS {
            let by = self.gradients(&outside)?;
            let Some(best) = self.best.clone() else {
                match self.seek(&outside, &by, scale)? {
                    Some(next) => outside = next,
                    None if scale >= SHORTEST => scale /= SHORTER,
                    None => {
                        let Some(next) = self.switch(&outside)? else { return Ok(()) };
                        (outside, scale) = (next, 1.0);
                    }
                }
                continue;
            };
            let step = self.along(&outside, &by, reach)?;
            if self.is_cheaper_than(&best) {
                idle = 0;
                reach = if matches!(step, Some((_, true))) { (1.5 * reach).min(1.0) } else { reach / 2.0 };
                let next = match step {
                    Some((Some(next), _)) => Some(next),
                    _ => self.leave_cheapest()?,
                };
                let Some(next) = next else { return Ok(()) };
                outside = next;
                continue;
            }
            idle += 1;
            reach /= 3.0;
            if idle == PATIENCE {
                let led = best.cost < switched_at - self.rule.gain[1];
                let next = if led { self.switch(&outside)? } else { None };
                let Some(next) = next else { return Ok(()) };
                (outside, reach, idle, switched_at) = (next, self.rule.reach, 0, best.cost);
            }
        }
        Ok(())
    }

    fn is_cheaper_than(&self, before: &Place) -> bool {
        self.best.as_ref().is_some_and(|best| best.cost < before.cost - self.rule.gain[1])
    }

    /// A place that is not critical: the best that was drawn, or one at the border if something that was drawn is critical. None if there is none.
    fn begin(&mut self) -> Result<Option<Place>, Unknown> {
        let drawn = self.evaluate(self.rule.starts.clone())?;
        match self.best {
            Some(_) => self.leave_cheapest(),
            None => Ok(drawn.into_iter().flatten().min_by(|a, b| a.f.total_cmp(&b.f))),
        }
    }

    /// The place just outside of the border on the way from the cheapest critical place to what costs least. None if all on the way is critical.
    fn leave_cheapest(&mut self) -> Result<Option<Place>, Unknown> {
        for reach in LEAVING {
            let Some(critical) = self.best.clone() else { return Ok(None) };
            if let Some(outside) = self.leave(critical, reach)? {
                return Ok(Some(outside));
            }
        }
        Ok(None)
    }

    /// The same from some critical place, within a reach.
    fn leave(&mut self, mut inside: Place, reach: f64) -> Result<Option<Place>, Unknown> {
        let by = self.gradients(&inside)?;
        let corner = self.cheapest(&inside, &Gradients { f: vec![0.0; by.f.len()], ..by }, reach, 0.0);
        let way = [0.25, 0.5, 0.75, 1.0].map(|part| between(&inside.x, &corner, part));
        for place in self.evaluate(way.to_vec())?.into_iter().flatten() {
            if !place.critical {
                return Ok(Some(self.border(place, inside)?));
            }
            inside = place;
        }
        Ok(None)
    }

    /// Tries the other values of each variable without an order at a place that is not critical. The place that one of them leads to: outside of the
    /// border if it is critical, or else where the objective is lower. None if none leads anywhere.
    fn switch(&mut self, at: &Place) -> Result<Option<Place>, Unknown> {
        let mut others = Vec::new();
        for i in (0..at.x.len()).filter(|i| self.domain.is_choice(*i) && self.domain.unit(*i) > 0.0) {
            let last = libm::round(1.0 / self.domain.unit(i));
            for value in 0..=last as usize {
                let mut x = at.x.clone();
                x[i] = value as f64 / last;
                others.push(x);
            }
        }
        let places: Vec<Place> = self.evaluate(others)?.into_iter().flatten().collect();
        if let Some(critical) = places.iter().find(|place| place.critical) {
            return self.leave(critical.clone(), LEAVING[0]);
        }
        let lowest = places.into_iter().min_by(|a, b| a.f.total_cmp(&b.f));
        Ok(lowest.filter(|place| place.f < at.f - self.rule.gain[0]))
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
        Ok((lowest.f < from.f - self.rule.gain[0]).then_some(lowest))
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
        let outside = outside.map(|outside| self.border(outside, inside)).transpose()?;
        Ok(Some((outside, led == reach)))
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

    /// How objective and cost change, by a candidate beside a place in each variable that has an order: above it if there is room and the candidate
    /// can be evaluated, or else below.
    fn gradients(&mut self, at: &Place) -> Result<Gradients, Unknown> {
        let mut by = Gradients { f: vec![0.0; at.x.len()], cost: vec![0.0; at.x.len()] };
        let mut moved: Vec<usize> =
            (0..at.x.len()).filter(|i| !self.domain.is_choice(*i) && self.domain.unit(*i) > 0.0).collect();
        for side in [1.0, -1.0] {
            let beside = moved.iter().map(|&i| {
                let step = side * self.reach_of(i, self.rule.step);
                let mut x = at.x.clone();
                x[i] += if (0.0..=1.0).contains(&(x[i] + step)) { step } else { -step };
                x
            });
            let places = self.evaluate(beside.collect())?;
            let mut missing = Vec::new();
            for (i, place) in moved.into_iter().zip(places) {
                let Some(place) = place else {
                    missing.push(i);
                    continue;
                };
                let step = place.x[i] - at.x[i];
                if step != 0.0 {
                    by.f[i] = (place.f - at.f) / step;
                    by.cost[i] = (place.cost - at.cost) / step;
                }
            }
            moved = missing;
        }
        Ok(by)
    }

    /// A reach in one variable: at least to its next value.
    fn reach_of(&self, variable: usize, reach: f64) -> f64 {
        match self.domain.is_discrete(variable) {
            true => reach.max(self.domain.unit(variable)),
            false => reach,
        }
    }

    /// Of the steps within a reach by which the objective falls by this much, the one that costs least, if both are linear; if none
    /// falls by so much, the one by which it falls most. A linear cost, one linear constraint and bounds are a fractional knapsack.
    fn cheapest(&self, at: &Place, by: &Gradients, reach: f64, fall: f64) -> Vec<f64> {
        let mut x = at.x.clone();
        let mut fallen = 0.0;
        let mut rest = Vec::new();
        for (i, share) in x.iter_mut().enumerate() {
            let reach = self.reach_of(i, reach);
            let [low, high] = [-reach, reach].map(|step| self.end(at, i, (at.x[i] + step).clamp(0.0, 1.0)));
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
            let mut part = ((fall - fallen) / gain).min(1.0);
            if self.domain.is_discrete(i) {
                // Whole steps, at least as many as it takes.
                let steps = (to - x[i]).abs() / self.domain.unit(i);
                part = ((part * steps).ceil() / steps).min(1.0);
            }
            x[i] += part * (to - x[i]);
            fallen += part * gain;
        }
        self.within(at, x)
    }

    /// How far a variable alone can be moved on the way to another share without breaking a constraint.
    fn end(&self, at: &Place, variable: usize, to: f64) -> f64 {
        let mut x = at.x.clone();
        x[variable] = to;
        self.within(at, x)[variable]
    }

    /// As much of the way to a place as keeps the constraints.
    fn within(&self, at: &Place, x: Vec<f64>) -> Vec<f64> {
        let keeps = |x: &[f64]| self.domain.keeps_constraints(&self.domain.settle(self.domain.at_shares(x)));
        if keeps(&x) {
            return x;
        }
        let (mut kept, mut broken) = (0.0, 1.0);
        for _ in 0..HALVINGS {
            let part = (kept + broken) / 2.0;
            if keeps(&between(&at.x, &x, part)) { kept = part } else { broken = part }
        }
        between(&at.x, &x, kept)
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
        if point.violation > 0.0 || point.f.is_empty() {
            return None;
        }
        let (f, cost) = (self.rule.objective(point), self.rule.cost(point));
        Some(Place { x: self.domain.shares(&x), f, cost, critical: point.critical })
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
    fn values_of_two_and_values_without_an_order_are_switched() {
        let mut space = integers(6, 1);
        for (name, values) in [("a", 4), ("b", 4)] {
            let values = (0..values).map(Into::into).collect();
            space.variables.push(Variable { name: name.to_owned(), range: Range::Choice { values } });
        }
        space
            .variables
            .push(Variable { name: "level".to_owned(), range: Range::Real { min: 0.0, max: 1.0 } });
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
}
