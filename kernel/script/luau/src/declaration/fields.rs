//! Typed access to the fields of a table that a script wrote, with errors that name the field.

use mlua::{Table, Value};
use pdk_sdk::error::{Error, Result};

use crate::api::ApiRecord;
use crate::failure::type_of;
use pdk_sdk::suggest;

/// Typed access to the fields of a table.
pub(super) struct Fields<'a> {
    pub table: &'a Table,
    /// What the table is, for errors.
    pub of: &'a str,
    pub record: &'a ApiRecord,
}

impl Fields<'_> {
    pub(super) fn refuse_unknown(&self) -> Result<()> {
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
                let known: Vec<&str> = self.record.names().collect();
                let remedy = suggest::hint(&name, known.iter().copied());
                return Err(Error::new(format!("{} has an unknown field `{name}`; {remedy}", self.of)));
            }
        }
        Ok(())
    }

    pub(super) fn get(&self, name: &str) -> Result<Value> {
        self.table.raw_get(name).map_err(unreadable)
    }

    pub(super) fn wrong(&self, name: &str, expected: &str, found: &Value) -> Error {
        if found.is_nil() {
            return Error::new(format!("{} has no `{name}`, which has to be {expected}", self.of));
        }
        Error::new(format!("`{name}` of {} is {}, but has to be {expected}", self.of, describe(found)))
    }

    pub(super) fn optional_text(&self, name: &str) -> Result<Option<String>> {
        match self.get(name)? {
            Value::Nil => Ok(None),
            Value::String(text) => Ok(Some(text.to_string_lossy())),
            other => Err(self.wrong(name, "a text", &other)),
        }
    }

    pub(super) fn text(&self, name: &str) -> Result<String> {
        self.optional_text(name)?.ok_or_else(|| self.wrong(name, "a text", &Value::Nil))
    }

    /// A text of one line.
    pub(super) fn line(&self, name: &str) -> Result<String> {
        one_line(self.text(name)?)
            .ok_or_else(|| Error::new(format!("`{name}` of {} has to be one line of text", self.of)))
    }

    /// A text of one line, or an empty one if it is left out.
    pub(super) fn optional_line(&self, name: &str) -> Result<String> {
        if self.get(name)?.is_nil() { Ok(String::new()) } else { self.line(name) }
    }

    pub(super) fn optional_number(&self, name: &str) -> Result<Option<f64>> {
        match self.get(name)? {
            Value::Nil => Ok(None),
            value => finite(&value).map(Some).ok_or_else(|| self.wrong(name, "a number", &value)),
        }
    }

    pub(super) fn optional_boolean(&self, name: &str) -> Result<Option<bool>> {
        match self.get(name)? {
            Value::Nil => Ok(None),
            Value::Boolean(value) => Ok(Some(value)),
            other => Err(self.wrong(name, "true or false", &other)),
        }
    }

    pub(super) fn optional_table(&self, name: &str) -> Result<Option<Table>> {
        match self.get(name)? {
            Value::Nil => Ok(None),
            Value::Table(table) => Ok(Some(table)),
            other => Err(self.wrong(name, "a table", &other)),
        }
    }
}

pub(super) fn one_line(text: String) -> Option<String> {
    (!text.trim().is_empty() && !text.contains('\n')).then_some(text)
}

pub(super) fn unreadable(error: mlua::Error) -> Error {
    Error::new(format!("the table cannot be read: {error}"))
}

pub(super) fn finite(value: &Value) -> Option<f64> {
    match value {
        Value::Number(number) => Some(*number),
        Value::Integer(number) => Some(*number as f64),
        _ => None,
    }
    .filter(|number| number.is_finite())
}

/// A value as it is called in an error.
pub(super) fn describe(value: &Value) -> String {
    match value {
        Value::Boolean(value) => value.to_string(),
        Value::Integer(number) => number.to_string(),
        Value::Number(number) => number.to_string(),
        Value::String(text) if text.as_bytes().len() <= 40 => format!("\"{}\"", text.to_string_lossy()),
        other => type_of(other),
    }
}
