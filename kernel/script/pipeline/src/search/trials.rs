//! The candidates of a search so far: which are new, which wait for their results, and which the strategy has yet to hear of.

use std::collections::HashMap;

use pdk_model::search::{Candidate, Evaluated, Problem};
use pdk_sdk::error::{Error, ErrorKind, Result};
use pdk_session::session::Ticket;
use serde_json::{Map, Value};

use crate::search::verdict::Verdict;

/// A candidate.
pub struct Trial {
    /// A value for each variable.
    pub values: Map<String, Value>,
    /// Their positions; none if a value is out of its range.
    pub positions: Option<Vec<f64>>,
    /// The earlier candidate that is the same.
    pub same_as: Option<usize>,
    /// Whether it counts as an evaluation.
    pub counted: bool,
    /// What became of it.
    pub state: State,
}

/// What became of a candidate.
pub enum State {
    /// Its scenario is under way.
    Waits(Ticket),
    /// It was evaluated, or could not be.
    Done(Verdict),
    /// It is what an earlier one is.
    Same(usize),
}

/// The candidates of a search, in their order.
pub struct Trials {
    problem: Problem,
    maximised: Vec<bool>,
    all: Vec<Trial>,
    /// The first candidate with these values, and the first with this scenario.
    known: HashMap<String, usize>,
    /// How many have been told.
    told: usize,
    /// How many evaluations were begun, those that are still under way among them.
    pub evaluations: u64,
    /// How many in a row brought no evaluation.
    pub idle: u64,
}

/// What is to be done with a candidate.
pub enum Admitted {
    /// It has to be evaluated.
    New,
    /// All is known.
    Known,
}

impl Trials {
    /// No candidates yet.
    pub fn new(problem: Problem, maximised: Vec<bool>) -> Self {
        Self { problem, maximised, all: Vec::new(), known: HashMap::new(), told: 0, evaluations: 0, idle: 0 }
    }

    /// All of them.
    pub fn all(&self) -> &[Trial] {
        &self.all
    }

    /// How many have been proposed and not told.
    pub fn open(&self) -> usize {
        self.all.len() - self.told
    }

    /// How many have been told.
    pub fn told(&self) -> usize {
        self.told
    }

    /// Takes a candidate in; what is new still has to be [completed](Self::complete).
    ///
    /// # Errors
    /// If it is not the next one.
    pub fn admit(&mut self, candidate: Candidate) -> Result<Admitted> {
        let number = self.all.len();
        if candidate.id != number as u64 {
            return Err(Error::of(
                ErrorKind::Nonsense,
                format!("the strategy proposes candidate {} where {number} is next", candidate.id),
            ));
        }
        self.idle += 1;
        let mut trial = Trial {
            values: candidate.values,
            positions: None,
            same_as: None,
            counted: false,
            state: State::Done(Verdict::default()),
        };
        let positions = match self.problem.space.positions(&trial.values) {
            Ok(positions) => positions,
            Err(error) => {
                trial.state = State::Done(Verdict::failed(format!("out of range: {error}")));
                self.all.push(trial);
                return Ok(Admitted::Known);
            }
        };
        // Equal positions are equal values, however these are written.
        let key = format!("{positions:?}");
        if let Some(&first) = self.known.get(&key) {
            trial.positions = Some(positions);
            trial.same_as = Some(first);
            trial.state = State::Same(first);
            self.all.push(trial);
            return Ok(Admitted::Known);
        }
        self.known.insert(key, number);
        let violations = self.problem.space.violations(&positions);
        trial.positions = Some(positions);
        self.all.push(trial);
        if violations.iter().any(|violation| *violation > 0.0) {
            self.complete(State::Done(Verdict { violations, ..Verdict::default() }));
            return Ok(Admitted::Known);
        }
        Ok(Admitted::New)
    }

    /// Says what becomes of the candidate that was admitted last.
    pub fn complete(&mut self, state: State) {
        if let Some(trial) = self.all.last_mut() {
            trial.state = state;
        }
    }

    /// Counts the candidate that was admitted last as evaluated; `scenario` is the id of its scenario. An earlier candidate with
    /// the same scenario makes it a duplicate: then that is returned.
    pub fn count(&mut self, scenario: Option<&str>) -> Option<usize> {
        let number = self.all.len() - 1;
        if let Some(id) = scenario {
            let first = *self.known.entry(format!("scenario {id}")).or_insert(number);
            if first != number {
                if let Some(trial) = self.all.last_mut() {
                    trial.same_as = Some(first);
                    trial.state = State::Same(first);
                }
                return Some(first);
            }
        }
        if let Some(trial) = self.all.last_mut() {
            trial.counted = true;
        }
        self.evaluations += 1;
        self.idle = 0;
        None
    }

    /// The first candidate that has not been told, where it waits for a scenario.
    pub fn waits_for(&self) -> Option<Ticket> {
        match self.all.get(self.told)?.state {
            State::Waits(ticket) => Some(ticket),
            _ => None,
        }
    }

    /// Says what became of the first candidate that has not been told.
    pub fn settle(&mut self, verdict: Verdict) {
        if let Some(trial) = self.all.get_mut(self.told) {
            trial.state = State::Done(verdict);
        }
    }

    /// What became of a candidate; none if it waits.
    pub fn verdict(&self, number: usize) -> Option<&Verdict> {
        match &self.all.get(number)?.state {
            State::Done(verdict) => Some(verdict),
            State::Same(first) => self.verdict(*first),
            State::Waits(_) => None,
        }
    }

    /// The next result to tell; none if it is not known.
    pub fn tell(&mut self) -> Option<Evaluated> {
        let verdict = self.verdict(self.told)?;
        let result = Evaluated {
            id: self.told as u64,
            objectives: verdict
                .objectives
                .as_deref()
                .map(|values| self.minimised(values))
                .unwrap_or_default(),
            violations: verdict.violations.clone(),
            critical: verdict.critical,
            failure: verdict.failure.clone(),
        };
        self.told += 1;
        Some(result)
    }

    /// Objectives as strategies see them: smaller is better.
    pub fn minimised(&self, values: &[f64]) -> Vec<f64> {
        let turned = values.iter().zip(&self.maximised);
        turned.map(|(value, maximised)| if *maximised { -value } else { *value }).collect()
    }

    /// Whether every candidate of the space has been proposed.
    pub fn is_exhausted(&self) -> bool {
        let proposed = self
            .all
            .iter()
            .filter(|trial| !matches!(trial.state, State::Same(_)) && trial.positions.is_some());
        self.problem
            .space
            .size()
            .is_some_and(|size| size <= self.all.len() as u64 && size <= proposed.count() as u64)
    }
}
