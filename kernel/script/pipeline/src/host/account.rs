//! What there is to say at the end of a run.

use std::time::SystemTime;

/// What is reported to the user at the end.
pub(super) struct Account {
    /// How fast it went, a line each, for people.
    pub speed: Vec<String>,
    /// What did not go well without ending the run, one sentence each.
    pub warnings: Vec<String>,
    /// When the run began.
    pub started: SystemTime,
}

impl Account {
    /// That of a run that begins now.
    pub fn new() -> Self {
        Self { speed: Vec::new(), warnings: Vec::new(), started: SystemTime::now() }
    }
}
