//! JSON values: where two of them differ, and texts within them.

use std::collections::BTreeSet;

use serde_json::{Map, Value};

/// The first value within another that differs, with its place and both values; what is not there is null.
pub fn difference(place: &str, was: &Value, is: &Value) -> Option<(String, Value, Value)> {
    if let (Value::Object(was), Value::Object(is)) = (was, is) {
        let names: BTreeSet<&String> = was.keys().chain(is.keys()).collect();
        return names.into_iter().find_map(|name| {
            let place = if place.is_empty() { name.clone() } else { format!("{place}.{name}") };
            let value = |table: &Map<String, Value>| table.get(name).cloned().unwrap_or_default();
            difference(&place, &value(was), &value(is))
        });
    }
    if let (Value::Array(was), Value::Array(is)) = (was, is)
        && was.len() == is.len()
    {
        let mut pairs = was.iter().zip(is).enumerate();
        return pairs.find_map(|(position, (was, is))| difference(&format!("{place}[{position}]"), was, is));
    }
    (was != is).then(|| (format!("`{place}`"), was.clone(), is.clone()))
}

/// Puts what `other` returns for a text in its place, at any depth, such as the contents of files in those of their names; keys stay.
pub fn replace(value: &mut Value, other: &dyn Fn(&str) -> Option<String>) {
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
