//! New positions from old ones: simulated binary crossover and polynomial mutation, within a region.
//!
//! Deb, Agrawal, "Simulated binary crossover for continuous search space" (1995); Deb, Goyal, "A combined genetic adaptive
//! search (GeneAS) for engineering design" (1996). Whole positions are crossed and mutated as numbers, and then rounded. A
//! choice has no order: it is exchanged, and drawn anew.

use pdk_sdk::prelude::*;
use pdk_sdk::seed::Random;

use crate::domain::{Domain, Region};

/// Closer than this, two positions are the same to the crossover.
const SAME: f64 = 1e-14;

/// How offspring differs from its parents.
#[derive(Debug, Clone)]
pub struct Variation {
    /// The probability that two parents are crossed.
    pub crossover: f64,
    /// How near children are to their parents: the larger, the nearer.
    pub eta_crossover: f64,
    /// The probability that a variable is mutated; none: 1 / the number of variables.
    pub mutation: Option<f64>,
    /// How near a mutant is: the larger, the nearer.
    pub eta_mutation: f64,
    /// The probability that a child is mutated at all; none: 1 / the number of variables.
    pub mutants: Option<f64>,
    /// Whether whole numbers are cut off towards zero, as the published tool does, instead of rounded.
    pub truncate: bool,
}

impl Variation {
    /// The parameters of strategies that vary.
    pub fn parameters(description: Description) -> Description {
        // Smaller mutations than these do not lead from one part of a front to another.
        description
            .parameter(
                Parameter::number("crossover", 0.9, "the probability that two parents are crossed")
                    .range(0.0, 1.0),
            )
            .parameter(
                Parameter::number(
                    "eta_crossover",
                    20.0,
                    "how near children are to their parents: the larger, the nearer",
                )
                .range(0.0, 1000.0),
            )
            .parameter(
                Parameter::number(
                    "mutation",
                    0.0,
                    "the probability that a variable is mutated; 0: 1 / the number of variables",
                )
                .range(0.0, 1.0),
            )
            .parameter(
                Parameter::number("eta_mutation", 10.0, "how near a mutant is: the larger, the nearer")
                    .range(0.0, 1000.0),
            )
    }

    /// Reads the parameters.
    pub fn new(config: &Config) -> Self {
        Self {
            crossover: config.number("crossover"),
            eta_crossover: config.number("eta_crossover"),
            mutation: Some(config.number("mutation")).filter(|&probability| probability > 0.0),
            eta_mutation: config.number("eta_mutation"),
            mutants: Some(1.0),
            truncate: false,
        }
    }

    /// Two children of two parents, settled within a region.
    pub fn children(
        &self,
        domain: &Domain,
        region: &Region,
        parents: [&[f64]; 2],
        random: &mut Random,
    ) -> [Vec<f64>; 2] {
        let [mut a, mut b] = parents.map(<[f64]>::to_vec);
        if random.unit() < self.crossover {
            for i in 0..domain.len() {
                if random.unit() >= 0.5 {
                    continue;
                }
                if domain.is_choice(i) {
                    std::mem::swap(&mut a[i], &mut b[i]);
                } else {
                    (a[i], b[i]) = cross(a[i], b[i], region[i], self.eta_crossover, random);
                }
            }
        }
        [a, b].map(|child| self.mutate(domain, region, child, random))
    }

    /// A mutant, settled within a region.
    pub fn mutate(&self, domain: &Domain, region: &Region, mut x: Vec<f64>, random: &mut Random) -> Vec<f64> {
        let even = 1.0 / domain.len() as f64;
        let probability = self.mutation.unwrap_or(even);
        if self.truncate {
            cut_off(domain, &mut x);
        }
        if random.unit() >= self.mutants.unwrap_or(even) {
            return domain.settle(within(x, region));
        }
        for i in 0..domain.len() {
            let (low, high) = region[i];
            // A parent may lie outside of the region.
            x[i] = x[i].clamp(low, high);
            if random.unit() >= probability || low >= high {
                continue;
            }
            x[i] = match domain.is_choice(i) {
                true => domain.at_share(region, i, random.unit()),
                false => polynomial(x[i], region[i], self.eta_mutation, random),
            };
        }
        if self.truncate {
            cut_off(domain, &mut x);
        }
        domain.settle(x)
    }
}

/// The nearest positions in a region.
fn within(mut x: Vec<f64>, region: &Region) -> Vec<f64> {
    x.iter_mut().zip(region).for_each(|(position, &(low, high))| *position = position.clamp(low, high));
    x
}

/// Cuts positions that have to be whole off towards zero.
fn cut_off(domain: &Domain, x: &mut [f64]) {
    for (i, position) in x.iter_mut().enumerate() {
        if domain.is_discrete(i) {
            *position = libm::trunc(*position);
        }
    }
}

/// Simulated binary crossover of two positions, within bounds.
fn cross(a: f64, b: f64, (low, high): (f64, f64), eta: f64, random: &mut Random) -> (f64, f64) {
    let (near, far) = if a < b { (a, b) } else { (b, a) };
    if far - near <= SAME {
        return (a, b);
    }
    let draw = random.unit();
    let spread = |gap: f64| {
        let beta = 1.0 + 2.0 * gap.max(0.0) / (far - near);
        let alpha = 2.0 - libm::pow(beta, -(eta + 1.0));
        match draw <= 1.0 / alpha {
            true => libm::pow(draw * alpha, 1.0 / (eta + 1.0)),
            false => libm::pow(1.0 / (2.0 - draw * alpha), 1.0 / (eta + 1.0)),
        }
    };
    let first = 0.5 * ((near + far) - spread(near - low) * (far - near));
    let second = 0.5 * ((near + far) + spread(high - far) * (far - near));
    let (first, second) = (first.clamp(low, high), second.clamp(low, high));
    if random.unit() < 0.5 { (second, first) } else { (first, second) }
}

/// Polynomial mutation of a position, within bounds.
fn polynomial(x: f64, (low, high): (f64, f64), eta: f64, random: &mut Random) -> f64 {
    let extent = high - low;
    let draw = random.unit();
    let power = 1.0 / (eta + 1.0);
    let step = if draw < 0.5 {
        let rest = 1.0 - (x - low) / extent;
        libm::pow(2.0 * draw + (1.0 - 2.0 * draw) * libm::pow(rest, eta + 1.0), power) - 1.0
    } else {
        let rest = 1.0 - (high - x) / extent;
        1.0 - libm::pow(2.0 * (1.0 - draw) + 2.0 * (draw - 0.5) * libm::pow(rest, eta + 1.0), power)
    };
    (x + step * extent).clamp(low, high)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{integers, key, reals};

    fn variation() -> Variation {
        Variation {
            crossover: 1.0,
            eta_crossover: 20.0,
            mutation: None,
            eta_mutation: 20.0,
            mutants: Some(1.0),
            truncate: false,
        }
    }

    #[test]
    fn children_lie_evenly_around_their_parents_and_within_the_region() {
        let domain = Domain::new(&reals(2));
        let mut random = key(1).sequence();
        let region = vec![(0.1, 0.7), (0.0, 1.0)];
        let (mut sum, mut count, mut outside) = (0.0, 0, 0);
        for _ in 0..20_000 {
            for child in variation().children(&domain, &region, [&[0.2, 0.4], &[0.6, 0.6]], &mut random) {
                assert!(crate::domain::contains(&region, &child), "{child:?}");
                sum += child[1];
                count += 1;
                outside += usize::from(child[1] < 0.4 || child[1] > 0.6);
            }
        }
        let mean = sum / f64::from(count);
        assert!((mean - 0.5).abs() < 0.005, "{mean}");
        // As often between the parents as beyond them, if there is a crossover at all.
        assert!(outside > 5_000 && outside < 30_000, "{outside}");
    }

    #[test]
    fn mutants_of_whole_numbers_go_both_ways() {
        let domain = Domain::new(&integers(1, 100));
        let mut random = key(2).sequence();
        let all: Vec<f64> = (0..20_000)
            .map(|_| variation().mutate(&domain, domain.bounds(), vec![50.0], &mut random)[0])
            .collect();
        let mean = all.iter().sum::<f64>() / all.len() as f64;
        // Cut off instead of rounded, it would be half a step lower.
        assert!((mean - 50.0).abs() < 0.2, "{mean}");
        assert!(all.iter().all(|x| x.fract() == 0.0));
    }
}
