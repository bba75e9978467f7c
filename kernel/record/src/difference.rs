//! How a value differs from a recorded one.

use std::collections::BTreeSet;
use std::fmt::Display;

use serde_json::{Map, Value};

/// A clause about a value that was another one.
pub(crate) fn differs(what: &str, was: &dyn Display, is: &dyn Display) -> String {
    format!("{what} was {was} and is {is}")
}

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
