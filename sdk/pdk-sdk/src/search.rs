//! Search strategies: components that propose candidates and learn from how these did.

pub use pdk_model::search::{Candidate, Constraint, Evaluated, Problem, Range, Space, Variable};
use pdk_seed::Key;

use crate::error::Result;

/// Proposes candidates and learns from how they did, by ask and tell.
///
/// Candidates and their order depend on problem, key and results alone, never on when results come, how many come at once,
/// or how many are asked for. So each candidate depends on the results of a certain number of candidates before it: all of the
/// generation before, or all but the last eight, as the strategy likes. It uses no others, even if it knows them.
///
/// Results come in the order of the candidates, each once.
pub trait Search: Send {
    /// Begins a search; called once, before anything else. `key` is the origin of everything that it draws.
    ///
    /// # Errors
    /// If the strategy cannot search this space.
    fn start(&mut self, problem: &Problem, key: &Key) -> Result<()>;

    /// Proposes the next candidates, at most `n`. Fewer where those after them depend on results that have not been told; none
    /// although all have come if the search is over. The same values may be proposed again: pdk does not evaluate them twice.
    ///
    /// # Errors
    /// If the strategy cannot propose.
    fn ask(&mut self, n: usize) -> Result<Vec<Candidate>>;

    /// Learns how candidates did.
    ///
    /// # Errors
    /// If a result is not that of the next candidate.
    fn tell(&mut self, results: &[Evaluated]) -> Result<()>;
}
