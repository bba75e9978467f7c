//! What a pipeline writes to search.

use std::collections::BTreeMap;
use std::time::Duration;

use mlua::{ExternalError, Function, Lua, Table, Value as LuaValue};
use pdk_model::component::ComponentSpec;
use pdk_model::search::{Constraint, Problem, Range, Space, Variable};
use pdk_sdk::error::{Error, Result};
use serde_json::{Map, Value};

use crate::fields::Fields;
use crate::requests::{Defaults, SHARED};
use crate::values::{entries, from_lua};

/// What errors call the request.
pub const PLACE: &str = "pdk.search";
/// The kinds of range, as they are written.
const KINDS: [&str; 4] = ["integer", "real", "ordinal", "choice"];

/// A search.
pub struct Request {
    /// What it is called: its files are named so.
    pub name: Option<String>,
    /// What is searched.
    pub problem: Problem,
    /// Whether the objective of this place is maximised.
    pub maximised: Vec<bool>,
    /// The worst value of each objective that counts for the hypervolume, as the pipeline sees it.
    pub reference: Option<Vec<f64>>,
    /// Functions of the values that are at most 0 where a constraint holds.
    pub constraints: Vec<Function>,
    /// Who proposes.
    pub strategy: StrategySpec,
    /// Evaluates values, or makes a scenario of them.
    pub evaluate: Function,
    /// Judges the outcome of a scenario.
    pub outcome: Option<Function>,
    /// When to stop.
    pub stop: Stop,
    /// The seed of the search; that of the run if it is left out.
    pub seed: Option<u64>,
    /// The defaults of scenarios.
    pub defaults: Defaults,
    /// The same as the pipeline wrote it, for levels over time.
    pub written: BTreeMap<&'static str, LuaValue>,
}

/// Who proposes.
pub enum StrategySpec {
    /// A component.
    Component(ComponentSpec),
    /// A table of functions.
    Functions(Table),
}

/// When a search stops: at the first of these.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Stop {
    /// After this many distinct evaluations.
    pub evaluations: Option<u64>,
    /// After this much time.
    pub time: Option<Duration>,
    /// When the front dominates such a volume.
    pub hypervolume: Option<f64>,
}

impl Request {
    /// Reads a request.
    ///
    /// # Errors
    /// If a field is unknown, missing, of the wrong type or out of range, or nothing can be searched.
    pub fn read(lua: &Lua, request: &LuaValue, defaults: Defaults) -> mlua::Result<Self> {
        let table = request.as_table().ok_or_else(|| wrong("takes a table: { space = ..., ... }"))?;
        let function = |field: &str| match table.raw_get::<LuaValue>(field)? {
            LuaValue::Nil => Ok(None),
            LuaValue::Function(function) => Ok(Some(function)),
            other => Err(wrong(&format!(": `{field}` is a {}, but has to be a function", other.type_name()))),
        };
        let evaluate = function("evaluate")?.ok_or_else(|| wrong(": `evaluate` is missing"))?;
        let outcome = function("outcome")?;
        let given: LuaValue = table.raw_get("strategy")?;
        let functions = given.as_table().filter(|table| table.contains_key("ask").unwrap_or(false)).cloned();
        let (constraints, linear) = constraints(lua, table)?;
        // What is left is plain values.
        let plain = lua.create_table()?;
        for pair in table.pairs::<LuaValue, LuaValue>() {
            let (key, value) = pair?;
            let name = key.as_string().map(|key| key.to_string_lossy()).unwrap_or_default();
            let taken = match name.as_str() {
                "evaluate" | "outcome" | "constraints" => true,
                "strategy" => functions.is_some(),
                _ => false,
            };
            if !taken {
                plain.raw_set(key, value)?;
            }
        }
        let written = ["simulator", "duration"].map(|field| Ok((field, table.raw_get::<LuaValue>(field)?)));
        let written = written.into_iter().collect::<mlua::Result<_>>()?;
        let read = || -> Result<Self> {
            let plain = from_lua(&LuaValue::Table(plain), PLACE)?;
            let own = ["name", "space", "objectives", "reference", "strategy", "stop", "seed"];
            let known: Vec<&str> = SHARED.iter().copied().chain(own).collect();
            let mut fields = Fields::new(PLACE, plain, &known)?;
            let space = Space { variables: variables(fields.needed("space")?)?, constraints: linear };
            space.check().map_err(|error| error.at(PLACE))?;
            let objectives = directions(&fields.needed("objectives")?)?;
            let reference = reference(&fields.any("reference"), &objectives)?;
            let stop = Stop::read(fields.any("stop"), reference.is_some())?;
            let strategy = match functions {
                Some(table) => StrategySpec::Functions(table),
                None => StrategySpec::Component(ComponentSpec::from_json(
                    "strategy",
                    &fields.needed("strategy")?,
                )?),
            };
            Ok(Self {
                name: fields.text("name")?,
                problem: Problem {
                    space,
                    objectives: objectives.iter().map(|(name, _)| name.clone()).collect(),
                    evaluations: stop.evaluations,
                },
                maximised: objectives.iter().map(|(_, maximised)| *maximised).collect(),
                reference,
                constraints,
                strategy,
                evaluate,
                outcome,
                stop,
                seed: fields.seed("seed")?,
                defaults: defaults.take(&mut fields)?,
                written,
            })
        };
        read().map_err(ExternalError::into_lua_err)
    }
}

impl Stop {
    fn read(value: Value, has_reference: bool) -> Result<Self> {
        let mut fields =
            Fields::new(format!("{PLACE}: stop"), value, &["evaluations", "seconds", "hypervolume"])?;
        let evaluations = fields.whole("evaluations")?;
        let seconds = fields.number("seconds")?;
        let hypervolume = fields.number("hypervolume")?;
        if evaluations == Some(0) {
            return Err(mistake("`stop.evaluations` is 0, but has to be at least 1"));
        }
        let time = match seconds.map(Duration::try_from_secs_f64) {
            Some(Ok(time)) if time > Duration::ZERO => Some(time),
            Some(_) => return Err(mistake("`stop.seconds` has to be a positive number of seconds")),
            None => None,
        };
        if hypervolume.is_some() && !has_reference {
            return Err(mistake(
                "`stop.hypervolume` needs `reference`, the worst value of each objective that counts, as in { error = 4 }",
            ));
        }
        if evaluations.is_none() && time.is_none() {
            return Err(mistake(
                "`stop` has to name `evaluations` or `seconds`, because a hypervolume may never be reached",
            ));
        }
        Ok(Self { evaluations, time, hypervolume })
    }
}

/// The constraints: functions, and linear ones.
fn constraints(lua: &Lua, table: &Table) -> mlua::Result<(Vec<Function>, Vec<Constraint>)> {
    let (mut functions, linear) = (Vec::new(), lua.create_table()?);
    match table.raw_get::<LuaValue>("constraints")? {
        LuaValue::Nil => {}
        LuaValue::Table(list) => {
            let place = format!("{PLACE}: constraints");
            for entry in entries(&list, &place).map_err(ExternalError::into_lua_err)? {
                match entry.map_err(ExternalError::into_lua_err)? {
                    LuaValue::Function(function) => functions.push(function),
                    other => linear.raw_push(other)?,
                }
            }
        }
        other => {
            return Err(wrong(&format!(
                ": `constraints` is a {}, but has to be a list of functions and tables",
                other.type_name()
            )));
        }
    }
    let read = || -> Result<Vec<Constraint>> {
        let place = format!("{PLACE}: constraints");
        let Value::Array(list) = from_lua(&LuaValue::Table(linear), &place)? else { return Ok(Vec::new()) };
        let constraint = |value| {
            let mut fields = Fields::new(&*place, value, &["weights", "at_most"])?;
            let weights = serde_json::from_value(fields.needed("weights")?).map_err(|_| {
                Error::new(format!("{place}: `weights` has to be a table of numbers, as in {{ turns = 1 }}"))
            })?;
            let at_most = fields
                .number("at_most")?
                .ok_or_else(|| Error::new(format!("{place}: `at_most` is missing")))?;
            Ok(Constraint { weights, at_most })
        };
        list.into_iter().map(constraint).collect()
    };
    Ok((functions, read().map_err(ExternalError::into_lua_err)?))
}

/// The variables of a space, in the order of their names: a table in Lua has no other.
fn variables(space: Value) -> Result<Vec<Variable>> {
    let table = match space {
        Value::Object(table) => table,
        // The check of the space reports that there is nothing in it.
        Value::Array(list) if list.is_empty() => Map::new(),
        other => {
            return Err(mistake(&format!(
                "`space` is {other}, but has to be a table, as in {{ x = {{ real = {{ 0, 1 }} }} }}"
            )));
        }
    };
    let variable = |(name, value): (String, Value)| {
        let range = range(&value).ok_or_else(|| {
            mistake(&format!(
                "the variable `{name}` is {value}, but has to be one of {{ integer = {{ 0, 8 }} }}, {{ real = {{ 0, 1 }} }}, \
                 {{ ordinal = {{ \"low\", \"high\" }} }} and {{ choice = {{ \"a\", \"b\" }} }}"
            ))
        })?;
        Ok(Variable { name, range })
    };
    table.into_iter().map(variable).collect()
}

fn range(value: &Value) -> Option<Range> {
    let table = value.as_object().filter(|table| table.len() == 1)?;
    let (kind, list) = table.iter().next()?;
    let list = list.as_array()?;
    let pair = || if list.len() == 2 { Some((&list[0], &list[1])) } else { None };
    match KINDS.iter().position(|known| known == kind)? {
        0 => pair().and_then(|(min, max)| Some(Range::Integer { min: min.as_i64()?, max: max.as_i64()? })),
        1 => pair().and_then(|(min, max)| Some(Range::Real { min: min.as_f64()?, max: max.as_f64()? })),
        2 => Some(Range::Ordinal { values: list.clone() }),
        _ => Some(Range::Choice { values: list.clone() }),
    }
}

/// The objectives in the order of their names, and whether each is maximised.
fn directions(value: &Value) -> Result<Vec<(String, bool)>> {
    let wrong = || {
        mistake(&format!(
            "`objectives` is {value}, but has to say of each whether to \"minimise\" or \"maximise\" it, as in \
             {{ error = \"maximise\" }}"
        ))
    };
    let table = value.as_object().filter(|table| !table.is_empty()).ok_or_else(wrong)?;
    let direction = |(name, direction): (&String, &Value)| match direction.as_str() {
        Some("minimise") => Ok((name.clone(), false)),
        Some("maximise") => Ok((name.clone(), true)),
        _ => Err(wrong()),
    };
    table.iter().map(direction).collect()
}

fn reference(value: &Value, objectives: &[(String, bool)]) -> Result<Option<Vec<f64>>> {
    if value.is_null() {
        return Ok(None);
    }
    let number = |(name, _): &(String, bool)| value.get(name).and_then(Value::as_f64);
    let complete = value.as_object().is_some_and(|table| table.len() == objectives.len());
    match objectives.iter().map(number).collect::<Option<Vec<f64>>>().filter(|_| complete) {
        Some(reference) => Ok(Some(reference)),
        None => Err(mistake(&format!(
            "`reference` is {value}, but has to have a number for each objective and nothing else"
        ))),
    }
}

fn mistake(sentence: &str) -> Error {
    Error::new(format!("{PLACE}: {sentence}"))
}

fn wrong(rest: &str) -> mlua::Error {
    let space = if rest.starts_with(':') { "" } else { " " };
    Error::new(format!("{PLACE}{space}{rest}")).into_lua_err()
}
