//! Search strategies: components that propose candidates and learn from how these did.

use pdk_abi::{SearchFunctionsRef, Sink, Text};
pub use pdk_model::search::{Candidate, Constraint, Evaluated, Problem, Range, Space, Variable};
use pdk_seed::Key;
use serde_json::{Map, Value};

use crate::abi::convert;
use crate::abi::host::call::{Object, call, collect};
use crate::abi::plugin::call::{functions, put};
use crate::config::Config;
use crate::describe::Description;
use crate::error::{Error, ErrorKind, Result};
use crate::testing::sample::{Make, ensure};

/// Proposes candidates and learns from how they did, by ask and tell.
///
/// Candidates and their order depend on problem, key and results alone, never on when results come, how many come at once,
/// or how many are asked for. So each candidate depends on the results of a certain number of candidates before it: all of the
/// generation before, or all but the last eight, as the strategy likes. It uses no others, even where it knows them.
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

functions! { Search as SearchFunctions:
    fn start(component, _, problem: Text, key: Text) {
        let problem = serde_json::from_str(convert::text(problem)?)?;
        let key = <[u8; 32]>::try_from(key.bytes())
            .map_err(|_| Error::of(ErrorKind::Nonsense, "a key has to have 32 bytes"))?;
        component.start(&problem, &Key(key))
    }
    fn ask(component, _, count: usize, candidates: *const Sink) {
        put(candidates, &serde_json::to_string(&component.ask(count)?)?);
        Ok(())
    }
    fn tell(component, _, results: Text) {
        component.tell(&serde_json::from_str::<Vec<_>>(convert::text(results)?)?)
    }
}

/// An instance in a plugin.
pub(crate) struct Host(Object<SearchFunctionsRef>);

impl Host {
    pub(crate) fn new(object: Object<SearchFunctionsRef>) -> Result<Self> {
        Ok(Self(object))
    }
}

impl Search for Host {
    fn start(&mut self, problem: &Problem, key: &Key) -> Result<()> {
        let Object { pointer, functions, .. } = self.0;
        let problem = serde_json::to_string(problem)?;
        let (problem, key) = (Text::new(problem.as_bytes()), Text::new(&key.0));
        // SAFETY: everything lives through the call.
        call(|error| unsafe { functions.start()(pointer, problem, key, error) })
    }

    fn ask(&mut self, n: usize) -> Result<Vec<Candidate>> {
        let Object { pointer, functions, .. } = self.0;
        // SAFETY: both sinks live through the call.
        let candidates = collect(|text, error| unsafe { functions.ask()(pointer, n, text, error) })?;
        Ok(serde_json::from_str(&candidates)?)
    }

    fn tell(&mut self, results: &[Evaluated]) -> Result<()> {
        let Object { pointer, functions, .. } = self.0;
        let results = serde_json::to_string(results)?;
        // SAFETY: everything lives through the call.
        call(|error| unsafe { functions.tell()(pointer, Text::new(results.as_bytes()), error) })
    }
}

/// Checks that a search strategy proposes no more than it is asked for, that all it proposes lies in the space, and that what it
/// proposes does not depend on how many candidates it is asked for and how many results it gets at once.
///
/// # Errors
/// The first check that fails.
pub fn check(_: &Description, config: &Config, make: Make<'_, dyn Search>) -> Result<()> {
    let problem = search_problem();
    let key = Key([7; 32]);
    let mut ways = Vec::new();
    for at_once in [1, 7, 64] {
        let mut strategy = make(config)?;
        strategy.start(&problem, &key)?;
        ways.push(searched(strategy.as_mut(), &problem, at_once)?);
    }
    ensure(!ways[0].is_empty(), || "asked for a candidate it proposes none".to_owned())?;
    for way in &ways[1..] {
        // What was asked for at last may be more in one way than in another.
        let both = ways[0].len().min(way.len());
        let differs = (0..both).find(|&i| ways[0][i] != way[i]);
        ensure(differs.is_none(), || {
            format!(
                "candidate {} depends on how many candidates are asked for and told at once",
                differs.unwrap_or_default()
            )
        })?;
    }
    Ok(())
}

/// A small problem with a range of each kind.
fn search_problem() -> Problem {
    let variable = |name: &str, range| Variable { name: name.to_owned(), range };
    let values = |names: [&str; 3]| names.map(Value::from).to_vec();
    Problem {
        space: Space {
            variables: vec![
                variable("x", Range::Real { min: -1.0, max: 2.0 }),
                variable("n", Range::Integer { min: 0, max: 20 }),
                variable("rank", Range::Ordinal { values: values(["low", "middle", "high"]) }),
                variable("kind", Range::Choice { values: values(["a", "b", "c"]) }),
            ],
            constraints: Vec::new(),
        },
        objectives: vec!["effort".to_owned(), "max_cross_track_error".to_owned()],
        evaluations: Some(200),
    }
}

/// What a strategy proposes for some 200 candidates, where this many are asked for and told at once.
fn searched(strategy: &mut dyn Search, problem: &Problem, at_once: usize) -> Result<Vec<Map<String, Value>>> {
    let mut proposed = Vec::new();
    while proposed.len() < 200 {
        let candidates = strategy.ask(at_once)?;
        ensure(candidates.len() <= at_once, || {
            format!("asked for {at_once} candidates it proposes {}", candidates.len())
        })?;
        if candidates.is_empty() {
            break;
        }
        let mut results = Vec::new();
        for candidate in candidates {
            let number = proposed.len() as u64;
            ensure(candidate.id == number, || {
                format!("candidate {number} has the number {}; they count from 0", candidate.id)
            })?;
            let x = problem
                .space
                .positions(&candidate.values)
                .map_err(|error| error.at(format_args!("candidate {number}")))?;
            let failed = number % 17 == 16;
            results.push(Evaluated {
                id: number,
                objectives: if failed { Vec::new() } else { vec![x[0] * x[0] + x[2], x[1] - x[0] * x[3]] },
                violations: Vec::new(),
                critical: !failed && x[0] > 1.0 && x[1] > 10.0,
                failure: failed.then(|| "it failed".to_owned()),
            });
            proposed.push(candidate.values);
        }
        strategy.tell(&results)?;
    }
    Ok(proposed)
}
