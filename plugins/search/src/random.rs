//! Random search: every candidate is drawn evenly from the space.

use pdk_sdk::prelude::*;
use pdk_sdk::seed::Random;
use pdk_statistics::point::Point;

use crate::domain::Domain;
use crate::strategy::{Next, Rule};

/// See the [module](self).
pub struct RandomSearch;

impl Rule for RandomSearch {
    fn description() -> Description {
        Description::search("random", "Draws every candidate evenly from the space")
            .learns_nothing()
            .baseline()
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }

    fn start(&mut self, _problem: &Problem, _domain: &Domain) -> Result<()> {
        Ok(())
    }

    fn next(&mut self, domain: &Domain, random: &mut Random, _proposed: usize, _told: &[Point]) -> Next {
        Next::Propose(domain.draw(domain.bounds(), random))
    }
}
