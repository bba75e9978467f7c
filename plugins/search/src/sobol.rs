//! Sobol's sequence: candidates that fill the space more evenly than chance does.

use pdk_sdk::prelude::*;
use pdk_sdk::seed::Random;
use pdk_statistics::point::Point;

use crate::domain::Domain;
use crate::strategy::{Next, Rule};

/// The length of a sequence, after which one with another scrambling follows.
const LENGTH: u64 = 1 << 16;
/// How many points in a row may violate the constraints of the space before the search is over.
const PASSED_OVER: usize = 100_000;

/// See the [module](self).
#[derive(Default)]
pub struct Sobol {
    index: u64,
    scrambling: u32,
}

impl Rule for Sobol {
    fn description() -> Description {
        Description::search(
            "sobol",
            "Sobol's sequence, scrambled: fills the space more evenly than chance does",
        )
        .learns_nothing()
        .source("I. M. Sobol (1967); scrambling: B. Burley, \"Practical hash-based Owen scrambling\" (2020)")
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self::default())
    }

    fn start(&mut self, _problem: &Problem, domain: &Domain) -> Result<()> {
        if domain.len() > sobol_burley::NUM_DIMENSIONS as usize {
            return Err(Error::of(
                ErrorKind::Configuration,
                format!(
                    "Sobol's sequence has at most {} variables, and the space has {}; use `random` or `latin_hypercube`",
                    sobol_burley::NUM_DIMENSIONS,
                    domain.len()
                ),
            ));
        }
        *self = Self::default();
        Ok(())
    }

    fn next(&mut self, domain: &Domain, random: &mut Random, _proposed: usize, _told: &[Point]) -> Next {
        for _ in 0..PASSED_OVER {
            if self.index.is_multiple_of(LENGTH) {
                self.scrambling = random.next_u32();
            }
            let index = (self.index % LENGTH) as u32;
            self.index += 1;
            let share = |i: usize| f64::from(sobol_burley::sample(index, i as u32, self.scrambling));
            let x: Vec<f64> =
                (0..domain.len()).map(|i| domain.at_share(domain.bounds(), i, share(i))).collect();
            if domain.keeps_constraints(&x) {
                return Next::Propose(x);
            }
        }
        Next::End
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::strategy::Strategy;
    use crate::testing::{key, make, problem, reals};

    #[test]
    fn every_quarter_of_a_square_has_a_quarter_of_the_points() {
        let mut sobol: Strategy<Sobol> = make(&[]);
        sobol.start(&problem(reals(2)), &key(1)).unwrap();
        let mut counts = [0; 4];
        for candidate in sobol.ask(256).unwrap() {
            let half = |name: &str| usize::from(candidate.values[name].as_f64().unwrap() >= 0.5);
            counts[2 * half("x0") + half("x1")] += 1;
        }
        assert_eq!(counts, [64; 4]);
    }
}
