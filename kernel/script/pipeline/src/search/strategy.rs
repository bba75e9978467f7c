//! The strategy of a search: a component in a process of its own, or a table of functions in the pipeline.

use mlua::{ExternalError, Function, Lua, Table, Value as LuaValue};
use pdk_loop::protocol::{SearchStep, StartSearch};
use pdk_lua::LuaRandom;
use pdk_model::component::ComponentSpec;
use pdk_model::search::{Candidate, Evaluated, Problem};
use pdk_sdk::error::{Error, ErrorKind, Result};
use pdk_sdk::seed::Key;
use pdk_sdk::suggest;
use pdk_session::session::Session;
use serde_json::{Map, Value, json};

use crate::bridge::with_host;
use crate::search::request::PLACE;
use crate::values::{from_lua, to_lua};

/// Candidates that a table of functions is asked for at once, if it does not say how many.
const BATCH: usize = 16;
/// The fields of a table of functions.
const FIELDS: [&str; 4] = ["start", "ask", "tell", "batch"];
/// The most that it may say.
const MOST: u64 = 100_000;

/// The strategy of a search.
pub enum Strategy {
    /// A component, in the process of this session. Its candidates do not depend on when it gets results.
    Component {
        /// Its session.
        session: Box<Session>,
        /// What begins the search, until that was sent.
        start: Option<StartSearch>,
        /// What it is called in errors.
        name: String,
    },
    /// Functions. They get all results of a batch before they are asked for the next one, so that what they propose does
    /// not depend on when results come, however they are written.
    Functions {
        /// `ask`.
        ask: Function,
        /// `tell`, if there is one.
        tell: Option<Function>,
        /// How many candidates it is asked for at once.
        batch: usize,
        /// How many were proposed, and how many of them have been told.
        proposed: u64,
        /// The values of what was proposed and not told.
        waiting: Vec<Map<String, Value>>,
    },
}

impl Strategy {
    /// A component that searches a problem.
    pub fn component(session: Session, strategy: ComponentSpec, problem: &Problem, key: Key) -> Self {
        let name = format!("search `{}`", strategy.name);
        let start = StartSearch { strategy, problem: problem.clone(), key: key.0 };
        Self::Component { session: Box::new(session), start: Some(start), name }
    }

    /// A table of functions that searches a problem.
    ///
    /// # Errors
    /// If it has no `ask`, or `start` fails.
    pub fn functions(lua: &Lua, table: &Table, problem: &Problem, key: &Key) -> mlua::Result<Self> {
        let function = |field: &str| match table.raw_get::<LuaValue>(field)? {
            LuaValue::Nil => Ok(None),
            LuaValue::Function(function) => Ok(Some(function)),
            other => Err(Error::new(format!(
                "{PLACE}: `strategy.{field}` is a {}, but has to be a function",
                other.type_name()
            ))
            .into_lua_err()),
        };
        for pair in table.pairs::<LuaValue, LuaValue>() {
            let name = pair?.0.to_string()?;
            if !FIELDS.contains(&name.as_str()) {
                return Err(Error::new(format!(
                    "{PLACE}: there is no field `strategy.{name}` beside functions; {}",
                    suggest::hint(&name, FIELDS)
                ))
                .into_lua_err());
            }
        }
        let (start, ask, tell) = (function("start")?, function("ask")?, function("tell")?);
        let ask =
            ask.ok_or_else(|| Error::new(format!("{PLACE}: `strategy.ask` is missing")).into_lua_err())?;
        let batch = match from_lua(&table.raw_get("batch")?, "strategy.batch")
            .map_err(ExternalError::into_lua_err)?
        {
            Value::Null => BATCH,
            value => match value.as_u64().filter(|batch| (1..=MOST).contains(batch)) {
                Some(batch) => batch as usize,
                None => {
                    let sentence = format!(
                        "{PLACE}: `strategy.batch` is {value}, but has to be a whole number from 1 to {MOST}"
                    );
                    return Err(Error::new(sentence).into_lua_err());
                }
            },
        };
        if let Some(start) = start {
            let problem = serde_json::to_value(problem).map_err(ExternalError::into_lua_err)?;
            // Flat, as it reads best in a script.
            let problem = json!({
                "variables": problem["space"]["variables"],
                "objectives": problem["objectives"],
                "evaluations": problem["evaluations"],
            });
            let random = lua.create_userdata(LuaRandom(key.sequence()))?;
            start.call::<()>((to_lua(lua, &problem)?, random))?;
        }
        Ok(Self::Functions { ask, tell, batch, proposed: 0, waiting: Vec::new() })
    }

    /// Tells results, in the order of the candidates, and asks for at most `n` further candidates.
    ///
    /// # Errors
    /// What the strategy says, or what it must not do.
    pub fn step(&mut self, lua: &Lua, results: Vec<Evaluated>, n: usize) -> mlua::Result<Vec<Candidate>> {
        match self {
            Self::Component { session, start, name } => {
                let step = SearchStep { start: start.take(), tell: results, ask: n };
                // The host is not needed, but the time is not the script's.
                let candidates = with_host(lua, |_| session.search(step))?;
                if candidates.len() > n {
                    let count = candidates.len();
                    let sentence = format!("{name}: asked for {n} candidates it proposes {count}");
                    return Err(Error::of(ErrorKind::Nonsense, sentence).into_lua_err());
                }
                Ok(candidates)
            }
            Self::Functions { ask, tell, batch, proposed, waiting } => {
                if let Some(tell) = tell.as_ref().filter(|_| !results.is_empty()) {
                    let rows: Vec<Value> =
                        results.iter().zip(&*waiting).map(|(result, values)| row(result, values)).collect();
                    tell.call::<()>(to_lua(lua, &Value::Array(rows))?)?;
                }
                waiting.drain(..results.len());
                if n == 0 || !waiting.is_empty() {
                    return Ok(Vec::new());
                }
                let proposal = proposals(&ask.call(*batch)?, *batch).map_err(ExternalError::into_lua_err)?;
                let first = *proposed;
                *proposed += proposal.len() as u64;
                waiting.clone_from(&proposal);
                Ok((first..).zip(proposal).map(|(id, values)| Candidate { id, values }).collect())
            }
        }
    }

    /// The session, for another search.
    pub fn into_session(self) -> Option<Session> {
        match self {
            Self::Component { session, .. } => Some(*session),
            Self::Functions { .. } => None,
        }
    }
}

/// The result of a candidate, as functions receive it.
fn row(result: &Evaluated, values: &Map<String, Value>) -> Value {
    json!({
        "id": result.id,
        "values": values,
        "objectives": result.objectives,
        "violation": result.violations.iter().map(|violation| violation.max(0.0)).sum::<f64>(),
        "critical": result.critical,
        "failure": result.failure,
    })
}

/// What `ask` returned: a list of tables of values, or nothing.
fn proposals(returned: &LuaValue, batch: usize) -> Result<Vec<Map<String, Value>>> {
    let list = match from_lua(returned, "what `strategy.ask` returns")? {
        Value::Null => return Ok(Vec::new()),
        Value::Array(list) => list,
        other => {
            return Err(Error::of(
                ErrorKind::Nonsense,
                format!("{PLACE}: `strategy.ask` returns {other}, but has to return a list"),
            ));
        }
    };
    if list.len() > batch {
        return Err(Error::of(
            ErrorKind::Nonsense,
            format!("{PLACE}: asked for {batch} candidates `strategy.ask` returns {}", list.len()),
        ));
    }
    let values = |value: Value| match value {
        Value::Object(values) => Ok(values),
        other => Err(Error::of(
            ErrorKind::Nonsense,
            format!(
                "{PLACE}: `strategy.ask` returns a list with {other}, but has to return tables with a value for each variable"
            ),
        )),
    };
    list.into_iter().map(values).collect()
}
