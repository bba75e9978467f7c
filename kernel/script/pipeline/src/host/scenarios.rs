//! The scenarios of a run: what was submitted, and what came of it.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;

use pdk_model::outcome::{Cause, Verdict};
use pdk_model::scenario::ScenarioId;
use pdk_record::ledger::Line;
use pdk_sdk::error::Result;
use pdk_session::session::Ticket;

use crate::outcomes::Submitted;

/// All scenarios by their tickets.
#[derive(Default)]
pub(super) struct Scenarios {
    /// What was submitted under each ticket.
    pub submitted: BTreeMap<Ticket, Submitted>,
    /// What came of it, as far as anybody has taken it; nothing if another part of the run drives it.
    pub outcomes: BTreeMap<Ticket, Result<Option<Arc<Line>>>>,
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

    /// The lines of those that were driven here, with what was submitted.
    pub fn lines(&self) -> Vec<(Submitted, Arc<Line>)> {
        let own = |(ticket, outcome): (&Ticket, &Result<Option<Arc<Line>>>)| match outcome {
            Ok(Some(line)) => Some((self.submitted.get(ticket)?.clone(), Arc::clone(line))),
            _ => None,
        };
        self.outcomes.iter().filter_map(own).collect()
    }

    /// A sentence for each driver that fails without perturbation in one of these scenarios, if others of them are perturbed.
    pub fn failing_unperturbed(&self, ids: &BTreeSet<&str>) -> Vec<String> {
        let lines = self.lines();
        let shown = || lines.iter().map(|(_, line)| line).filter(|line| ids.contains(&*line.id.to_string()));
        if !shown().any(|line| !line.scenario.perturbations.is_empty()) {
            return Vec::new();
        }
        let mut drivers: BTreeMap<&str, BTreeMap<ScenarioId, bool>> = BTreeMap::new();
        for line in shown().filter(|line| line.scenario.perturbations.is_empty()) {
            let verdict = line.outcome.cause.verdict();
            if verdict != Verdict::Void {
                drivers.entry(&line.scenario.driver.name).or_default().insert(line.id, verdict.failed());
            }
        }
        let sentence = |(driver, drives): (&str, BTreeMap<ScenarioId, bool>)| {
            let failed = drives.values().filter(|failed| **failed).count();
            let drives = match drives.len() {
                1 => "its only drive".to_owned(),
                all => format!("{failed} of {all} drives"),
            };
            (failed > 0).then(|| {
                format!(
                    "Driver `{driver}` fails {drives} without any perturbation, so its failures under perturbations say little about these."
                )
            })
        };
        drivers.into_iter().filter_map(sentence).collect()
    }

    /// The scenarios in which a component failed, in the order of submission, each once, without those whose outcomes were
    /// handed to the program.
    pub fn failed(&self) -> Vec<String> {
        let mut failed = BTreeMap::new();
        for (ticket, line) in &self.outcomes {
            if let (Ok(Some(line)), Some(Submitted { number, name, .. })) = (line, self.submitted.get(ticket))
                && line.outcome.cause == Cause::Error
                && !self.handed_over.contains(number)
                && let Some(error) = &line.outcome.error
            {
                failed.entry(*number).or_insert_with(|| format!("scenario {number} `{name}`: {error}"));
            }
        }
        failed.into_values().collect()
    }
}
