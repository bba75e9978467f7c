//! A search strategy that misbehaves.

use pdk_sdk::prelude::*;

use crate::manner::{Manner, describe};

/// Proposes nothing in particular, or misbehaves.
pub struct Misbehaving {
    manner: Manner,
    asked: u64,
}

impl Component for Misbehaving {
    fn description() -> Description {
        let description = Description::search("misbehave", "Misbehaves as told");
        describe(description, &["new", "start", "tell", "drop", "ask"], &["too_many"])
    }

    fn new(config: &Config) -> Result<Self> {
        Ok(Self { manner: Manner::new(config), asked: 0 })
    }
}

impl Search for Misbehaving {
    fn start(&mut self, _problem: &Problem, _key: &Key) -> Result<()> {
        self.manner.reach("start");
        self.asked = 0;
        Ok(())
    }

    fn ask(&mut self, n: usize) -> Result<Vec<Candidate>> {
        self.manner.reach("ask");
        let n = if self.manner.is("too_many") { n as u64 + 1 } else { n as u64 };
        self.asked += n;
        Ok((self.asked - n..self.asked).map(|id| Candidate { id, values: Default::default() }).collect())
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
