//! Texts within a JSON value that are put in the places of others, such as the contents of files in those of their names.

use serde_json::Value;

/// Puts what `other` returns for a text in its place, at any depth; keys stay.
pub(crate) fn replace(value: &mut Value, other: &dyn Fn(&str) -> Option<String>) {
    match value {
        Value::String(text) => {
            if let Some(other) = other(text) {
                *text = other;
            }
        }
        Value::Array(items) => items.iter_mut().for_each(|item| replace(item, other)),
        Value::Object(fields) => fields.values_mut().for_each(|value| replace(value, other)),
        _ => {}
    }
}
