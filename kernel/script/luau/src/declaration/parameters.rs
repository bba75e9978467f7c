//! The parameters that a script declares.

use mlua::{Table, Value};
use pdk_sdk::describe::{LEVELS, Parameter, ParameterType};
use pdk_sdk::error::{Error, Result};
use pdk_sdk::serde_json;

use super::fields::{Fields, describe, finite, unreadable};
use super::records::{CONTEXT, PARAMETER};

/// The most parameters, options of a choice, or sentences that a script can declare.
pub(super) const MOST_ENTRIES: usize = 64;

/// Reads the list `parameters`.
///
/// # Errors
/// Names the parameter and the field that is missing, unknown or of the wrong type.
pub(super) fn parameters(list: &Table) -> Result<Vec<Parameter>> {
    let count = list.raw_len();
    if count > MOST_ENTRIES {
        return Err(Error::new(format!("there are {count} parameters, but {MOST_ENTRIES} are allowed")));
    }
    let entries = list.pairs::<Value, Value>().count();
    if entries != count {
        return Err(Error::new(
            "`parameters` has to be a list, as in parameters = { { name = \"strength\", ... }, ... }",
        ));
    }
    let mut parameters = Vec::<Parameter>::with_capacity(count);
    for index in 1..=count {
        let entry: Value = list.raw_get(index).map_err(unreadable)?;
        let Value::Table(entry) = &entry else {
            return Err(Error::new(format!(
                "parameter {index} is {}, but has to be a table, as in {{ name = \"strength\", doc = \"...\", default = \
                 1 }}",
                describe(&entry)
            )));
        };
        parameters.push(parameter(entry, &format!("parameter {index}"))?);
    }
    Ok(parameters)
}

fn parameter(table: &Table, place: &str) -> Result<Parameter> {
    let named = Fields { table, of: place, record: &PARAMETER };
    let name = named.text("name")?;
    let place = format!("parameter `{name}`");
    let fields = Fields { table, of: &place, record: &PARAMETER };
    fields.refuse_unknown()?;
    if CONTEXT.names().any(|reserved| reserved == name) {
        return Err(Error::new(format!(
            "a parameter cannot be named `{name}`, because cx.{name} is taken; rename it"
        )));
    }
    let doc = fields.line("doc")?;
    let default = fields.get("default")?;
    let levels = fields
        .optional_table("levels")?
        .map(|table| levels(&table, &format!("`levels` of {place}")))
        .transpose()?;
    let options = fields.optional_table("options")?.map(|table| options(&table, &place)).transpose()?;
    let kind = match fields.optional_text("type")? {
        Some(kind) => kind,
        None if levels.is_some() => "number".to_owned(),
        None if options.is_some() => "choice".to_owned(),
        None => match &default {
            Value::Number(_) | Value::Integer(_) => "number".to_owned(),
            Value::Boolean(_) => "boolean".to_owned(),
            Value::String(_) => "text".to_owned(),
            _ => return Err(Error::new(format!("{place} needs a `default` or `levels`"))),
        },
    };
    if levels.is_some() && kind != "number" {
        return Err(Error::new(format!("{place} has `levels`, so its `type` has to be \"number\"")));
    }
    if levels.is_some() && !default.is_nil() {
        return Err(Error::new(format!("{place} has both `levels` and a `default`; keep one of the two")));
    }
    if options.is_some() != (kind == "choice") {
        return Err(Error::new(format!(
            "{place} needs `options` if its `type` is \"choice\", and only then"
        )));
    }
    let needs_default = |expected: &str| fields.wrong("default", expected, &default);
    let mut parameter = match (kind.as_str(), &default) {
        ("number", _) if levels.is_some() => Parameter::by_level(&name, levels.unwrap_or_default(), &doc),
        ("number", value) => {
            let value = finite(value).ok_or_else(|| needs_default("a number"))?;
            Parameter::number(&name, value, &doc)
        }
        ("integer", value) => {
            let value = finite(value).filter(|v| v.fract() == 0.0 && v.abs() < 9.0e15);
            Parameter::integer(&name, value.ok_or_else(|| needs_default("a whole number"))? as i64, &doc)
        }
        ("boolean", Value::Boolean(value)) => Parameter::boolean(&name, *value, &doc),
        ("boolean", _) => return Err(needs_default("true or false")),
        ("choice", value) => {
            let options = options.unwrap_or_default();
            let options: Vec<&str> = options.iter().map(String::as_str).collect();
            let mut parameter = Parameter::choice(&name, &options, &doc);
            match value {
                Value::Nil => {}
                Value::String(text) if options.contains(&text.to_string_lossy().as_str()) => {
                    parameter.default = text.to_string_lossy().into();
                }
                _ => return Err(needs_default("one of its `options`")),
            }
            parameter
        }
        ("text", Value::String(text)) => {
            let mut parameter = Parameter::text(&name, &doc);
            parameter.default = serde_json::Value::String(text.to_string_lossy());
            parameter
        }
        ("text", Value::Nil) => Parameter::text(&name, &doc),
        ("text", _) => return Err(needs_default("a text")),
        (other, _) => {
            return Err(Error::new(format!(
                "`type` of {place} is \"{other}\", but has to be one of number, integer, boolean, choice, text"
            )));
        }
    };
    parameter.unit = fields.optional_text("unit")?.unwrap_or_default();
    let (min, max) = (fields.optional_number("min")?, fields.optional_number("max")?);
    set_range(&mut parameter, min, max).map_err(|error| error.at(&place))?;
    Ok(parameter)
}

fn set_range(parameter: &mut Parameter, min: Option<f64>, max: Option<f64>) -> Result<()> {
    if min.is_none() && max.is_none() {
        return Ok(());
    }
    let lowest = match parameter.kind {
        ParameterType::Number { .. } => (f64::MIN, f64::MAX),
        ParameterType::Integer { .. } => (i64::MIN as f64, i64::MAX as f64),
        _ => return Err(Error::new("only numbers have `min` and `max`")),
    };
    let (min, max) = (min.unwrap_or(lowest.0), max.unwrap_or(lowest.1));
    let values =
        parameter.levels.map_or_else(|| vec![parameter.default.as_f64().unwrap_or_default()], Vec::from);
    if let Some(outside) = values.iter().find(|value| !(min..=max).contains(*value)) {
        return Err(Error::new(format!("the value {outside} is not within its `min` and `max`")));
    }
    *parameter = parameter.clone().range(min, max);
    Ok(())
}

/// A number for each level; `what` is what an error calls them.
pub(super) fn levels(table: &Table, what: &str) -> Result<[f64; LEVELS]> {
    let wrong = || Error::new(format!("{what} has to be a list of {LEVELS} numbers"));
    if table.raw_len() != LEVELS || table.pairs::<Value, Value>().count() != LEVELS {
        return Err(wrong());
    }
    let mut levels = [0.0; LEVELS];
    for (index, level) in levels.iter_mut().enumerate() {
        let value: Value = table.raw_get(index + 1).map_err(unreadable)?;
        *level = finite(&value).ok_or_else(wrong)?;
    }
    Ok(levels)
}

fn options(table: &Table, place: &str) -> Result<Vec<String>> {
    let wrong = || Error::new(format!("`options` of {place} has to be a list of texts"));
    let count = table.raw_len();
    if count == 0 || count > MOST_ENTRIES || table.pairs::<Value, Value>().count() != count {
        return Err(wrong());
    }
    (1..=count)
        .map(|index| match table.raw_get(index).map_err(unreadable)? {
            Value::String(text) => Ok(text.to_string_lossy()),
            _ => Err(wrong()),
        })
        .collect()
}
