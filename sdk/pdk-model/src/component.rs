//! A component as the user names it: a name, or a table with a name and parameters.

use std::fmt;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::error::{Error, Result};
use crate::text::{parse_value, split_outside_brackets};

/// The parameter by which a component that runs a network names the engine that runs it.
pub const ENGINE: &str = "engine";

/// A component with the parameters that the user sets.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct ComponentSpec {
    /// The component's name.
    pub name: String,
    /// Its parameters.
    #[serde(default, skip_serializing_if = "Map::is_empty")]
    pub parameters: Map<String, Value>,
}

impl ComponentSpec {
    /// A component with its defaults.
    pub fn new(name: impl Into<String>) -> Self {
        Self { name: name.into(), parameters: Map::new() }
    }

    /// Reads `NAME` with parameters behind it, as on the command line: `NAME,key=value,...`; `what` is what the error calls it.
    ///
    /// # Errors
    /// If there is no name, or a parameter has no value.
    pub fn parse(what: &str, text: &str) -> Result<Self> {
        let mut parts = split_outside_brackets(text).into_iter();
        let name = parts.next().unwrap_or_default();
        if name.is_empty() {
            return Err(Error::new(format!("`{text}` names no {what}; write NAME or NAME,PARAMETER=VALUE")));
        }
        let mut parameters = Map::new();
        for part in parts {
            let Some((key, value)) = part.split_once('=').filter(|(key, _)| !key.is_empty()) else {
                let sentence = format!("`{part}` of {what} `{name}` has no value; write PARAMETER=VALUE");
                return Err(Error::new(sentence));
            };
            if parameters.insert(key.to_owned(), parse_value(value)?).is_some() {
                return Err(Error::new(format!("`{text}` sets `{key}` twice; leave one out")));
            }
        }
        check_values(name, &parameters)?;
        Ok(Self { name: name.to_owned(), parameters })
    }

    /// Reads a text, or a table with `name` and parameters, which stand beside the name or, as in records, in a table
    /// `parameters`.
    ///
    /// # Errors
    /// If it is neither, or a parameter has no value; `what` is what the error calls it.
    pub fn from_json(what: &str, value: &Value) -> Result<Self> {
        match value {
            Value::String(name) => Ok(Self::new(name.as_str())),
            Value::Object(table) => {
                let mut parameters = table.clone();
                match parameters.shift_remove("name") {
                    Some(Value::String(name)) => {
                        unfold(&name, &mut parameters)?;
                        check_values(&name, &parameters)?;
                        Ok(Self { name, parameters })
                    }
                    _ => Err(Error::new(format!(
                        "`{what}` has no `name`; write {what} = {{ name = \"...\", ... }}"
                    ))),
                }
            }
            other => Err(Error::new(format!(
                "`{what}` is {other}, but has to be a name or a table {{ name = \"...\", ... }}"
            ))),
        }
    }
}

impl fmt::Display for ComponentSpec {
    /// For people: `lane (light=dusk)`.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)?;
        let settings: Vec<_> = self
            .parameters
            .iter()
            .map(|(key, value)| match value.as_str() {
                Some(text) => format!("{key}={text}"),
                None => format!("{key}={value}"),
            })
            .collect();
        if settings.is_empty() { Ok(()) } else { write!(f, " ({})", settings.join(", ")) }
    }
}

/// Moves what stands in a table `parameters`, as records have it, to where users write it.
pub(crate) fn unfold(name: &str, table: &mut Map<String, Value>) -> Result<()> {
    let Some(Value::Object(parameters)) = table.get("parameters").cloned() else { return Ok(()) };
    table.shift_remove("parameters");
    for (key, value) in parameters {
        if table.insert(key.clone(), value).is_some() {
            return Err(Error::new(format!(
                "`{key}` of `{name}` is set twice, beside the name and in `parameters`; leave one out"
            )));
        }
    }
    Ok(())
}

/// Refuses parameters that have no value: a number that is not finite arrives as null, and would pass for one that is not set.
pub(crate) fn check_values(name: &str, parameters: &Map<String, Value>) -> Result<()> {
    match parameters.iter().find(|(_, value)| value.is_null()) {
        Some((key, _)) => Err(without_value(name, key)),
        None => Ok(()),
    }
}

/// The error about something that is set to null.
pub(crate) fn without_value(name: &str, key: &str) -> Error {
    Error::new(format!(
        "`{key}` of `{name}` is null, which numbers become that are not finite; set it to a value or leave it out"
    ))
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn the_command_line_is_read_with_values_of_any_kind() {
        let spec = ComponentSpec::parse("driver", r#"onnx,model=a=b.onnx,throttle=.5,list=[1,2]"#).unwrap();
        assert_eq!(spec.name, "onnx");
        assert_eq!(
            serde_json::json!(spec.parameters),
            serde_json::json!({"model": "a=b.onnx", "throttle": 0.5, "list": [1, 2]})
        );
        assert_eq!(ComponentSpec::parse("driver", "grad-cam++").unwrap(), ComponentSpec::new("grad-cam++"));
        let error = |text| ComponentSpec::parse("driver", text).unwrap_err().to_string();
        assert_eq!(error(",a=1"), "`,a=1` names no driver; write NAME or NAME,PARAMETER=VALUE");
        assert_eq!(error("onnx,model"), "`model` of driver `onnx` has no value; write PARAMETER=VALUE");
    }

    #[test]
    fn a_name_or_a_table_is_read_and_told() {
        let read = |value: Value| ComponentSpec::from_json("driver", &value);
        assert_eq!(read(json!("lane")).unwrap(), ComponentSpec::new("lane"));
        assert_eq!(read(json!("lane")).unwrap().to_string(), "lane");
        let spec = read(json!({"light": "dusk", "name": "lane", "rate": 30})).unwrap();
        assert_eq!(spec.to_string(), "lane (light=dusk, rate=30)");
        assert_eq!(
            read(json!({"rate": 30})).unwrap_err().message(),
            "`driver` has no `name`; write driver = { name = \"...\", ... }"
        );
        assert_eq!(
            read(json!(3)).unwrap_err().message(),
            "`driver` is 3, but has to be a name or a table { name = \"...\", ... }"
        );
        // As records have it, and both.
        let recorded = serde_json::to_value(&spec).unwrap();
        assert_eq!(recorded, json!({"name": "lane", "parameters": {"light": "dusk", "rate": 30}}));
        assert_eq!(read(recorded).unwrap(), spec);
        assert_eq!(
            read(json!({"name": "lane", "rate": 30, "parameters": {"rate": 20}})).unwrap_err().message(),
            "`rate` of `lane` is set twice, beside the name and in `parameters`; leave one out"
        );
        let error = read(json!({"name": "lane", "rate": f64::NAN})).unwrap_err();
        assert!(error.message().starts_with("`rate` of `lane` is null"), "{error}");
    }
}
