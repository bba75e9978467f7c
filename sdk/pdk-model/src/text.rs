//! Values as people and programs write them.

use std::fmt;

use serde::de::{Deserialize, Deserializer, Error as _, MapAccess, SeqAccess, Visitor};
use serde_json::{Map, Value};

use crate::error::{Error, Result};

/// A value from the command line: JSON if it is JSON, a number also as people write it, else a text.
///
/// # Errors
/// If it is JSON in which a table has the same key twice.
pub fn parse_value(text: &str) -> Result<Value> {
    Ok(parse_json(text)?.unwrap_or_else(|| Value::String(text.to_owned())))
}

/// A value from the command line that is not a plain text: JSON, or a number as people write it.
///
/// # Errors
/// As [`parse_value`].
pub fn parse_json(text: &str) -> Result<Option<Value>> {
    match serde_json::from_str::<Unique>(text) {
        Ok(Unique(value)) => Ok(Some(value)),
        Err(error) if error.is_data() => Err(Error::new(format!("`{text}`: {error}"))),
        Err(_) => Ok(number(text)),
    }
}

/// A value in which no table has the same key twice. Readers of JSON take the last one without a word, and the writer meant another.
#[derive(Debug, Clone, PartialEq)]
pub struct Unique(pub Value);

impl<'de> Deserialize<'de> for Unique {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        deserializer.deserialize_any(Reader)
    }
}

struct Reader;

impl<'de> Visitor<'de> for Reader {
    type Value = Unique;

    fn expecting(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        formatter.write_str("a value")
    }

    fn visit_unit<E>(self) -> Result<Unique, E> {
        Ok(Unique(Value::Null))
    }

    fn visit_bool<E>(self, value: bool) -> Result<Unique, E> {
        Ok(Unique(value.into()))
    }

    fn visit_i64<E>(self, value: i64) -> Result<Unique, E> {
        Ok(Unique(value.into()))
    }

    fn visit_u64<E>(self, value: u64) -> Result<Unique, E> {
        Ok(Unique(value.into()))
    }

    fn visit_f64<E>(self, value: f64) -> Result<Unique, E> {
        Ok(Unique(value.into()))
    }

    fn visit_str<E>(self, value: &str) -> Result<Unique, E> {
        Ok(Unique(value.into()))
    }

    fn visit_string<E>(self, value: String) -> Result<Unique, E> {
        Ok(Unique(value.into()))
    }

    fn visit_seq<A: SeqAccess<'de>>(self, mut list: A) -> Result<Unique, A::Error> {
        let mut values = Vec::new();
        while let Some(Unique(value)) = list.next_element()? {
            values.push(value);
        }
        Ok(Unique(Value::Array(values)))
    }

    fn visit_map<A: MapAccess<'de>>(self, mut table: A) -> Result<Unique, A::Error> {
        let mut values = Map::new();
        while let Some(key) = table.next_key::<String>()? {
            if values.contains_key(&key) {
                return Err(A::Error::custom(format_args!("the key `{key}` occurs twice; write it once")));
            }
            let Unique(value) = table.next_value()?;
            values.insert(key, value);
        }
        Ok(Unique(Value::Object(values)))
    }
}

/// A number that JSON does not know as one: `.5`, `-.5`, `+2`, `3.`.
fn number(text: &str) -> Option<Value> {
    let unsigned = text.strip_prefix(['-', '+']).unwrap_or(text);
    let sign = if text.starts_with('-') { "-" } else { "" };
    let before = if unsigned.starts_with('.') { "0" } else { "" };
    let behind = if unsigned.ends_with('.') { "0" } else { "" };
    let digit = unsigned.starts_with(|c: char| c.is_ascii_digit() || c == '.') && unsigned != ".";
    let json = || serde_json::from_str(&format!("{sign}{before}{unsigned}{behind}")).ok();
    digit.then(json).flatten()
}

/// Splits at commas, except within brackets, braces and quotes, so that values may be JSON.
pub fn split_outside_brackets(text: &str) -> Vec<&str> {
    let (mut parts, mut start, mut depth, mut quoted) = (Vec::new(), 0, 0u32, false);
    for (position, c) in text.char_indices() {
        match c {
            '"' => quoted = !quoted,
            '[' | '{' if !quoted => depth += 1,
            ']' | '}' if !quoted => depth = depth.saturating_sub(1),
            ',' if depth == 0 && !quoted => {
                parts.push(&text[start..position]);
                start = position + 1;
            }
            _ => {}
        }
    }
    parts.push(&text[start..]);
    parts
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn numbers_are_read_as_people_write_them() {
        for (text, number) in [
            (".5", 0.5),
            ("-.5", -0.5),
            ("+2", 2.0),
            ("3.", 3.0),
            ("+.25", 0.25),
            ("1e-3", 0.001),
            ("-4", -4.0),
        ] {
            assert_eq!(parse_value(text).unwrap().as_f64(), Some(number), "{text}");
        }
        for text in
            ["", ".", "-", "+", "-.", "..5", "5..", "+-1", "1.2.3", "007", "nan", "inf", "a.", ".a", "1,5"]
        {
            assert_eq!(parse_value(text).unwrap(), json!(text));
        }
    }

    #[test]
    fn a_key_that_is_there_twice_is_refused_wherever_it_stands() {
        let whole = r#"{"a":[1,-2,2.5,null,true,"x",{"b":18446744073709551615}],"c":{"a":1}}"#;
        assert_eq!(parse_value(whole).unwrap(), serde_json::from_str::<Value>(whole).unwrap());
        for text in [r#"{"a":1,"a":1}"#, r#"[{"b":{"a":1,"c":2,"a":3}}]"#, r#"{"a":1,"\u0061":2}"#] {
            let error = parse_value(text).unwrap_err().to_string();
            assert!(error.contains("the key `a` occurs twice; write it once"), "{error}");
        }
        assert_eq!(parse_value(r#"{"a":1,"a"#).unwrap(), json!(r#"{"a":1,"a"#));
    }

    #[test]
    fn commas_within_values_do_not_split() {
        assert_eq!(split_outside_brackets(r#"a,b=[1,2],c={"d":[3,"}"]},e"#).len(), 4);
        assert_eq!(split_outside_brackets(""), [""]);
    }
}
