//! A search strategy that goes through the values that it is offered.

use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::{Map, Value, json};

/// Proposes the lower end of every range, and the entry of every list whose turn it is.
pub struct Frozen {
    variables: Vec<Value>,
    asked: u64,
    told: u64,
}

impl Component for Frozen {
    fn description() -> Description {
        Description::search("frozen", "Goes through lists in their order")
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self { variables: Vec::new(), asked: 0, told: 0 })
    }
}

impl Frozen {
    fn values(&self) -> Map<String, Value> {
        let value = |variable: &Value| match variable["values"].as_array() {
            Some(list) if !list.is_empty() => list[self.asked as usize % list.len()].clone(),
            _ => variable["min"].clone(),
        };
        let name = |variable: &Value| variable["name"].as_str().unwrap_or_default().to_owned();
        self.variables.iter().map(|variable| (name(variable), value(variable))).collect()
    }
}

impl Search for Frozen {
    fn start(&mut self, problem: &Problem, key: &Key) -> Result<()> {
        if *key == Key::default() {
            return Err(Error::new("it was given no key"));
        }
        let problem = json!(problem);
        self.variables = problem["space"]["variables"].as_array().cloned().unwrap_or_default();
        (self.asked, self.told) = (0, 0);
        Ok(())
    }

    fn ask(&mut self, n: usize) -> Result<Vec<Candidate>> {
        let mut candidates = Vec::new();
        for _ in 0..n {
            candidates.push(Candidate { id: self.asked, values: self.values() });
            self.asked += 1;
        }
        Ok(candidates)
    }

    fn tell(&mut self, results: &[Evaluated]) -> Result<()> {
        self.told += results.len() as u64;
        match self.told > self.asked {
            true => Err(Error::new("it was told more than it asked for")),
            false => Ok(()),
        }
    }
}
