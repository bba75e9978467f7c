//! What the session records, and what is recorded already.

use std::collections::HashSet;

use pdk_loop::protocol::Drive;
use pdk_model::outcome::{Cause, Outcome};
use pdk_model::scenario::ScenarioId;
use pdk_notice::eprintln;
use pdk_record::ledger::Line;
use pdk_record::trace::reader::{self, Owner};
use pdk_sdk::error::{Error, Result};

use crate::submission::{Record, Submission, WaitingSubmission, WrittenOutcome};

/// The record with what the session knows about it.
#[derive(Default)]
pub struct Book {
    /// Where scenarios are recorded, once that is known.
    pub record: Option<Record>,
    /// The scenarios in the order in which they were submitted first.
    order: Vec<ScenarioId>,
    /// Those that were driven, rather than found in the ledger.
    driven: HashSet<ScenarioId>,
    /// Whether there are lines that may not be on the disk yet.
    unsynced: bool,
}

impl Book {
    /// The outcome of a scenario that need not be driven, and whether it was there before the session.
    ///
    /// # Errors
    /// If the ledger cannot be read.
    pub fn look_up(&mut self, id: &ScenarioId) -> Result<Option<(WrittenOutcome, bool)>> {
        let Record { directory, ledger, keep_errors } = self.opened()?;
        let before = !self.driven.contains(id);
        // What failed in an earlier session may go better now.
        let counts = |line: &Line| !before || *keep_errors || line.outcome.cause != Cause::Error;
        let known = ledger.get(id)?.filter(counts);
        let trace = directory.trace(id)?;
        // Nor is a scenario done whose trace is not there or not whole.
        let known = known.filter(|line| {
            !before
                || match reader::check(&trace, Owner::of(line)) {
                    Err(error) => {
                        eprintln!(
                            "pdk: warning: scenario `{}` is driven again: {}",
                            line.name,
                            because(&error)
                        );
                        false
                    }
                    _ => true,
                }
        });
        self.order.push(*id);
        known.map(|line| Ok((WrittenOutcome::new(&line.outcome)?, before))).transpose()
    }

    fn opened(&self) -> Result<&Record> {
        let none = "a scenario was submitted before the record was opened, which is a defect in pdk";
        self.record.as_ref().ok_or_else(|| Error::new(none))
    }

    /// What a worker is to do for a submission.
    ///
    /// # Errors
    /// If no record was opened.
    pub fn drive(&self, submission: &WaitingSubmission) -> Result<Drive> {
        let trace = self.opened()?.directory.trace(&submission.id)?;
        let trace = Some(std::path::absolute(&trace).unwrap_or(trace));
        let Submission { scenario, name, images_every } = submission.read()?;
        Ok(Drive { scenario, name, trace, images_every, skips: None, view: None })
    }

    /// Adds what came of a scenario, which is on the disk after the next [`sync`](Self::sync).
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn add(&mut self, id: ScenarioId, drive: &Drive, outcome: Outcome) -> Result<WrittenOutcome> {
        let Drive { scenario, name, images_every, .. } = drive.clone();
        let line = Line { id, name, scenario, images_every, outcome };
        if let Some(record) = &mut self.record {
            record.ledger.push(&line)?;
            self.unsynced = true;
        }
        self.driven.insert(id);
        WrittenOutcome::new(&line.outcome)
    }

    /// Makes sure that what was added survives a power cut.
    ///
    /// # Errors
    /// If the disk does not take it.
    pub fn sync(&mut self) -> Result<()> {
        match &mut self.record {
            Some(record) if std::mem::take(&mut self.unsynced) => record.ledger.sync(),
            _ => Ok(()),
        }
    }

    /// Puts the ledger into the order in which the scenarios were submitted.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn finish(&mut self) -> Result<()> {
        match &mut self.record {
            Some(record) => record.ledger.finish(&self.order),
            None => Ok(()),
        }
    }
}

/// The reason of an error about a trace, without what the user could do, which is being done.
fn because(error: &Error) -> String {
    error.message().split(';').next().unwrap_or_default().to_owned()
}
