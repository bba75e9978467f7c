//! What a pipeline got back.

use std::sync::Arc;

use pdk_record::ledger::Line;
use serde::ser::{Serialize, SerializeStruct, Serializer};
use serde_json::Value;

use super::driving::outcome_row;
use super::scenarios::Submitted;

/// The table at the end of a run. A scenario that was submitted often has many rows, so they are made one by one while it is written.
#[derive(Debug, Clone)]
pub struct Summary {
    pub(super) outcomes: Vec<(Submitted, Arc<Line>)>,
    pub(super) evaluations: Vec<Value>,
}

impl Serialize for Summary {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut table = serializer.serialize_struct("Summary", 2)?;
        table.serialize_field("outcomes", &Rows(&self.outcomes))?;
        table.serialize_field("evaluations", &self.evaluations)?;
        table.end()
    }
}

struct Rows<'a>(&'a [(Submitted, Arc<Line>)]);

impl Serialize for Rows<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.0.iter().map(|(submitted, line)| outcome_row(line, submitted)))
    }
}
