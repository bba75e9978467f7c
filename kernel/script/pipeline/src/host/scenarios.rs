//! The scenarios of a run: what was submitted, and what came of it.

use std::collections::{BTreeMap, BTreeSet};

use pdk_model::outcome::{Verdict, failing_unperturbed};
use pdk_model::scenario::ScenarioId;
use pdk_sdk::error::Result;
use pdk_session::session::{Ticket, WrittenOutcome};

use crate::outcomes::Submitted;

/// What came of a scenario.
pub(super) struct Came {
    /// The outcome.
    pub outcome: WrittenOutcome,
    /// What a component failed with.
    pub error: Option<String>,
}

/// All scenarios by their tickets.
#[derive(Default)]
pub(super) struct Scenarios {
    /// What was submitted under each ticket.
    pub submitted: BTreeMap<Ticket, Submitted>,
    /// What came of it, as far as anybody has taken it; nothing if another part of the run drives it.
    pub outcomes: BTreeMap<Ticket, Result<Option<Came>>>,
    /// The numbers of the scenarios, in the order in which they were submitted first, which is that of the ledger in the end.
    numbers: BTreeMap<ScenarioId, usize>,
    /// The numbers of those whose outcomes a program was handed, which knows from them what failed.
    handed_over: BTreeSet<usize>,
    /// The numbers of those whose outcomes were in the ledger already.
    pub kept: BTreeSet<usize>,
}

impl Scenarios {
    /// The number of a scenario, which is a new one if it is submitted for the first time.
    pub fn number(&mut self, id: ScenarioId) -> usize {
        let count = self.numbers.len();
        *self.numbers.entry(id).or_insert(count)
    }

    /// How many there are. A scenario that was asked for several times is one.
    pub fn count(&self) -> usize {
        self.numbers.len()
    }

    /// Whether all outcomes have been taken.
    pub fn are_over(&self) -> bool {
        self.outcomes.len() == self.submitted.len()
    }

    /// The tickets whose outcomes have not been taken.
    pub fn rest(&self) -> BTreeSet<Ticket> {
        self.submitted.keys().filter(|ticket| !self.outcomes.contains_key(ticket)).copied().collect()
    }

    /// Notes that the program which submitted a scenario got its outcome, so that its failure is not a failure of the run.
    pub fn hand_over(&mut self, ticket: Ticket) {
        self.handed_over.extend(self.submitted.get(&ticket).map(|submitted| submitted.number));
    }

    /// The ids in the order of submission.
    pub fn ids(&self) -> Vec<ScenarioId> {
        let mut all: Vec<(&usize, &ScenarioId)> =
            self.numbers.iter().map(|(id, number)| (number, id)).collect();
        all.sort_unstable();
        all.into_iter().map(|(_, id)| *id).collect()
    }

    /// Those that were driven here, and what came of each.
    pub fn own(&self) -> impl Iterator<Item = (&Submitted, &Came)> {
        self.outcomes.iter().filter_map(|(ticket, came)| match came {
            Ok(Some(came)) => Some((self.submitted.get(ticket)?, came)),
            _ => None,
        })
    }

    /// A sentence for each driver that fails without perturbation in one of these scenarios, if others of them are perturbed.
    ///
    /// # Errors
    /// If an outcome cannot be read.
    pub fn failing_unperturbed(&self, ids: &BTreeSet<&str>) -> Result<Vec<String>> {
        let shown = || self.own().filter(|(submitted, _)| ids.contains(&*submitted.id.to_string()));
        if shown().all(|(submitted, _)| submitted.unperturbed.is_some()) {
            return Ok(Vec::new());
        }
        let mut drivers: BTreeMap<&str, BTreeMap<ScenarioId, Verdict>> = BTreeMap::new();
        for (submitted, came) in shown() {
            let Some(driver) = &submitted.unperturbed else { continue };
            drivers.entry(driver).or_default().insert(submitted.id, came.outcome.read()?.cause.verdict());
        }
        let sentence = |(driver, drives): (&str, BTreeMap<_, _>)| {
            failing_unperturbed(&format!("Driver `{driver}`"), drives.into_values())
        };
        Ok(drivers.into_iter().filter_map(sentence).collect())
    }

    /// The scenarios in which a component failed, in the order of submission, each once, without those whose outcomes were
    /// handed to the program.
    pub fn failed(&self) -> Vec<String> {
        let mut failed = BTreeMap::new();
        for (Submitted { number, name, .. }, came) in self.own() {
            if let Some(error) = came.error.as_ref().filter(|_| !self.handed_over.contains(number)) {
                failed.entry(*number).or_insert_with(|| format!("scenario {number} `{name}`: {error}"));
            }
        }
        failed.into_values().collect()
    }
}
