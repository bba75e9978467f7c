//! What the session records, and what is recorded already.

use std::collections::HashSet;
use std::path::PathBuf;

use pdk_model::outcome::{Cause, Outcome};
use pdk_model::scenario::ScenarioId;
use pdk_notice::eprintln;
use pdk_record::ledger::Line;
use pdk_record::trace::reader::{self, Owner};
use pdk_sdk::error::{Error, Result};

use crate::submission::{Record, Submission};

/// The record with what the session knows about it.
#[derive(Default)]
pub struct Book {
    /// Where scenarios are recorded, once that is known.
    pub record: Option<Record>,
    /// The scenarios in the order in which they were submitted first.
    order: Vec<ScenarioId>,
    /// Those that were driven, rather than found in the ledger.
    driven: HashSet<ScenarioId>,
}

impl Book {
    /// The line of a scenario that need not be driven, and whether it was there before the session; and the file of its trace.
    ///
    /// # Errors
    /// If the ledger cannot be read.
    pub fn look_up(&mut self, id: &ScenarioId) -> Result<(Option<(Line, bool)>, PathBuf)> {
        let Some(Record { directory, ledger, keep_errors }) = &self.record else {
            return Err(Error::new(
                "a scenario was submitted before the record was opened, which is a defect in pdk",
            ));
        };
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
        Ok((known.map(|line| (line, before)), trace))
    }

    /// Adds what came of a scenario, and returns its line.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn add(&mut self, submission: &Submission, outcome: Outcome) -> Result<Line> {
        let Submission { scenario, name, images_every } = submission.clone();
        let line = Line { id: scenario.id(), name, scenario, images_every, outcome };
        if let Some(record) = &mut self.record {
            record.ledger.add(&line)?;
        }
        self.driven.insert(line.id);
        Ok(line)
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
