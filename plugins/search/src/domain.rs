//! The space as numbers: positions within bounds, drawn, settled and told apart.

use std::collections::HashSet;

use pdk_sdk::prelude::*;
use pdk_sdk::seed::Random;

/// How often a position that keeps the constraints is drawn for, before one that does not is taken.
const DRAWS: usize = 1000;

/// The space as numbers.
#[derive(Debug, Clone)]
pub struct Domain {
    space: Space,
    /// The smallest and the largest position of each variable.
    bounds: Vec<(f64, f64)>,
}

/// A part of the space: the smallest and the largest position of each variable, whole ones where only these have values.
pub type Region = Vec<(f64, f64)>;

impl Domain {
    /// The numbers of a space that was checked.
    pub fn new(space: &Space) -> Self {
        let bounds = space.variables.iter().map(|variable| variable.range.bounds()).collect();
        Self { space: space.clone(), bounds }
    }

    /// The space.
    pub fn space(&self) -> &Space {
        &self.space
    }

    /// How many variables there are.
    pub fn len(&self) -> usize {
        self.bounds.len()
    }

    /// The whole space as a region.
    pub fn bounds(&self) -> &Region {
        &self.bounds
    }

    /// Whether only whole positions of a variable have a value.
    pub fn is_discrete(&self, variable: usize) -> bool {
        self.space.variables[variable].range.is_discrete()
    }

    /// Whether the order of a variable's positions means nothing.
    pub fn is_choice(&self, variable: usize) -> bool {
        matches!(self.space.variables[variable].range, Range::Choice { .. })
    }

    /// The smallest difference between positions of a variable that has values at some only, as a share of its range; for others, the range
    /// as a share of itself. 0 if the range has one value.
    pub fn unit(&self, variable: usize) -> f64 {
        let (low, high) = self.bounds[variable];
        match (high - low, self.is_discrete(variable)) {
            (0.0, _) => 0.0,
            (range, true) => 1.0 / range,
            (_, false) => 1.0,
        }
    }

    /// Positions as shares of the ranges, 0 to 1.
    pub fn shares(&self, x: &[f64]) -> Vec<f64> {
        x.iter().enumerate().map(|(i, position)| self.space.share(i, *position)).collect()
    }

    /// The positions at these shares of the ranges.
    pub fn at_shares(&self, shares: &[f64]) -> Vec<f64> {
        shares.iter().zip(&self.bounds).map(|(share, (low, high))| low + share * (high - low)).collect()
    }

    /// The nearest positions that have values.
    pub fn settle(&self, mut x: Vec<f64>) -> Vec<f64> {
        for (i, position) in x.iter_mut().enumerate() {
            let (low, high) = self.bounds[i];
            let within = if position.is_nan() { low } else { position.clamp(low, high) };
            // Without the sign of a zero, so that equal positions have equal bits.
            *position = if self.is_discrete(i) { libm::round(within) } else { within } + 0.0;
        }
        x
    }

    /// The position at a share of a region, 0 to 1: each value of a list or of whole numbers has an equal part of it.
    pub fn at_share(&self, region: &Region, variable: usize, share: f64) -> f64 {
        let (low, high) = region[variable];
        match self.is_discrete(variable) {
            true => (low + libm::floor(share * (high - low + 1.0))).clamp(low, high),
            false => low + share * (high - low),
        }
    }

    /// Positions drawn evenly from a region, such that they keep the constraints of the space where that can be had.
    pub fn draw(&self, region: &Region, random: &mut Random) -> Vec<f64> {
        let mut x = Vec::new();
        for _ in 0..DRAWS {
            x = (0..self.len()).map(|i| self.at_share(region, i, random.unit())).collect();
            if self.keeps_constraints(&x) {
                break;
            }
        }
        x
    }

    /// A Latin hypercube of `n` positions in a region: in each variable, each of `n` equal parts has one of them.
    pub fn latin_hypercube(&self, region: &Region, n: usize, random: &mut Random) -> Vec<Vec<f64>> {
        let mut points = vec![vec![0.0; self.len()]; n];
        for i in 0..self.len() {
            let mut parts: Vec<usize> = (0..n).collect();
            random.shuffle(&mut parts);
            for (point, part) in points.iter_mut().zip(parts) {
                point[i] = self.at_share(region, i, (part as f64 + random.unit()) / n as f64);
            }
        }
        points
    }

    /// Whether settled positions keep the constraints of the space.
    pub fn keeps_constraints(&self, x: &[f64]) -> bool {
        self.space.violations(x).iter().all(|violation| *violation <= 0.0)
    }
}

/// Whether positions lie in a region.
pub fn contains(region: &Region, x: &[f64]) -> bool {
    region.iter().zip(x).all(|((low, high), position)| low <= position && position <= high)
}

/// Positions that were proposed, to tell new ones from.
#[derive(Debug, Default)]
pub struct Seen(HashSet<Vec<u64>>);

impl Seen {
    /// Adds settled positions; whether they are new.
    pub fn add(&mut self, x: &[f64]) -> bool {
        self.0.insert(bits(x))
    }

    /// Whether settled positions were added before.
    pub fn has(&self, x: &[f64]) -> bool {
        self.0.contains(&bits(x))
    }
}

/// Positions as a key by which they are found again.
pub fn bits(x: &[f64]) -> Vec<u64> {
    x.iter().map(|position| position.to_bits()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{integers, key, reals};

    #[test]
    fn each_value_of_a_discrete_range_is_equally_likely() {
        let domain = Domain::new(&integers(1, 4));
        let mut random = key(1).sequence();
        let mut counts = [0; 5];
        for _ in 0..10_000 {
            counts[domain.draw(domain.bounds(), &mut random)[0] as usize] += 1;
        }
        assert!(counts.iter().all(|count| (1800..2200).contains(count)), "{counts:?}");
    }

    #[test]
    fn each_part_of_a_latin_hypercube_has_one_point() {
        let domain = Domain::new(&reals(3));
        for i in 0..3 {
            let points = domain.latin_hypercube(domain.bounds(), 20, &mut key(2).sequence());
            let mut parts: Vec<usize> = points.iter().map(|point| (point[i] * 20.0) as usize).collect();
            parts.sort_unstable();
            assert_eq!(parts, (0..20).collect::<Vec<_>>());
        }
    }

    #[test]
    fn draws_keep_the_constraints_of_the_space() {
        let mut space = reals(2);
        space.constraints = vec![pdk_sdk::search::Constraint {
            weights: [("x0".to_owned(), 1.0), ("x1".to_owned(), 1.0)].into(),
            at_most: 0.2,
        }];
        let domain = Domain::new(&space);
        let mut random = key(3).sequence();
        for _ in 0..100 {
            let x = domain.draw(domain.bounds(), &mut random);
            assert!(x[0] + x[1] <= 0.2, "{x:?}");
        }
    }
}
