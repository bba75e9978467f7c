//! Runs in parts: each part drives its share of the scenarios and evaluates its share of the frames, on a machine of its own, and the
//! records of all parts are put together into that of the whole.

use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Serialize};

use crate::error::{Error, ErrorKind, Result};
use crate::scenario::ScenarioId;

/// The most parts that a run may have.
const MOST: usize = 100_000;

/// A part of a run: every `of`-th scenario, and every `of`-th frame of an evaluation.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub struct Shard {
    /// Which part it is, from 1.
    pub index: usize,
    /// How many parts there are.
    pub of: usize,
}

/// What the record of a part says of the whole, once the part has come to its end.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ShardList {
    /// The part.
    pub shard: Shard,
    /// All scenarios of the run in the order of submission.
    pub scenarios: Vec<ScenarioId>,
    /// All evaluations of the run in their order.
    pub evaluations: Vec<EvaluatedFrames>,
}

/// What an evaluation of the whole run goes through.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct EvaluatedFrames {
    /// How many frames it has.
    pub frames: usize,
    /// The perturbations at their levels.
    pub cells: Vec<String>,
}

impl Shard {
    /// Whether a scenario belongs to the part, by its number in the run, from 0; or a frame, by its number in the evaluation.
    pub fn has(&self, number: usize) -> bool {
        number % self.of == self.index - 1
    }

    /// Those of this many scenarios or frames that belong to the part.
    pub fn own(self, all: usize) -> impl Iterator<Item = usize> {
        (self.index - 1..all).step_by(self.of)
    }
}

impl fmt::Display for Shard {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}/{}", self.index, self.of)
    }
}

impl FromStr for Shard {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        let parsed =
            text.split_once('/').and_then(|(index, of)| Some((index.parse().ok()?, of.parse().ok()?)));
        match parsed {
            Some((index, of)) if (1..=of).contains(&index) && of <= MOST => Ok(Self { index, of }),
            _ => Err(Error::of(
                ErrorKind::Configuration,
                format!(
                    "`{text}` is not a part of a run; write 1/8 to 8/8 for eight parts ({MOST} parts at most)"
                ),
            )),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_scenario_belongs_to_one_part() {
        let parts: Vec<Shard> = (1..=4).map(|index| format!("{index}/4").parse().unwrap()).collect();
        for number in 0..40 {
            assert_eq!(parts.iter().filter(|part| part.has(number)).count(), 1);
        }
        for part in parts {
            assert!(part.own(40).eq((0..40).filter(|number| part.has(*number))));
            assert_eq!(part.own(0).count(), 0);
        }
        for wrong in ["", "1", "0/4", "5/4", "1/0", "a/b", "1/4/4", "-1/4", "1/1000000"] {
            let error = wrong.parse::<Shard>().unwrap_err();
            assert!(error.message().contains("is not a part of a run"), "{wrong}");
        }
    }
}
