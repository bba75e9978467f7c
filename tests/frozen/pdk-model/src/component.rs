//! A component as the user names it: a name, or a table with a name and parameters.

use std::fmt;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::error::{Error, Result};

/// A component with the parameters that the user sets.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
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

    /// Reads a text, or a table with `name` and parameters.
    ///
    /// # Errors
    /// Where it is neither, or a parameter has no value; `what` is what the error calls it.
    pub fn from_json(what: &str, value: &Value) -> Result<Self> {
        match value {
            Value::String(name) => Ok(Self::new(name.as_str())),
            Value::Object(table) => {
                let mut parameters = table.clone();
                match parameters.shift_remove("name") {
                    Some(Value::String(name)) => {
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

/// Refuses parameters that have no value: a number that is not finite arrives as null, and would pass for one that is not set.
pub(crate) fn check_values(name: &str, parameters: &Map<String, Value>) -> Result<()> {
    match parameters.iter().find(|(_, value)| value.is_null()) {
        Some((key, _)) => Err(without_value(name, key)),
        None => Ok(()),
    }
}

/// What is said of something that is set to null.
pub(crate) fn without_value(name: &str, key: &str) -> Error {
    Error::new(format!(
        "`{key}` of `{name}` is null, which numbers become that are not finite; set it to a value or leave it out"
    ))
}
