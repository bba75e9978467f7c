//! What a run came to.

use std::path::PathBuf;

use pdk_sdk::error::Error;
use pdk_session::session::WrittenOutcome;
use serde::ser::{Error as _, Serialize, SerializeSeq, SerializeStruct, Serializer};
use serde_json::Value;

use crate::outcomes::{Submitted, outcome_row};

/// What a run came to.
#[derive(Debug, Clone)]
pub struct Finished {
    /// The folder of the record; none if the pipeline neither drove nor evaluated.
    pub record: Option<PathBuf>,
    /// The table at the end; in a part of a run, what belongs to the part.
    pub summary: Summary,
    /// How fast it went, a line each, for people.
    pub speed: Vec<String>,
    /// What did not go well without ending the run, one sentence each.
    pub warnings: Vec<String>,
    /// Why the run counts as failed: an error of the script, or one that did not end it.
    pub failure: Option<Error>,
}

/// The table at the end of a run. A scenario that was submitted often has many rows, so they are made one by one while it is written.
#[derive(Debug, Clone)]
pub struct Summary {
    pub(crate) outcomes: Vec<(Submitted, WrittenOutcome)>,
    pub(crate) evaluations: Vec<Value>,
}

impl Serialize for Summary {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut table = serializer.serialize_struct("Summary", 2)?;
        table.serialize_field("outcomes", &Rows(&self.outcomes))?;
        table.serialize_field("evaluations", &self.evaluations)?;
        table.end()
    }
}

struct Rows<'a>(&'a [(Submitted, WrittenOutcome)]);

impl Serialize for Rows<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut rows = serializer.serialize_seq(Some(self.0.len()))?;
        for (submitted, outcome) in self.0 {
            let outcome = outcome.read().map_err(S::Error::custom)?;
            rows.serialize_element(&outcome_row(&outcome, submitted))?;
        }
        rows.end()
    }
}
