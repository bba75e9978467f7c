//! The scenarios of a run: what was submitted, and what came of it.

use std::collections::{BTreeMap, BTreeSet};

use pdk_model::outcome::Verdict;
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
            let verdict = came.outcome.read()?.cause.verdict();
            if verdict != Verdict::Void {
                drivers.entry(driver).or_default().insert(submitted.id, verdict);
            }
        }
        let sentence = |(driver, drives): (&str, BTreeMap<_, _>)| {
            failing(driver, &drives.into_values().collect::<Vec<_>>())
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

/// The sentence about a driver whose drives without perturbation came out like this; none if it does not fail.
fn failing(driver: &str, drives: &[Verdict]) -> Option<String> {
    let failed = drives.iter().filter(|verdict| verdict.failed()).count();
    let late = drives.iter().filter(|verdict| **verdict == Verdict::Late).count();
    let of = match drives.len() {
        1 => "its only drive".to_owned(),
        all => format!("{failed} of {all} drives"),
    };
    let fails = match late {
        _ if failed == 0 => return None,
        0 => format!("fails {of} without any perturbation"),
        late if late == failed => format!("runs out of time in {of} without any perturbation"),
        late => format!("fails {of} without any perturbation, {late} of them because the time ran out"),
    };
    let remedy = if late > 0 { "; raise `duration`" } else { "" };
    Some(format!(
        "Driver `{driver}` {fails}, so its failures under perturbations say little about these{remedy}."
    ))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_driver_that_runs_out_of_time_is_not_called_bad() {
        use Verdict::{Late, Passed, Unsafe};
        assert_eq!(failing("x", &[Passed, Passed]), None);
        let sentence = |drives: &[Verdict]| failing("x", drives).unwrap();
        assert_eq!(
            sentence(&[Unsafe]),
            "Driver `x` fails its only drive without any perturbation, so its failures under perturbations say little about these."
        );
        assert_eq!(
            sentence(&[Late, Passed]),
            "Driver `x` runs out of time in 1 of 2 drives without any perturbation, so its failures under perturbations say little about \
             these; raise `duration`."
        );
        assert!(sentence(&[Late, Unsafe]).starts_with(
            "Driver `x` fails 2 of 2 drives without any perturbation, 1 of them because the time ran out, so"
        ));
    }
}
