//! A search strategy that misbehaves.

use pdk_sdk::prelude::*;

use crate::manner::{Manner, describe};

/// Proposes nothing in particular, or misbehaves.
pub struct Misbehaving {
    manner: Manner,
    asked: u64,
    space: Option<Space>,
}

impl Component for Misbehaving {
    fn description() -> Description {
        let description = Description::search("misbehave", "Misbehaves as told");
        describe(description, &["new", "start", "tell", "drop", "ask"], &["too_many", "out_of_range"])
    }

    fn new(config: &Config) -> Result<Self> {
        Ok(Self { manner: Manner::new(config), asked: 0, space: None })
    }
}

impl Misbehaving {
    /// The lowest values of all variables, or values of none.
    fn candidate(&self, id: u64) -> Candidate {
        let lowest = |space: &Space| {
            let positions: Vec<f64> = space.variables.iter().map(|v| v.range.bounds().0).collect();
            space.values(&positions)
        };
        let space = self.space.as_ref().filter(|_| !self.manner.is("out_of_range"));
        Candidate { id, values: space.map(lowest).unwrap_or_default() }
    }
}

impl Search for Misbehaving {
    fn start(&mut self, problem: &Problem, _key: &Key) -> Result<()> {
        self.manner.reach("start");
        self.space = Some(problem.space.clone());
        self.asked = 0;
        Ok(())
    }

    fn ask(&mut self, n: usize) -> Result<Vec<Candidate>> {
        self.manner.reach("ask");
        let n = if self.manner.is("too_many") { n as u64 + 1 } else { n as u64 };
        self.asked += n;
        Ok((self.asked - n..self.asked).map(|id| self.candidate(id)).collect())
    }

    fn tell(&mut self, _results: &[Evaluated]) -> Result<()> {
        self.manner.reach("tell");
        Ok(())
    }
}

impl Drop for Misbehaving {
    fn drop(&mut self) {
        self.manner.reach("drop");
    }
}
