//! The table by which a script describes its perturbation.
//!
//! Everything is read without calling into the script, so that a table with a hostile metatable is only a table.

use mlua::{Function, Table, Value};
use pdk_sdk::describe::{Description, LEVELS, Parameter, ParameterType, Temporal};
use pdk_sdk::error::{Error, Result};
use pdk_sdk::serde_json;

use super::api::{ApiField, ApiRecord};
use super::failure::type_of;
use crate::{description, suggest};

/// The table that a script returns.
pub const PERTURBATION: ApiRecord = ApiRecord {
    name: "Perturbation",
    doc: "What the file of a perturbation returns.",
    fields: &[
        ApiField {
            name: "doc",
            luau_type: "string",
            doc: "One line that says what it does, without a full stop.",
        },
        ApiField {
            name: "apply",
            luau_type: "(image: Image, cx: Context) -> ()",
            doc: "Changes `image`, a copy of the camera's frame, in place. The result has to depend on the image and \
                  on `cx` alone, so that any frame can be computed again on its own.",
        },
        ApiField {
            name: "name",
            luau_type: "string?",
            doc: "Its name: lower-case letters, digits and underscores. The file's name where it is left out.",
        },
        ApiField {
            name: "family",
            luau_type: "string?",
            doc: "The family under which it is listed, such as \"noise\".",
        },
        ApiField { name: "source", luau_type: "string?", doc: "Where the algorithm comes from." },
        ApiField {
            name: "version",
            luau_type: "number?",
            doc: "Version of the algorithm, 1 where it is left out. Raise it with every change of the output.",
        },
        ApiField {
            name: "temporal",
            luau_type: "(\"static\" | \"dynamic\")?",
            doc: "Whether the effect moves over time; \"static\" where it is left out.",
        },
        ApiField {
            name: "default",
            luau_type: "boolean?",
            doc: "Whether it belongs to the default set; true where it is left out.",
        },
        ApiField { name: "parameters", luau_type: "{ Parameter }?", doc: "What a user can set." },
    ],
};

/// An entry of the table's `parameters`.
pub const PARAMETER: ApiRecord = ApiRecord {
    name: "Parameter",
    doc: "A parameter of a perturbation. It has either `levels`, and then follows the intensity, or a `default`.",
    fields: &[
        ApiField { name: "name", luau_type: "string", doc: "Its name, under which `cx` has its value." },
        ApiField { name: "doc", luau_type: "string", doc: "One line that says what it is." },
        ApiField {
            name: "levels",
            luau_type: "{ number }?",
            doc: "The values at the intensities 0, 1, 2, 3 and 4.",
        },
        ApiField {
            name: "default",
            luau_type: "(number | boolean | string)?",
            doc: "The value where the user sets none.",
        },
        ApiField {
            name: "type",
            luau_type: "(\"number\" | \"integer\" | \"boolean\" | \"choice\" | \"text\")?",
            doc: "Its type; follows from `levels`, `options` or `default` where it is left out.",
        },
        ApiField { name: "options", luau_type: "{ string }?", doc: "The values that a choice allows." },
        ApiField { name: "min", luau_type: "number?", doc: "The smallest value allowed." },
        ApiField { name: "max", luau_type: "number?", doc: "The largest value allowed." },
        ApiField { name: "unit", luau_type: "string?", doc: "Its unit." },
    ],
};

/// What `apply` is given beside the image. The parameters are there as well, each under its name.
pub const CONTEXT: ApiRecord = ApiRecord {
    name: "Context",
    doc: "What a perturbation knows about the frame at hand.",
    fields: &[
        ApiField {
            name: "intensity",
            luau_type: "number",
            doc: "The intensity: 0 to 4, any number in between.",
        },
        ApiField {
            name: "frame_index",
            luau_type: "number",
            doc: "The number of the frame in its sequence, from 0.",
        },
        ApiField {
            name: "time",
            luau_type: "number",
            doc: "Simulation time in seconds since the start of the sequence.",
        },
        ApiField {
            name: "frame_random",
            luau_type: "Random",
            doc: "Random numbers that are drawn anew for every frame.",
        },
        ApiField {
            name: "sequence_random",
            luau_type: "Random",
            doc: "Random numbers that are the same for all frames of a sequence.",
        },
        ApiField { name: "[string]", luau_type: "any", doc: "The parameters, each under its name." },
    ],
};

/// The most parameters a script can declare.
const MOST_PARAMETERS: usize = 64;

/// What a script returned, checked.
pub(super) struct Declaration {
    pub description: Description,
    pub apply: Function,
}

/// Checks what a script returned. `stem` is the name it has where it gives none.
///
/// # Errors
/// Names the field that is missing, unknown or of the wrong type.
pub(super) fn read(returned: &Value, stem: &str) -> Result<Declaration> {
    let Value::Table(table) = returned else {
        return Err(Error::new(format!(
            "the script returns {}, but has to return a table, as in return {{ doc = \"...\", apply = function(image, \
             cx) ... end }}",
            describe(returned)
        )));
    };
    let fields = Fields { table, of: "the perturbation", record: &PERTURBATION };
    fields.refuse_unknown()?;
    let name = fields.optional_text("name")?.unwrap_or_else(|| stem.to_owned());
    let mut description = Description::perturbation(&name, &fields.line("doc")?);
    description.family = fields.optional_text("family")?.unwrap_or_default();
    description.source = fields.optional_text("source")?.unwrap_or_default();
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
    description.default = fields.optional_boolean("default")?.unwrap_or(true);
    if let Some(list) = fields.optional_table("parameters")? {
        description.parameters = parameters(&list)?;
    }
    description::check(&description)?;
    match fields.get("apply")? {
        Value::Function(apply) => Ok(Declaration { description, apply }),
        Value::Nil => {
            Err(Error::new("the perturbation has no `apply`; add apply = function(image, cx) ... end"))
        }
        other => Err(fields.wrong("apply", "a function", &other)),
    }
}

fn parameters(list: &Table) -> Result<Vec<Parameter>> {
    let count = list.raw_len();
    if count > MOST_PARAMETERS {
        return Err(Error::new(format!("there are {count} parameters, but {MOST_PARAMETERS} are allowed")));
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
    let levels = fields.optional_table("levels")?.map(|table| levels(&table, &place)).transpose()?;
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
            "{place} needs `options` where its `type` is \"choice\", and only there"
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

fn levels(table: &Table, place: &str) -> Result<[f64; LEVELS]> {
    let wrong = || Error::new(format!("`levels` of {place} has to be a list of {LEVELS} numbers"));
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
    if count == 0 || count > MOST_PARAMETERS || table.pairs::<Value, Value>().count() != count {
        return Err(wrong());
    }
    (1..=count)
        .map(|index| match table.raw_get(index).map_err(unreadable)? {
            Value::String(text) => Ok(text.to_string_lossy()),
            _ => Err(wrong()),
        })
        .collect()
}

/// Typed access to the fields of a table.
struct Fields<'a> {
    table: &'a Table,
    /// What the table is, for errors.
    of: &'a str,
    record: &'a ApiRecord,
}

impl Fields<'_> {
    fn refuse_unknown(&self) -> Result<()> {
        for pair in self.table.pairs::<Value, Value>() {
            let (key, _) = pair.map_err(unreadable)?;
            let name = match &key {
                Value::String(text) => text.to_string_lossy(),
                other => {
                    return Err(Error::new(format!(
                        "{} has an entry whose key is {}; give it one of the names {}",
                        self.of,
                        describe(other),
                        self.record.names().collect::<Vec<_>>().join(", ")
                    )));
                }
            };
            if !self.record.names().any(|known| known == name) {
                let remedy = suggest::hint(&name, self.record.names());
                return Err(Error::new(format!("{} has an unknown field `{name}`; {remedy}", self.of)));
            }
        }
        Ok(())
    }

    fn get(&self, name: &str) -> Result<Value> {
        self.table.raw_get(name).map_err(unreadable)
    }

    fn wrong(&self, name: &str, expected: &str, found: &Value) -> Error {
        if found.is_nil() {
            return Error::new(format!("{} has no `{name}`, which has to be {expected}", self.of));
        }
        Error::new(format!("`{name}` of {} is {}, but has to be {expected}", self.of, describe(found)))
    }

    fn optional_text(&self, name: &str) -> Result<Option<String>> {
        match self.get(name)? {
            Value::Nil => Ok(None),
            Value::String(text) => Ok(Some(text.to_string_lossy())),
            other => Err(self.wrong(name, "a text", &other)),
        }
    }

    fn text(&self, name: &str) -> Result<String> {
        self.optional_text(name)?.ok_or_else(|| self.wrong(name, "a text", &Value::Nil))
    }

    /// A text of one line.
    fn line(&self, name: &str) -> Result<String> {
        let text = self.text(name)?;
        if text.trim().is_empty() || text.contains('\n') {
            return Err(Error::new(format!("`{name}` of {} has to be one line of text", self.of)));
        }
        Ok(text)
    }

    fn optional_number(&self, name: &str) -> Result<Option<f64>> {
        match self.get(name)? {
            Value::Nil => Ok(None),
            value => finite(&value).map(Some).ok_or_else(|| self.wrong(name, "a number", &value)),
        }
    }

    fn optional_boolean(&self, name: &str) -> Result<Option<bool>> {
        match self.get(name)? {
            Value::Nil => Ok(None),
            Value::Boolean(value) => Ok(Some(value)),
            other => Err(self.wrong(name, "true or false", &other)),
        }
    }

    fn optional_table(&self, name: &str) -> Result<Option<Table>> {
        match self.get(name)? {
            Value::Nil => Ok(None),
            Value::Table(table) => Ok(Some(table)),
            other => Err(self.wrong(name, "a table", &other)),
        }
    }
}

fn unreadable(error: mlua::Error) -> Error {
    Error::new(format!("the table cannot be read: {error}"))
}

fn finite(value: &Value) -> Option<f64> {
    match value {
        Value::Number(number) => Some(*number),
        Value::Integer(number) => Some(*number as f64),
        _ => None,
    }
    .filter(|number| number.is_finite())
}

/// A value as it is called in an error.
fn describe(value: &Value) -> String {
    match value {
        Value::Boolean(value) => value.to_string(),
        Value::Integer(number) => number.to_string(),
        Value::Number(number) => number.to_string(),
        Value::String(text) if text.as_bytes().len() <= 40 => format!("\"{}\"", text.to_string_lossy()),
        other => type_of(other),
    }
}
