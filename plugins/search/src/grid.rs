//! A full grid: every combination of evenly spaced values.

use pdk_sdk::prelude::*;
use pdk_sdk::seed::Random;
use pdk_statistics::point::Point;

use crate::domain::Domain;
use crate::strategy::{Next, Rule};

/// The default number of values of a variable on the grid.
const STEPS: u64 = 5;
/// More values a variable are a mistake.
const MOST: i64 = 1_000_000;

/// See the [module](self).
pub struct Grid {
    steps: i64,
    /// The positions of each variable on the grid.
    positions: Vec<Vec<f64>>,
    /// The place on the grid of the next candidate: the last variable changes fastest.
    place: Vec<usize>,
    over: bool,
}

impl Rule for Grid {
    fn description() -> Description {
        Description::search("grid", "Every combination of evenly spaced values, both ends of each range included")
            .learns_nothing()
            .parameter(
                Parameter::integer(
                    "steps",
                    0,
                    "values a variable has on the grid, or all it has if these are fewer; 0: as many as the evaluations \
                     of the search allow",
                )
                .range(0.0, MOST as f64),
            )
    }

    fn new(config: &Config) -> Result<Self> {
        Ok(Self { steps: config.integer("steps"), positions: Vec::new(), place: Vec::new(), over: false })
    }

    fn start(&mut self, problem: &Problem, domain: &Domain) -> Result<()> {
        let steps = match (u64::try_from(self.steps).unwrap_or_default(), problem.evaluations) {
            (0, Some(evaluations)) => most_steps(domain, evaluations),
            (0, None) => STEPS,
            (steps, _) => steps,
        };
        self.positions = (0..domain.len()).map(|i| spaced(domain, i, steps)).collect();
        self.place = vec![0; domain.len()];
        self.over = false;
        Ok(())
    }

    fn next(&mut self, domain: &Domain, _random: &mut Random, _proposed: usize, _told: &[Point]) -> Next {
        while !self.over {
            let x: Vec<f64> =
                self.positions.iter().zip(&self.place).map(|(all, place)| all[*place]).collect();
            self.advance();
            if domain.keeps_constraints(&x) {
                return Next::Propose(x);
            }
        }
        Next::End
    }
}

impl Grid {
    fn advance(&mut self) {
        for (place, all) in self.place.iter_mut().zip(&self.positions).rev() {
            *place += 1;
            if *place < all.len() {
                return;
            }
            *place = 0;
        }
        self.over = true;
    }
}

/// The most values a variable can have on a grid of at most this many points; at least 1.
fn most_steps(domain: &Domain, points: u64) -> u64 {
    let size = |steps: u64| {
        (0..domain.len())
            .try_fold(1u64, |size, i| size.checked_mul(count(domain, i, steps)))
            .unwrap_or(u64::MAX)
    };
    let (mut low, mut high) = (1, points.clamp(1, MOST as u64));
    while low < high {
        let middle = low + (high - low).div_ceil(2);
        if size(middle) <= points { low = middle } else { high = middle - 1 }
    }
    low
}

fn count(domain: &Domain, variable: usize, steps: u64) -> u64 {
    domain.space().variables[variable].range.size().map_or(steps, |size| size.min(steps))
}

/// Positions from one end of a variable's range to the other; its middle if there is only one.
fn spaced(domain: &Domain, variable: usize, steps: u64) -> Vec<f64> {
    let (low, high) = domain.bounds()[variable];
    let count = count(domain, variable, steps);
    let position = |step: u64| match count {
        1 => low + (high - low) / 2.0,
        _ => low + (high - low) * (step as f64 / (count - 1) as f64),
    };
    let settle = |position: f64| if domain.is_discrete(variable) { libm::round(position) } else { position };
    (0..count).map(|step| settle(position(step))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::strategy::Strategy;
    use crate::testing::{integers, key, make, reals};

    fn all(space: Space, evaluations: Option<u64>, steps: i64) -> Vec<Vec<f64>> {
        let mut grid: Strategy<Grid> = make(&[("steps", steps.into())]);
        let problem = Problem { space: space.clone(), objectives: vec!["f".into()], evaluations };
        grid.start(&problem, &key(0)).unwrap();
        grid.ask(10_000).unwrap().iter().map(|c| space.positions(&c.values).unwrap()).collect()
    }

    #[test]
    fn a_grid_has_every_combination_once_and_both_ends() {
        let grid = all(reals(2), None, 3);
        let axis = [0.0, 0.5, 1.0];
        let expected: Vec<Vec<f64>> = axis.iter().flat_map(|a| axis.iter().map(|b| vec![*a, *b])).collect();
        assert_eq!(grid, expected);
        assert_eq!(all(integers(1, 3), None, 9), [[0.0], [1.0], [2.0], [3.0]]);
        assert_eq!(all(integers(1, 8), None, 3), [[0.0], [4.0], [8.0]]);
    }

    #[test]
    fn a_grid_is_as_fine_as_the_evaluations_allow() {
        assert_eq!(all(reals(3), Some(130), 0).len(), 125);
        assert_eq!(all(integers(2, 3), Some(1000), 0).len(), 16);
        assert_eq!(all(reals(3), Some(1), 0), [[0.5, 0.5, 0.5]]);
    }
}
