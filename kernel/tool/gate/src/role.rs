//! The two drivers of a gate.

use serde::{Deserialize, Serialize};

/// Which of the two drivers one is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Role {
    /// The one that there was.
    Old,
    /// The one that is to take its place.
    New,
}

impl Role {
    /// As tables have it.
    pub fn text(self) -> &'static str {
        match self {
            Self::Old => "old",
            Self::New => "new",
        }
    }
}
