//! A descent: to the border between what is critical and what is not, and along it to what costs least. The [strategy](crate::descent) begins it
//! wherever it is to begin.

use std::collections::HashMap;

use pdk_statistics::point::Point;

use crate::domain::{Domain, bits};

/// The first steps towards a failure, as shares of each range.
const SEEKING: [f64; 4] = [0.1, 0.2, 0.4, 0.8];
/// By how much they become shorter if none leads nearer, and how short they become.
const SHORTER: f64 = 6.0;
const SHORTEST: f64 = 0.02;
/// How far inside the border a step along it is to lead, as parts of the largest change of the objective that its reach allows.
const MARGINS: [f64; 4] = [-0.1, 0.05, 0.3, 0.9];
/// How far a critical candidate is moved to what costs least, to leave what is critical, as shares of each range.
const LEAVING: [f64; 3] = [1.0, 0.3, 0.1];
/// After this many steps in a row that gain too little, other values of the variables without an order are tried, or the descent is over.
const PATIENCE: usize = 3;
/// The most steps of a descent.
const STEPS: usize = 100;
/// How often the way to a place that breaks a constraint is halved.
const HALVINGS: usize = 20;

/// What a descent goes by.
pub struct Basis {
    /// The place of the objective that leads to failures.
    pub main: usize,
    /// How far apart the candidates of a gradient are, as a share of a range.
    pub step: f64,
    /// The largest first step along the border, as a share of each range.
    pub reach: f64,
    /// The descent begins at the best of these, as shares of the ranges.
    pub starts: Vec<Vec<f64>>,
    /// What a step has to gain, in the objective and in the cost.
    pub gain: [f64; 2],
    /// Which results belong to which positions.
    known: HashMap<Vec<u64>, usize>,
}

impl Basis {
    /// With nothing known.
    pub fn new(step: f64, reach: f64) -> Self {
        Self { main: 0, step, reach, starts: Vec::new(), gain: [0.0; 2], known: HashMap::new() }
    }

    /// Notes where a result is found again.
    pub fn know(&mut self, point: &Point, number: usize) {
        self.known.insert(bits(&point.x), number);
    }

    /// The differences between the smallest and the largest objective and cost.
    pub fn ranges(&self, told: &[Point]) -> [f64; 2] {
        let valid = told.iter().filter(|point| is_valid(point));
        let values = valid.map(|point| [self.objective(point), self.cost(point)]);
        let ends = values.fold([(f64::INFINITY, f64::NEG_INFINITY); 2], |ends, values| {
            [0, 1].map(|i| (ends[i].0.min(values[i]), ends[i].1.max(values[i])))
        });
        ends.map(|(low, high)| (high - low).max(0.0))
    }

    fn objective(&self, point: &Point) -> f64 {
        point.f[self.main]
    }

    fn cost(&self, point: &Point) -> f64 {
        let others = point.f.iter().enumerate().filter(|(i, _)| *i != self.main);
        others.map(|(_, objective)| objective).sum()
    }
}

/// Whether a candidate was evaluated and keeps the constraints.
fn is_valid(point: &Point) -> bool {
    point.violation <= 0.0 && !point.f.is_empty()
}

/// Positions whose results have to be known before a descent goes on.
pub struct Unknown(pub Vec<Vec<f64>>);

/// An evaluated candidate.
#[derive(Debug, Clone)]
pub struct Place {
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
pub struct Run<'a> {
    basis: &'a Basis,
    domain: &'a Domain,
    told: &'a [Point],
    /// The cheapest critical candidate of this descent.
    pub best: Option<Place>,
}

impl<'a> Run<'a> {
    /// At the start.
    pub fn new(basis: &'a Basis, domain: &'a Domain, told: &'a [Point]) -> Self {
        Self { basis, domain, told, best: None }
    }

    /// Goes on as far as results are known.
    ///
    /// # Errors
    /// If some are not.
    pub fn descend(&mut self) -> Result<(), Unknown> {
        let Some(mut outside) = self.begin()? else { return Ok(()) };
        let (mut reach, mut idle, mut scale) = (self.basis.reach, 0, 1.0);
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
                let led = best.cost < switched_at - self.basis.gain[1];
                let next = if led { self.switch(&outside)? } else { None };
                let Some(next) = next else { return Ok(()) };
                (outside, reach, idle, switched_at) = (next, self.basis.reach, 0, best.cost);
            }
        }
        Ok(())
    }

    fn is_cheaper_than(&self, before: &Place) -> bool {
        self.best.as_ref().is_some_and(|best| best.cost < before.cost - self.basis.gain[1])
    }

    /// A place that is not critical: the best that was drawn, or one at the border if something that was drawn is critical. None if there is none.
    fn begin(&mut self) -> Result<Option<Place>, Unknown> {
        let drawn = self.evaluate(self.basis.starts.clone())?;
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
        Ok(lowest.filter(|place| place.f < at.f - self.basis.gain[0]))
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
        Ok((lowest.f < from.f - self.basis.gain[0]).then_some(lowest))
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
                let step = side * self.reach_of(i, self.basis.step);
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
            } else if let Some(number) = self.basis.known.get(&bits(&x)) {
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
        if !is_valid(point) {
            return None;
        }
        let (f, cost) = (self.basis.objective(point), self.basis.cost(point));
        Some(Place { x: self.domain.shares(&x), f, cost, critical: point.critical })
    }
}

/// The place this part of the way from one to another.
fn between(from: &[f64], to: &[f64], part: f64) -> Vec<f64> {
    from.iter().zip(to).map(|(from, to)| from + (to - from) * part).collect()
}
