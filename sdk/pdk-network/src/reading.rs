//! What the fields of a description have in common when they are read.

use pdk_sdk::error::Result;
use pdk_sdk::serde_json::{Map, Value};

use crate::given::{Given, mistake};
use crate::suggest::hint;

/// A number, or a list of numbers.
pub(crate) fn numbers(value: &Value) -> Option<Vec<f64>> {
    match value {
        Value::Array(list) => list.iter().map(Value::as_f64).collect(),
        value => Some(vec![value.as_f64()?]),
    }
}

/// A whole number that is not negative.
pub(crate) fn whole(value: &Value) -> Option<usize> {
    value
        .as_f64()
        .filter(|number| number.fract() == 0.0 && (0.0..1e9).contains(number))
        .map(|number| number as usize)
}

/// Refuses keys of a field's table that it does not have.
pub(crate) fn known(given: &Given, name: &str, table: &Map<String, Value>, keys: &[&str]) -> Result<()> {
    match table.keys().find(|key| !keys.contains(&key.as_str())) {
        None => Ok(()),
        Some(key) => {
            Err(given.wrong(name, format_args!("has no `{key}`; {}", hint(key, keys.iter().copied()))))
        }
    }
}

pub(crate) fn table<'a>(given: &'a Given, name: &str, form: &str) -> Result<Option<&'a Map<String, Value>>> {
    match given.get(name) {
        None => Ok(None),
        Some((Value::Object(table), _)) => Ok(Some(table)),
        Some((value, _)) => Err(given.wrong(name, format_args!("is {value}; write a table such as {form}"))),
    }
}

/// Refuses names of inputs or outputs that the network does not have.
pub(crate) fn refuse_unknown<'a>(
    given: &Given,
    field: &str,
    name: &str,
    what: &str,
    known: impl IntoIterator<Item = &'a str> + Clone,
) -> Result<()> {
    match known.clone().into_iter().any(|known| known == name) {
        true => Ok(()),
        false => {
            let hint = hint(name, known);
            let place = given.get(field).map_or("", |(_, place)| place);
            Err(mistake(format!(
                "{place}: `{field}` names the {what} `{name}`, which the network does not have; {hint}"
            )))
        }
    }
}
