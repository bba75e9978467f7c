//! The fields of a table that a pipeline wrote, taken one by one, so that an error names the table and the field and says
//! what belongs there.

use pdk_model::scenario::LARGEST_SEED;
use pdk_sdk::error::{Error, Result};
use serde_json::{Map, Value};

use pdk_sdk::suggest;

/// A table whose fields are taken.
pub struct Fields {
    /// What errors call the table.
    table: String,
    fields: Map<String, Value>,
}

impl Fields {
    /// The fields of a table; `table` is what errors call it.
    ///
    /// # Errors
    /// If it is not a table, or has a field that is not among `known`.
    pub fn new(table: impl Into<String>, value: Value, known: &[&str]) -> Result<Self> {
        let table = table.into();
        let fields = match value {
            Value::Object(fields) => fields,
            // An empty Lua table.
            Value::Array(list) if list.is_empty() => Map::new(),
            other => {
                return Err(Error::new(format!(
                    "{table}: {other} is not a table; write {{ field = value, ... }}"
                )));
            }
        };
        if let Some(unknown) = fields.keys().find(|field| !known.contains(&field.as_str())) {
            return Err(Error::new(format!(
                "{table}: there is no field `{unknown}`; {}",
                suggest::hint(unknown, known.iter().copied())
            )));
        }
        Ok(Self { table, fields })
    }

    /// What errors call the table.
    pub fn table(&self) -> &str {
        &self.table
    }

    /// What a text in a field stands for.
    ///
    /// # Errors
    /// If it stands for nothing, with the table.
    pub fn read<T: std::str::FromStr<Err = Error>>(&self, text: &str) -> Result<T> {
        text.parse().map_err(|error: Error| error.at(&self.table))
    }

    /// Whether a field is set.
    pub fn has(&self, field: &str) -> bool {
        self.fields.get(field).is_some_and(|value| !value.is_null())
    }

    /// A field of any type; null if it is not set.
    pub fn any(&mut self, field: &str) -> Value {
        self.fields.shift_remove(field).unwrap_or_default()
    }

    /// A field of any type.
    ///
    /// # Errors
    /// If it is not set.
    pub fn needed(&mut self, field: &str) -> Result<Value> {
        match self.any(field) {
            Value::Null => Err(Error::new(format!("{}: `{field}` is missing", self.table))),
            value => Ok(value),
        }
    }

    /// A field with a list; none if it is not set.
    ///
    /// # Errors
    /// If it is not a list.
    pub fn list(&mut self, field: &str) -> Result<Option<Vec<Value>>> {
        match self.any(field) {
            Value::Null => Ok(None),
            Value::Array(list) => Ok(Some(list)),
            other => Err(self.wrong(field, &other, "a list: { ... }")),
        }
    }

    /// A field with a list that has at least one entry.
    ///
    /// # Errors
    /// If it is none.
    pub fn filled_list(&mut self, field: &str) -> Result<Vec<Value>> {
        match self.list(field)? {
            None => Err(Error::new(format!("{}: `{field}` is missing", self.table))),
            Some(list) if list.is_empty() => {
                Err(Error::new(format!("{}: `{field}` is empty; give it at least one entry", self.table)))
            }
            Some(list) => Ok(list),
        }
    }

    /// A field with a number; none if it is not set.
    ///
    /// # Errors
    /// If it is not a number.
    pub fn number(&mut self, field: &str) -> Result<Option<f64>> {
        match self.any(field) {
            Value::Null => Ok(None),
            other => other.as_f64().map(Some).ok_or_else(|| self.wrong(field, &other, "a number")),
        }
    }

    /// A field with a whole number of at least 0; none if it is not set.
    ///
    /// # Errors
    /// If it is none.
    pub fn whole(&mut self, field: &str) -> Result<Option<u64>> {
        match self.any(field) {
            Value::Null => Ok(None),
            other => {
                let wrong = || self.wrong(field, &other, "a whole number of at least 0");
                other.as_u64().map(Some).ok_or_else(wrong)
            }
        }
    }

    /// A field with a seed; none if it is not set.
    ///
    /// # Errors
    /// If it is not one.
    pub fn seed(&mut self, field: &str) -> Result<Option<u64>> {
        match self.any(field) {
            Value::Null => Ok(None),
            other => match other.as_u64().filter(|seed| *seed <= LARGEST_SEED) {
                Some(seed) => Ok(Some(seed)),
                None => Err(self.wrong(
                    field,
                    &other,
                    &format!("a whole number from 0 to {LARGEST_SEED}, which every language keeps exactly"),
                )),
            },
        }
    }

    /// A field that is true or false; none if it is not set.
    ///
    /// # Errors
    /// If it is neither.
    pub fn truth(&mut self, field: &str) -> Result<Option<bool>> {
        match self.any(field) {
            Value::Null => Ok(None),
            Value::Bool(truth) => Ok(Some(truth)),
            other => Err(self.wrong(field, &other, "true or false")),
        }
    }

    /// A field with a text; none if it is not set.
    ///
    /// # Errors
    /// If it is not text.
    pub fn text(&mut self, field: &str) -> Result<Option<String>> {
        match self.any(field) {
            Value::Null => Ok(None),
            Value::String(text) => Ok(Some(text)),
            other => Err(self.wrong(field, &other, "a text")),
        }
    }

    fn wrong(&self, field: &str, value: &Value, expected: &str) -> Error {
        Error::new(format!("{}: `{field}` is {value}, but has to be {expected}", self.table))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn mistakes_are_reported_with_their_place() {
        let known = ["list", "number", "whole", "text", "empty"];
        let wrong = json!({"list": "a", "number": "b", "whole": -1, "text": 3, "empty": []});
        let mut fields = Fields::new("pdk.x", wrong, &known).unwrap();
        let sentences = [
            fields.list("list").unwrap_err(),
            fields.number("number").unwrap_err(),
            fields.whole("whole").unwrap_err(),
            fields.text("text").unwrap_err(),
            fields.filled_list("empty").unwrap_err(),
            fields.needed("list").unwrap_err(),
        ]
        .map(|error| error.to_string());
        assert_eq!(
            sentences,
            [
                "pdk.x: `list` is \"a\", but has to be a list: { ... }",
                "pdk.x: `number` is \"b\", but has to be a number",
                "pdk.x: `whole` is -1, but has to be a whole number of at least 0",
                "pdk.x: `text` is 3, but has to be a text",
                "pdk.x: `empty` is empty; give it at least one entry",
                "pdk.x: `list` is missing",
            ]
        );
        let unknown = |value| Fields::new("pdk.x", value, &known).err().unwrap().to_string();
        assert_eq!(unknown(json!({"numbr": 1})), "pdk.x: there is no field `numbr`; did you mean `number`?");
        assert_eq!(unknown(json!(7)), "pdk.x: 7 is not a table; write { field = value, ... }");
    }

    #[test]
    fn what_is_not_set_is_none() {
        let mut fields = Fields::new("pdk.x", json!([]), &["list", "whole"]).unwrap();
        assert_eq!((fields.list("list").unwrap(), fields.whole("whole").unwrap()), (None, None));
    }
}
