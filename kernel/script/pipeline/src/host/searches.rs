//! The searches of a run, and one that was begun.

use std::collections::BTreeSet;

use pdk_session::session::Session;

/// The searches of a run.
#[derive(Default)]
pub(super) struct Searches {
    /// How many were begun.
    pub begun: u64,
    /// The names of those that were begun.
    pub names: BTreeSet<String>,
    /// The session of the process of a strategy, between two searches.
    pub strategist: Option<Session>,
}

/// A search that was begun.
pub(crate) struct BegunSearch {
    /// What it is called.
    pub name: String,
    /// The number of the search in its run, from 0.
    pub number: u64,
    /// The seed of the run.
    pub seed: u64,
    /// How many scenarios are driven at the same time.
    pub slots: usize,
    /// Whether the strategy learns nothing.
    pub baseline: bool,
    /// The session of the strategy, if it is a component.
    pub session: Option<Session>,
}
