//! The table by which a script describes its perturbation.
//!
//! Everything is read without calling into the script, so that a table with a hostile metatable is only a table.

mod fields;
mod parameters;
mod records;

use mlua::{Function, Table, Value};
use pdk_sdk::config::Config;
use pdk_sdk::describe::{ActsOn, Description, Geometry, Temporal};
use pdk_sdk::error::{Error, Result};
use pdk_sdk::history::MOST_FRAMES;
use pdk_sdk::serde_json;

use fields::{Fields, describe, finite, one_line, unreadable};
use parameters::{MOST_ENTRIES, levels, parameters};
use pdk_components::check_description;
use pdk_sdk::suggest;

use crate::points::Points;
pub use records::{CONTEXT, CONTROL, EARLIER, OBSERVATION, PARAMETER, PERTURBATION};

/// What a script returned, checked.
pub(crate) struct Declaration {
    pub description: Description,
    /// Its function `apply`, or what it has in place of that.
    pub apply: Function,
    pub points: Option<Points>,
}

/// The functions of which a script has one: the first three make it a perturbation, the last one a mask.
const FUNCTIONS: [&str; 4] = ["apply", "observe", "actuate", "mask"];

/// Whether a table that a script returned is meant as a perturbation or a mask: it has what it applies, or says what that does.
pub(crate) fn is_meant(table: &Table) -> Result<bool> {
    Ok(!functions(table)?.is_empty()
        || matches!(table.raw_get::<Value>("doc").map_err(unreadable)?, Value::String(_)))
}

/// Those of the [`FUNCTIONS`] that a table has.
fn functions(table: &Table) -> Result<Vec<&'static str>> {
    let mut found = Vec::new();
    for name in FUNCTIONS {
        if !table.raw_get::<Value>(name).map_err(unreadable)?.is_nil() {
            found.push(name);
        }
    }
    Ok(found)
}

/// Checks what a script returned. `stem` is the name it has if it gives none.
///
/// # Errors
/// Names the field that is missing, unknown or of the wrong type.
pub(crate) fn read(returned: &Value, stem: &str) -> Result<Declaration> {
    let Value::Table(table) = returned else {
        return Err(Error::new(format!(
            "the script returns {}, but has to return a table, as in return {{ doc = \"...\", apply = function(image, \
             cx) ... end }}",
            describe(returned)
        )));
    };
    let function = match functions(table)?.as_slice() {
        [] => "apply",
        [function] => function,
        [one, other, ..] => {
            return Err(Error::new(format!(
                "the script has both `{one}` and `{other}`, but does one thing; leave one out"
            )));
        }
    };
    let mask = function == "mask";
    let of = if mask { "the mask" } else { "the perturbation" };
    let fields = Fields { table, of, record: &PERTURBATION };
    fields.refuse_unknown()?;
    let name = fields.optional_text("name")?.unwrap_or_else(|| stem.to_owned());
    let describe_as = if mask { Description::mask } else { Description::perturbation };
    let mut description = describe_as(&name, &fields.line("doc")?);
    // The script, which the caller knows.
    description.defined_in = String::new();
    description.family = fields.optional_text("family")?.unwrap_or_default();
    description.source = fields.optional_line("source")?;
    description.mathematics = fields.optional_line("mathematics")?;
    description.drawn_per_sequence = fields.optional_line("draws_per_sequence")?;
    description.drawn_per_frame = fields.optional_line("draws_per_frame")?;
    description.divergences = divergences(&fields)?;
    if let Some(version) = fields.optional_number("version")? {
        if !(1.0..=f64::from(u32::MAX)).contains(&version) || version.fract() != 0.0 {
            return Err(fields.wrong("version", "a whole number of at least 1", &Value::Number(version)));
        }
        description.version = version as u32;
    }
    description.temporal = match fields.optional_text("temporal")?.as_deref() {
        None | Some("static") => Temporal::Static,
        Some("dynamic") => Temporal::Dynamic,
        Some(other) => {
            return Err(Error::new(format!(
                "`temporal` of the perturbation is \"{other}\", but has to be \"static\" or \"dynamic\""
            )));
        }
    };
    if let Some(frames) = fields.optional_number("history")? {
        if !(0.0..=f64::from(MOST_FRAMES)).contains(&frames) || frames.fract() != 0.0 {
            let allowed = format!("a whole number from 0 to {MOST_FRAMES}");
            return Err(fields.wrong("history", &allowed, &Value::Number(frames)));
        }
        description.history = frames as u32;
    }
    let points = points(&fields)?;
    description.geometry = geometry(&fields, points.is_some())?;
    description.default = fields.optional_boolean("default")?.unwrap_or(true);
    if let Some(list) = fields.optional_table("parameters")? {
        description.parameters = parameters(&list)?;
    }
    check_description(&description)?;
    if let Some(values) = fields.optional_table("grows_with")? {
        description.grows_with = grows_with(&values, &description)?;
    }
    description.acts_on = match function {
        "observe" => ActsOn::Observation,
        "actuate" => ActsOn::Control,
        _ => ActsOn::Frame,
    };
    if mask && description.history > 0 {
        return Err(Error::new("a mask sees one frame at a time; leave `history` out"));
    }
    if function != "apply" && (points.is_some() || !description.geometry.is_undeclared()) {
        let what = if mask { "a mask" } else { "what does not change frames" };
        return Err(Error::new(format!(
            "{what} moves nothing; leave `geometry`, `move_point` and `source_point` out"
        )));
    }
    match fields.get(function)? {
        Value::Function(apply) => Ok(Declaration { description, apply, points }),
        Value::Nil => {
            Err(Error::new("the perturbation has no `apply`; add apply = function(image, cx) ... end"))
        }
        other => Err(fields.wrong(function, "a function", &other)),
    }
}

/// How it moves points, if it says so.
fn points(fields: &Fields<'_>) -> Result<Option<Points>> {
    let function = |name: &str| match fields.get(name)? {
        Value::Nil => Ok(None),
        Value::Function(function) => Ok(Some(function)),
        other => Err(fields.wrong(name, "a function", &other)),
    };
    match (function("move_point")?, function("source_point")?) {
        (Some(move_point), source_point) => Ok(Some(Points { move_point, source_point })),
        (None, None) => Ok(None),
        (None, Some(_)) => Err(Error::new(
            "the perturbation has `source_point` without `move_point`; add move_point = function(x, y, width, height, cx) ... end",
        )),
    }
}

/// What it does to the places of things.
fn geometry(fields: &Fields<'_>, moves: bool) -> Result<Geometry> {
    match (fields.optional_text("geometry")?.as_deref(), moves) {
        (None | Some("moved"), true) => Ok(Geometry::Moved),
        (None, false) => Ok(Geometry::Undeclared),
        (Some("kept"), false) => Ok(Geometry::Kept),
        (Some("altered"), false) => Ok(Geometry::Altered),
        (Some("moved"), false) => Err(Error::new(
            "`geometry` of the perturbation is \"moved\", but nothing says where to; add move_point = function(x, y, width, height, cx) ... end",
        )),
        (Some(other @ ("kept" | "altered")), true) => Err(Error::new(format!(
            "`geometry` of the perturbation is \"{other}\", but it has `move_point`; leave one out"
        ))),
        (Some(other), _) => Err(Error::new(format!(
            "`geometry` of the perturbation is \"{other}\", but has to be \"kept\", \"moved\" or \"altered\""
        ))),
    }
}

/// A sentence or a list of them.
fn divergences(fields: &Fields<'_>) -> Result<Vec<String>> {
    let wrong = |found: &Value| fields.wrong("divergence", "a text or a list of texts", found);
    let list = match fields.get("divergence")? {
        Value::Nil => return Ok(Vec::new()),
        Value::String(_) => return Ok(vec![fields.optional_line("divergence")?]),
        Value::Table(list) => list,
        other => return Err(wrong(&other)),
    };
    let count = list.raw_len();
    if count > MOST_ENTRIES || list.pairs::<Value, Value>().count() != count {
        return Err(wrong(&Value::Table(list)));
    }
    (1..=count)
        .map(|index| match list.raw_get(index).map_err(unreadable)? {
            Value::String(text) => one_line(text.to_string_lossy()).ok_or_else(|| {
                Error::new(format!("`divergence` {index} of the perturbation has to be one line of text"))
            }),
            other => Err(wrong(&other)),
        })
        .collect()
}

/// Values of the perturbation's own parameters.
fn grows_with(
    table: &Table,
    description: &Description,
) -> Result<serde_json::Map<String, serde_json::Value>> {
    let mut values = serde_json::Map::new();
    for parameter in &description.parameters {
        let value = match table.raw_get::<Value>(parameter.name.as_str()).map_err(unreadable)? {
            Value::Nil => continue,
            Value::Boolean(value) => value.into(),
            Value::String(text) => text.to_string_lossy().into(),
            Value::Table(list) => {
                levels(&list, &format!("`{}` in `grows_with`", parameter.name))?.to_vec().into()
            }
            other => finite(&other)
                .ok_or_else(|| {
                    Error::new(format!(
                        "`{}` in `grows_with` is {}, but has to be a value of that parameter",
                        parameter.name,
                        describe(&other)
                    ))
                })?
                .into(),
        };
        values.insert(parameter.name.clone(), value);
    }
    for pair in table.pairs::<Value, Value>() {
        let name = match pair.map_err(unreadable)?.0 {
            Value::String(name) => name.to_string_lossy(),
            other => describe(&other),
        };
        if !values.contains_key(&name) {
            let hint = suggest::hint(&name, description.parameters.iter().map(|p| p.name.as_str()));
            return Err(Error::new(format!("`grows_with` names no parameter with `{name}`; {hint}")));
        }
    }
    Config::check(description, &values).map_err(|error| error.at("`grows_with`"))?;
    Ok(values)
}
