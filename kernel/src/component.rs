//! A component as a pipeline names it: a name, or a table with a name and parameters.

use pdk_sdk::error::{Error, Result};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

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
    /// Reads a text, or a table with `name` and parameters.
    ///
    /// # Errors
    /// Where it is neither; `what` is what the error calls it.
    pub fn from_json(what: &str, value: &Value) -> Result<Self> {
        match value {
            Value::String(name) => Ok(Self { name: name.clone(), parameters: Map::new() }),
            Value::Object(table) => {
                let mut parameters = table.clone();
                match parameters.shift_remove("name") {
                    Some(Value::String(name)) => Ok(Self { name, parameters }),
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
