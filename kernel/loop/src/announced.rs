//! What a loop announces of its scenario on its topics, for those who watch it.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

/// A scenario that is being driven.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Announced {
    /// The number that its messages carry ([`pdk_bus::FrameHeader::scenario`]).
    pub number: u64,
    /// What it is called.
    pub name: String,
    /// Where its trace is being written: the record is the folder above that of the trace.
    pub trace: PathBuf,
    /// The centre line of the driven lane as `x,height,z@x,height,z@...`; empty if the simulator does not report it.
    pub road: String,
}
