//! MAP-Elites: the best candidate for each cell of a map over features, so that failures of all kinds are found.
//!
//! Mouret, Clune, "Illuminating search spaces by mapping elites" (2015). The features are variables of the space, all of them
//! unless the user names some, and the cells those of [`Cells`]. In each cell lives the best candidate: a critical one before any
//! other, then by an objective.

use std::collections::{BTreeMap, VecDeque};

use pdk_sdk::prelude::*;
use pdk_sdk::seed::Random;
use pdk_sdk::serde_json::Value;
use pdk_statistics::point::Point;

use crate::cells::Cells;
use crate::domain::{Domain, Seen};
use crate::nsga2::{draw_new, initial};
use crate::strategy::{Next, Rule};
use crate::variation::Variation;

/// How often a child is bred for before a candidate is drawn.
const TRIES: usize = 20;

/// Of how many elites that are drawn the best is a parent.
const TOURNAMENT: usize = 4;

/// See the [module](self).
pub struct MapElites {
    wanted: Vec<String>,
    objective: String,
    wanted_cells: usize,
    initial: usize,
    batch: usize,
    explore: f64,
    variation: Variation,
    /// The variables of the map, and the objective that counts.
    features: Vec<usize>,
    quality: usize,
    cells: Cells,
    /// The best of each cell.
    elites: BTreeMap<usize, Point>,
    /// How many results are on the map.
    mapped: usize,
    seen: Seen,
    rest: VecDeque<Vec<f64>>,
}

impl Rule for MapElites {
    fn description() -> Description {
        let description = Description::search(
            "map_elites",
            "MAP-Elites: the best candidate for each cell of a map over features, so that failures of all kinds are found",
        )
        .version(2)
        .source("J.-B. Mouret, J. Clune (2015), V. Vassiliades, K. Chatzilygeroudis, J.-B. Mouret (2018)")
        .parameter(Parameter::json(
            "features",
            Value::Array(Vec::new()),
            "the variables that the map is over; all if the list is empty",
        ))
        .parameter(Parameter::text("objective", "the objective that is compared within a cell; if it is empty, the first one").optional())
        .parameter(
            Parameter::integer("cells", 100, "cells of the map, or one for each value if these are fewer").range(1.0, 10_000.0),
        )
        .parameter(
            Parameter::integer("initial", 100, "candidates before any is bred, as a Latin hypercube").range(1.0, 100_000.0),
        )
        .parameter(
            Parameter::integer("batch", 16, "candidates that are bred from one map; at least as many as there are workers")
                .range(1.0, 10_000.0),
        )
        .parameter(
            Parameter::number("explore", 0.1, "the share of candidates that are drawn instead of bred").range(0.0, 1.0),
        );
        Variation::parameters(description)
    }

    fn new(config: &Config) -> Result<Self> {
        let whole = |name: &str| usize::try_from(config.integer(name)).unwrap_or_default();
        let wanted = match config.value("features") {
            Value::Array(names) => names.iter().map(|name| name.as_str().map(str::to_owned)).collect(),
            _ => None,
        };
        let wanted = wanted.ok_or_else(|| {
            Error::of(
                ErrorKind::Configuration,
                format!("`features` is {}, but has to be a list of variables", config.value("features")),
            )
        })?;
        Ok(Self {
            wanted,
            objective: config.text("objective").to_owned(),
            wanted_cells: whole("cells"),
            initial: whole("initial"),
            batch: whole("batch"),
            explore: config.number("explore"),
            variation: Variation::new(config),
            features: Vec::new(),
            quality: 0,
            cells: Cells::default(),
            elites: BTreeMap::new(),
            mapped: 0,
            seen: Seen::default(),
            rest: VecDeque::new(),
        })
    }

    fn start(&mut self, problem: &Problem, domain: &Domain) -> Result<()> {
        let unknown = |what: &str, name: &str| {
            Error::of(
                ErrorKind::Configuration,
                format!("`{name}` is not {what} of the search; name one that is"),
            )
        };
        self.features = (0..domain.len()).collect();
        if !self.wanted.is_empty() {
            let place = |name: &String| {
                let place = problem.space.variables.iter().position(|variable| variable.name == *name);
                place.ok_or_else(|| unknown("a variable", name))
            };
            self.features = self.wanted.iter().map(place).collect::<Result<_>>()?;
        }
        self.quality = match self.objective.as_str() {
            "" => 0,
            name => problem
                .objectives
                .iter()
                .position(|objective| objective == name)
                .ok_or_else(|| unknown("an objective", name))?,
        };
        (self.elites, self.mapped, self.seen) = (BTreeMap::new(), 0, Seen::default());
        self.rest.clear();
        Ok(())
    }

    fn next(&mut self, domain: &Domain, random: &mut Random, proposed: usize, told: &[Point]) -> Next {
        if self.rest.is_empty() {
            self.rest = if proposed == 0 {
                self.cells = Cells::new(domain, &self.features, self.wanted_cells, random);
                initial(domain, self.initial, &mut self.seen, random).into()
            } else {
                let known = proposed - self.batch.min(self.initial / 2);
                if told.len() < known {
                    return Next::Wait;
                }
                for point in &told[self.mapped..known] {
                    self.enter(domain, point);
                }
                self.mapped = known;
                (0..self.batch).map(|_| self.breed(domain, random)).collect()
            };
        }
        self.rest.pop_front().map_or(Next::End, Next::Propose)
    }
}

impl MapElites {
    /// Whether a point is better than another: it violates the constraints less, is critical, or is better in the objective.
    fn better(&self, point: &Point, other: &Point) -> bool {
        let quality = |point: &Point| point.f.get(self.quality).copied().unwrap_or(f64::INFINITY);
        let order = point.violation.total_cmp(&other.violation).then(other.critical.cmp(&point.critical));
        order.then(quality(point).total_cmp(&quality(other))).is_lt()
    }

    /// Puts a point on the map if it is better than what is there.
    fn enter(&mut self, domain: &Domain, point: &Point) {
        if point.violation.is_infinite() {
            return;
        }
        let cell = self.cells.of(domain, &point.x);
        let better = |other: &Point| self.better(point, other);
        if self.elites.get(&cell).is_none_or(better) {
            self.elites.insert(cell, point.clone());
        }
    }

    /// A child of two elites, or a draw.
    fn breed(&mut self, domain: &Domain, random: &mut Random) -> Vec<f64> {
        if random.unit() >= self.explore && !self.elites.is_empty() {
            let elites: Vec<&Point> = self.elites.values().collect();
            for _ in 0..TRIES {
                let mut draw = || {
                    let drawn = (0..TOURNAMENT).map(|_| elites[random.below(elites.len() as u32) as usize]);
                    // Of equal ones the first.
                    drawn.reduce(|best, other| if self.better(other, best) { other } else { best })
                };
                let (Some(a), Some(b)) = (draw(), draw()) else { break };
                let parents = [a.x.as_slice(), b.x.as_slice()];
                let [child, _] = self.variation.children(domain, domain.bounds(), parents, random);
                if self.seen.add(&child) {
                    return child;
                }
            }
        }
        draw_new(domain, domain.bounds(), &mut self.seen, random)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::random::RandomSearch;
    use crate::strategy::Strategy;
    use crate::testing::{key, make, problem, reals, search};

    #[test]
    fn every_cell_gets_a_better_candidate_than_chance_finds() {
        // What is good depends on variables that are not features.
        let hidden = |x: &[f64]| (vec![x[2..].iter().map(|x| (x - 0.3).abs()).sum::<f64>()], false);
        let mean_of_cells = |all: Vec<(Vec<f64>, Vec<f64>, bool)>| {
            let mut cells = BTreeMap::new();
            for (x, f, _) in all {
                let best =
                    cells.entry([(x[0] * 5.0) as usize, (x[1] * 5.0) as usize]).or_insert(f64::INFINITY);
                *best = best.min(f[0]);
            }
            assert_eq!(cells.len(), 25);
            cells.values().sum::<f64>() / 25.0
        };
        let problem = problem(reals(5));
        let mut elites: Strategy<MapElites> =
            make(&[("features", pdk_sdk::serde_json::json!(["x0", "x1"])), ("cells", 25.into())]);
        let elites = mean_of_cells(search(&mut elites, &problem, 1, 1000, hidden));
        let mut random: Strategy<RandomSearch> = make(&[]);
        let random = mean_of_cells(search(&mut random, &problem, 1, 1000, hidden));
        assert!(elites < random / 2.0, "{elites} {random}");
    }

    #[test]
    fn the_map_is_over_all_variables() {
        // Four regions of .6 %, which only the last two of four variables tell apart.
        let middles = [[0.2, 0.2], [0.2, 0.8], [0.8, 0.2], [0.8, 0.8]];
        let regions = |x: &[f64]| {
            let miss = |middle: &[f64; 2]| {
                let of = |(x, middle): (&f64, &f64)| ((x - middle).abs() - 0.14).max(0.0);
                x.iter().zip([0.3, 0.6].iter().chain(middle)).map(of).sum::<f64>()
            };
            let nearest = middles.iter().map(miss).fold(f64::INFINITY, f64::min);
            // One of them is worse than the others.
            (vec![nearest - if x[2] > 0.5 && x[3] > 0.5 { 0.1 } else { 0.0 }], nearest == 0.0)
        };
        let fewest = |all: Vec<(Vec<f64>, Vec<f64>, bool)>| {
            let mut counts = [0; 4];
            for (x, ..) in all.iter().filter(|(_, _, critical)| *critical) {
                counts[usize::from(x[2] > 0.5) * 2 + usize::from(x[3] > 0.5)] += 1;
            }
            counts.into_iter().min().unwrap()
        };
        for seed in 0..5 {
            let mut elites: Strategy<MapElites> = make(&[]);
            let elites = fewest(search(&mut elites, &problem(reals(4)), seed, 1000, regions));
            let mut random: Strategy<RandomSearch> = make(&[]);
            let random = fewest(search(&mut random, &problem(reals(4)), seed, 1000, regions));
            assert!(elites > 2 * random && elites > 15, "seed {seed}: {elites} {random}");
        }
    }

    #[test]
    fn features_are_variables() {
        let mut strategy: Strategy<MapElites> =
            make(&[("features", pdk_sdk::serde_json::json!(["x1", "y"]))]);
        let error = strategy.start(&problem(reals(2)), &key(0)).unwrap_err();
        assert_eq!(error.message(), "`y` is not a variable of the search; name one that is");
    }
}
