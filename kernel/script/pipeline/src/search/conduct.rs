//! A search from its start to its end.

use std::time::Instant;

use mlua::{ExternalError, Function, Lua, Value as LuaValue};
use pdk_lua::is_interrupted;
use pdk_model::search::{Candidate, Evaluated};
use pdk_sdk::error::{Error, Result};
use pdk_sdk::seed;
use pdk_session::interrupt::{self, Wish};
use serde_json::Value;

use crate::bridge::{frames_of, outcome_to_lua, with_host};
use crate::levels;
use crate::outcomes::ELSEWHERE;
use crate::search::request::{PLACE, Request, StrategySpec};
use crate::search::results;
use crate::search::strategy::Strategy;
use crate::search::trials::{Admitted, State, Trials};
use crate::search::verdict::Verdict;
use crate::values::{from_lua, to_lua};

/// This many candidates in a row without anything new end a search.
const MOST_IDLE: u64 = 10_000;
/// This many evaluations that all failed end it with an error.
const FAILED_AT_FIRST: u64 = 20;
/// Scenarios that wait for each worker, so that none waits for the pipeline.
const AHEAD: usize = 4;
/// The fewest candidates that a strategy is asked for at once.
const FEWEST: usize = 16;

/// A search that is under way.
struct Search {
    request: Request,
    strategy: Strategy,
    trials: Trials,
    /// What the strategy has not been told yet.
    results: Vec<Evaluated>,
    /// How many candidates may be proposed and not told.
    ahead: usize,
    started: Instant,
    /// Candidates whose evaluation failed, and the first reason.
    failures: (u64, Option<String>),
    front: results::Front,
    stopped: Option<&'static str>,
}

/// `pdk.search`.
///
/// # Errors
/// If the request is wrong, the strategy fails, or nothing can be evaluated.
pub fn search(lua: &Lua, request: &LuaValue) -> mlua::Result<LuaValue> {
    let defaults = with_host(lua, |host| Ok(host.defaults()))?;
    let request = Request::read(lua, request, defaults)?;
    let component = match &request.strategy {
        StrategySpec::Component(component) => Some(component.clone()),
        StrategySpec::Functions(_) => None,
    };
    let ends_by_outcomes = request.stop.hypervolume.is_some() || request.stop.time.is_some();
    let begun = with_host(lua, |host| {
        host.begin_search(request.name.as_deref(), component.as_ref(), ends_by_outcomes)
    })?;
    let seed = request.seed.unwrap_or(begun.seed);
    let label = component.as_ref().map_or("functions", |component| &component.name);
    let key = seed::key(seed, label, begun.number);
    let strategy = match (&request.strategy, begun.session) {
        (StrategySpec::Component(component), Some(session)) => {
            Strategy::component(session, component.clone(), &request.problem, key)
        }
        (StrategySpec::Functions(table), _) => Strategy::functions(lua, table, &request.problem, &key)?,
        (StrategySpec::Component(_), None) => {
            return Err(Error::new("a search has no session, which is a defect in pdk").into_lua_err());
        }
    };
    let trials = Trials::new(request.problem.clone(), request.maximised.clone());
    let mut search = Search {
        strategy,
        trials,
        results: Vec::new(),
        ahead: (AHEAD * begun.slots).max(FEWEST),
        started: Instant::now(),
        failures: (0, None),
        front: results::Front::new(&request.problem, &request.maximised, request.reference.as_deref()),
        stopped: None,
        request,
    };
    let stopped = search.run(lua)?;
    let Search { request, strategy, trials, failures, front, .. } = search;
    let summary = results::Summary {
        name: &begun.name,
        strategy: component
            .map_or(Value::String("functions".into()), |c| serde_json::to_value(c).unwrap_or_default()),
        baseline: begun.baseline,
        seed,
        stopped,
        problem: &request.problem,
        maximised: &request.maximised,
        trials: &trials,
        failures: failures.0,
        front: &front,
    };
    let (found, table) = (results::found(&summary), results::table(&summary));
    with_host(lua, |host| {
        if let (count @ 1.., Some(first)) = &failures {
            let all = trials.told();
            host.warn(format!(
                "search `{}`: {count} of {all} candidates could not be evaluated; the first: {first}",
                begun.name
            ));
        }
        host.end_search(&begun.name, &found, &table, strategy.into_session())
    })?;
    to_lua(lua, &found)
}

impl Search {
    /// Searches until there is a reason to stop, and returns that.
    fn run(&mut self, lua: &Lua) -> mlua::Result<&'static str> {
        loop {
            let more = match self.stopped {
                None => self.propose(lua)?,
                Some(_) => false,
            };
            if self.stopped == Some("hypervolume") {
                // What is still under way is not part of the result.
                return Ok("hypervolume");
            }
            if self.trials.open() == 0 {
                if let Some(stopped) = self.stopped {
                    return Ok(stopped);
                }
                if !more {
                    return Ok("strategy");
                }
                continue;
            }
            self.settle(lua)?;
        }
    }

    /// Tells the strategy what is known and evaluates what it proposes. Whether it proposed anything.
    fn propose(&mut self, lua: &Lua) -> mlua::Result<bool> {
        let stop = &self.request.stop;
        if stop.time.is_some_and(|time| self.started.elapsed() >= time) {
            self.stopped = Some("seconds");
            return Ok(false);
        }
        let left = stop.evaluations.map_or(u64::MAX, |most| most - self.trials.evaluations.min(most));
        if left == 0 {
            self.stopped = Some("evaluations");
            return Ok(false);
        }
        let room = self.ahead.saturating_sub(self.trials.open());
        let n = room.min(usize::try_from(left).unwrap_or(usize::MAX));
        let results = std::mem::take(&mut self.results);
        let candidates = self.strategy.step(lua, results, n)?;
        let any = !candidates.is_empty();
        for candidate in candidates {
            // A table of functions may propose more than is left.
            if stop_reached(self.request.stop.evaluations, self.trials.evaluations) {
                self.stopped = Some("evaluations");
                break;
            }
            self.take(lua, candidate)?;
            if self.trials.idle >= MOST_IDLE {
                self.stopped = Some("nothing new");
                break;
            }
        }
        if any && self.stopped.is_none() && self.trials.is_exhausted() {
            self.stopped = Some("exhausted");
        }
        Ok(any)
    }

    /// Takes in a candidate, and begins to evaluate it if it is new.
    fn take(&mut self, lua: &Lua, candidate: Candidate) -> mlua::Result<()> {
        let values = candidate.values.clone();
        let Admitted::New = self.trials.admit(candidate).map_err(ExternalError::into_lua_err)? else {
            return Ok(());
        };
        let values = to_lua(lua, &Value::Object(values))?;
        match self.violations(&values)? {
            Ok(violations) if violations.iter().any(|violation| *violation > 0.0) => {
                self.trials.complete(State::Done(Verdict { violations, ..Verdict::default() }));
                return Ok(());
            }
            Ok(_) => {}
            Err(reason) => return self.fail(reason),
        }
        let returned = match self.call("evaluate", &self.request.evaluate, values)? {
            Ok(returned) => returned,
            Err(reason) => return self.fail(reason),
        };
        let has_objectives =
            returned.as_table().is_some_and(|table| table.contains_key("objectives").unwrap_or(false));
        let begun = match has_objectives {
            true => self.judged(&returned).map(State::Done).map_err(|error| error.into_lua_err()),
            false => self.submit(lua, &returned),
        };
        match begun {
            Ok(state @ State::Done(_)) => {
                self.trials.count(None);
                self.trials.complete(state);
                Ok(())
            }
            Ok(state) => {
                self.trials.complete(state);
                Ok(())
            }
            Err(error) => self.fail(reason(&error)?),
        }
    }

    /// The constraints that are functions: by how much the candidate violates each, or why that could not be computed.
    fn violations(&self, values: &LuaValue) -> mlua::Result<Result<Vec<f64>, String>> {
        let mut violations = Vec::with_capacity(self.request.constraints.len());
        for constraint in &self.request.constraints {
            match self.call("constraints", constraint, values.clone())? {
                Ok(LuaValue::Number(number)) if number.is_finite() => violations.push(number.max(0.0)),
                Ok(LuaValue::Integer(number)) => violations.push((number as f64).max(0.0)),
                Ok(_) => {
                    return Ok(Err(
                        "a function in `constraints` returns something other than a finite number".into(),
                    ));
                }
                Err(reason) => return Ok(Err(reason)),
            }
        }
        Ok(Ok(violations))
    }

    /// The objectives that `evaluate` returned.
    fn judged(&self, returned: &LuaValue) -> Result<Verdict> {
        let returned = from_lua(returned, "evaluate")?;
        Verdict::read("evaluate", returned, &self.request.problem.objectives, None)
    }

    /// Submits the scenario that `evaluate` returned.
    fn submit(&mut self, lua: &Lua, scenario: &LuaValue) -> mlua::Result<State> {
        let written = &self.request.written;
        let defaults = |field: &str| Ok(written.get(field).cloned().unwrap_or(LuaValue::Nil));
        let scenario = levels::evaluated(lua, scenario, |own| frames_of(lua, own, &defaults))?;
        let place = "what `evaluate` returns";
        let table = from_lua(&scenario, place).map_err(ExternalError::into_lua_err)?;
        let submission =
            self.request.defaults.submission(place, table).map_err(ExternalError::into_lua_err)?;
        let id = submission.scenario.id().to_string();
        // The components have to be there before it counts.
        let ticket = with_host(lua, |host| host.submit_one(submission))?;
        Ok(self.trials.count(Some(&id)).map_or(State::Waits(ticket), State::Same))
    }

    /// The candidate that was admitted last cannot be evaluated.
    fn fail(&mut self, reason: String) -> mlua::Result<()> {
        self.trials.count(None);
        self.trials.complete(State::Done(Verdict::failed(reason)));
        Ok(())
    }

    /// Waits for the first candidate that has not been told, and takes down what became of it.
    fn settle(&mut self, lua: &Lua) -> mlua::Result<()> {
        if let Some(ticket) = self.trials.waits_for() {
            let row = with_host(lua, |host| host.wait(ticket))?;
            if row["cause"] == ELSEWHERE {
                self.trials.settle(Verdict::failed("another part of the run drives it"));
                // A strategy that learns nothing needs no results.
                let _ = self.trials.tell();
                return Ok(());
            }
            let judged = match &self.request.outcome {
                Some(function) if row["cause"] != "error" => {
                    let number = self.trials.told();
                    let values = Value::Object(self.trials.all()[number].values.clone());
                    self.call("outcome", function, (outcome_to_lua(lua, &row)?, to_lua(lua, &values)?))?
                }
                _ => Ok(LuaValue::Nil),
            };
            let verdict = judged.and_then(|judged| {
                let judged = from_lua(&judged, "outcome").map_err(|error| error.to_string())?;
                Verdict::of_scenario(row, judged, &self.request.problem.objectives)
                    .map_err(|error| error.to_string())
            });
            self.trials.settle(verdict.unwrap_or_else(Verdict::failed));
        }
        let number = self.trials.told();
        let Some(result) = self.trials.tell() else { return Ok(()) };
        if let Some(reason) = &result.failure {
            self.failures.0 += 1;
            self.failures.1.get_or_insert_with(|| reason.clone());
            if self.failures.0 >= FAILED_AT_FIRST && self.failures.0 == self.trials.told() as u64 {
                return Err(Error::new(format!(
                    "{PLACE}: none of the first {FAILED_AT_FIRST} candidates could be evaluated; the last: {reason}"
                ))
                .into_lua_err());
            }
        }
        self.results.push(result);
        if self.front.add(&self.trials, number)
            && let Some(wanted) = self.request.stop.hypervolume
            && self.stopped.is_none()
            && self.front.hypervolume() >= wanted
        {
            self.stopped = Some("hypervolume");
        }
        Ok(())
    }

    /// Calls a function of the pipeline. An error of it is a reason, unless the script has to end.
    fn call(
        &self,
        name: &str,
        function: &Function,
        arguments: impl mlua::IntoLuaMulti,
    ) -> mlua::Result<Result<LuaValue, String>> {
        match function.call::<LuaValue>(arguments) {
            Ok(value) => Ok(Ok(value)),
            Err(error) => Ok(Err(format!("`{name}`: {}", reason(&error)?))),
        }
    }
}

fn stop_reached(most: Option<u64>, evaluations: u64) -> bool {
    most.is_some_and(|most| evaluations >= most)
}

/// What an error says, in one line.
///
/// # Errors
/// The error, where the script has to end.
fn reason(error: &mlua::Error) -> mlua::Result<String> {
    if is_interrupted() || interrupt::wish() != Wish::None || matches!(error, mlua::Error::MemoryError(_)) {
        return Err(error.clone());
    }
    let mut inner = error;
    while let mlua::Error::CallbackError { cause, .. } = inner {
        inner = cause;
    }
    let text = match inner {
        mlua::Error::RuntimeError(text) => text.clone(),
        mlua::Error::ExternalError(error) => error.to_string(),
        other => other.to_string(),
    };
    // A traceback is of no use in a table.
    Ok(text.lines().next().unwrap_or_default().to_owned())
}
