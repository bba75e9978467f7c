//! Latin hypercubes: in every variable, each of equally many parts has one candidate.

use pdk_sdk::prelude::*;
use pdk_sdk::seed::Random;
use pdk_statistics::point::Point;

use crate::domain::Domain;
use crate::strategy::{Next, Rule};

/// Points a hypercube has where neither the user nor the search says.
const SAMPLES: u64 = 100;
/// The largest hypercube.
const MOST: u64 = 1_000_000;
/// How many hypercubes in a row may violate the constraints of the space throughout before the search is over.
const PASSED_OVER: usize = 100;

/// See the [module](self).
pub struct LatinHypercube {
    samples: u64,
    /// The rest of the current hypercube, the next one last.
    rest: Vec<Vec<f64>>,
}

impl Rule for LatinHypercube {
    fn description() -> Description {
        Description::search(
            "latin_hypercube",
            "Latin hypercubes: in every variable, each of equally many parts has one candidate",
        )
        .learns_nothing()
        .source("M. D. McKay, R. J. Beckman, W. J. Conover (1979)")
        .parameter(
            Parameter::integer(
                "samples",
                0,
                "candidates in a hypercube, after which another follows; 0: as many as the evaluations of the search",
            )
            .range(0.0, MOST as f64),
        )
    }

    fn new(config: &Config) -> Result<Self> {
        Ok(Self { samples: u64::try_from(config.integer("samples")).unwrap_or_default(), rest: Vec::new() })
    }

    fn start(&mut self, problem: &Problem, _domain: &Domain) -> Result<()> {
        if self.samples == 0 {
            self.samples = problem.evaluations.unwrap_or(SAMPLES).clamp(1, MOST);
        }
        self.rest.clear();
        Ok(())
    }

    fn next(&mut self, domain: &Domain, random: &mut Random, _proposed: usize, _told: &[Point]) -> Next {
        for _ in 0..PASSED_OVER {
            while let Some(x) = self.rest.pop() {
                if domain.keeps_constraints(&x) {
                    return Next::Propose(x);
                }
            }
            self.rest = domain.latin_hypercube(domain.bounds(), self.samples as usize, random);
        }
        Next::End
    }
}
