//! The table by which a script describes its perturbation.
//!
//! Everything is read without calling into the script, so that a table with a hostile metatable is only a table.

mod fields;
mod parameters;

use mlua::{Function, Table, Value};
use pdk_sdk::config::Config;
use pdk_sdk::describe::{Description, Temporal};
use pdk_sdk::error::{Error, Result};
use pdk_sdk::serde_json;

use super::api::{ApiField, ApiRecord};
use crate::{description, suggest};
use fields::{Fields, describe, finite, one_line, unreadable};
use parameters::{MOST_ENTRIES, levels, parameters};

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
        ApiField {
            name: "source",
            luau_type: "string?",
            doc: "Where the algorithm comes from: a paper, a standard or a model.",
        },
        ApiField {
            name: "mathematics",
            luau_type: "string?",
            doc: "What it computes, in one line of mathematics.",
        },
        ApiField {
            name: "draws_per_sequence",
            luau_type: "string?",
            doc: "What it draws once per sequence with `cx.sequence_random`, such as \"where drops sit\".",
        },
        ApiField {
            name: "draws_per_frame",
            luau_type: "string?",
            doc: "What it draws anew for every frame with `cx.frame_random`, such as \"the noise\".",
        },
        ApiField {
            name: "divergence",
            luau_type: "(string | { string })?",
            doc: "Where it differs from what was published, a sentence or a list of them.",
        },
        ApiField {
            name: "grows_with",
            luau_type: "{ [string]: number | boolean | string | { number } }?",
            doc: "Values of its parameters with which its strength grows with the intensity, where its levels are out of \
                  order; a list has a value for each level.",
        },
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
    description.default = fields.optional_boolean("default")?.unwrap_or(true);
    if let Some(list) = fields.optional_table("parameters")? {
        description.parameters = parameters(&list)?;
    }
    description::check(&description)?;
    if let Some(values) = fields.optional_table("grows_with")? {
        description.grows_with = grows_with(&values, &description)?;
    }
    match fields.get("apply")? {
        Value::Function(apply) => Ok(Declaration { description, apply }),
        Value::Nil => {
            Err(Error::new("the perturbation has no `apply`; add apply = function(image, cx) ... end"))
        }
        other => Err(fields.wrong("apply", "a function", &other)),
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
