//! Search strategies: components that propose scenarios and learn from outcomes.

use pdk_ops::Key;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::error::Result;

/// Proposes scenarios and learns from their outcomes, by ask and tell.
///
/// What it proposes depends on the problem, the key, the parameters and what it was told alone: the same search takes the same
/// course again, whatever clock and machine.
pub trait Search: Send {
    /// Begins a search. It is called before anything else, once for each search; all random numbers come from
    /// the key.
    ///
    /// # Errors
    /// Where the strategy cannot search for such a thing.
    fn start(&mut self, problem: &Problem, key: &Key) -> Result<()>;

    /// Proposes up to `n` candidates; none where the search is over.
    ///
    /// # Errors
    /// Where the strategy cannot propose.
    fn ask(&mut self, n: usize) -> Result<Vec<Candidate>>;

    /// Learns how candidates did.
    ///
    /// # Errors
    /// Where a result is not one of a candidate that was asked for.
    fn tell(&mut self, results: &[Evaluated]) -> Result<()>;
}

/// What is searched, and for what: a JSON object.
pub type Problem = Value;

/// A scenario that a strategy proposes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Candidate {
    /// The number of the candidate in its search, from 0.
    pub id: u64,
    /// A value for each search variable.
    pub values: Map<String, Value>,
}

/// How a candidate did.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Evaluated {
    /// The number of the candidate.
    pub id: u64,
    /// The objectives, smaller is better.
    pub objectives: Vec<f64>,
    /// Whether the driver failed.
    pub critical: bool,
}
