//! Descent: gradients lead to a failure, and along the border of the failures to one that costs least.
//!
//! One objective leads to failures; the sum of the others is what a failure costs, such as the levels that it takes. From the best of a few candidates that are
//! drawn, the first objective is followed downwards until a candidate is critical. From there on the search stays at the border between what is
//! critical and what is not. At a place just outside, a candidate beside it in each variable gives both gradients. With these, the cheapest step that stays
//! critical is a linear programme with bounds and one constraint, which is a fractional knapsack. It is solved for some reaches and margins, since
//! nothing is quite linear, and the cheapest critical candidate among these is next (sequential linear programming: R. E. Griffith, R. A. Stewart, 1961; in
//! the analysis of reliability, the place that it leads to is the design point: A. M. Hasofer, N. C. Lind, 1974). Once that leads nowhere, the other
//! values of variables without an order are tried. If they lead nowhere either, all begins anew elsewhere.

use std::collections::VecDeque;

use pdk_sdk::prelude::*;
use pdk_sdk::seed::Random;
use pdk_statistics::point::Point;

use crate::border::{Basis, Run, Unknown};
use crate::domain::Domain;
use crate::strategy::{Next, Rule};

/// Objectives that lead to failures in drives.
const MEASURES: [&str; 4] =
    ["max_cross_track_error", "mean_cross_track_error", "time_to_failure", "criticality"];
/// Candidates that are drawn, of which the best is where a descent begins. They are twice as many after each descent that led to no failure, up to a limit.
const DRAWN: usize = 8;
const MOST_DRAWN: usize = 256;
/// How much a step has to gain, as a share of the differences between all candidates so far.
const GAIN: f64 = 0.005;
/// After this many descents in a row that led to nothing new, the space is exhausted.
const EXHAUSTED: usize = 1000;

/// See the [module](self).
pub struct Descent {
    towards: String,
    basis: Basis,
    /// How many results it knows.
    read: usize,
    /// How many candidates are drawn for a start.
    drawn: usize,
    /// Whether the gain of this descent is still to be computed, once the results of its starts are known.
    gain_is_open: bool,
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
            basis: Basis::new(config.number("step"), config.number("reach")),
            read: 0,
            drawn: DRAWN,
            gain_is_open: false,
            fruitless: 0,
            rest: VecDeque::new(),
        })
    }

    fn start(&mut self, problem: &Problem, _domain: &Domain) -> Result<()> {
        let names = &problem.objectives;
        let list = || names.join(", ");
        let main = match self.towards.as_str() {
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
        self.basis = Basis::new(self.basis.step, self.basis.reach);
        self.basis.main = main;
        (self.read, self.drawn, self.gain_is_open) = (0, DRAWN, false);
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
                self.basis.know(point, number);
            }
            self.read = told.len();
            if self.gain_is_open {
                // Once for all of a descent, which has to come out the same when it is replayed.
                self.basis.gain = self.basis.ranges(told).map(|range| GAIN * range);
                self.gain_is_open = false;
            }
            if self.basis.starts.is_empty() {
                let spread = domain.latin_hypercube(domain.bounds(), self.drawn, random);
                let drawn = spread.into_iter().map(|x| match domain.keeps_constraints(&x) {
                    true => x,
                    false => domain.draw(domain.bounds(), random),
                });
                self.basis.starts = drawn.map(|x| domain.shares(&x)).collect();
                self.gain_is_open = true;
            }
            let mut run = Run::new(&self.basis, domain, told);
            match run.descend() {
                Err(Unknown(candidates)) => {
                    self.fruitless = 0;
                    self.rest = candidates.into();
                }
                Ok(()) if self.fruitless == EXHAUSTED => return Next::End,
                Ok(()) => {
                    self.drawn = if run.best.is_some() { DRAWN } else { (2 * self.drawn).min(MOST_DRAWN) };
                    self.fruitless += 1;
                    self.basis.starts.clear();
                }
            }
        }
        self.rest.pop_front().map_or(Next::End, Next::Propose)
    }
}

#[cfg(test)]
#[path = "descent_tests.rs"]
mod tests;
