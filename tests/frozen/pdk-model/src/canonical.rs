//! JSON with one spelling for each value, so that equal values have equal hashes.

use std::fmt::Write;

use serde_json::{Number, Value};

/// Writes a value with its keys sorted, without spaces, without the fields of objects that are null, and with one spelling
/// for each number: 2, 2.0 and 2e0 are the same, and so are 0 and -0.
pub fn canonical(value: &Value) -> String {
    let mut text = String::new();
    write(value, &mut text);
    text
}

fn write(value: &Value, text: &mut String) {
    match value {
        Value::Number(number) => *text += &spelled(number),
        Value::Array(items) => {
            text.push('[');
            for (i, item) in items.iter().enumerate() {
                if i > 0 {
                    text.push(',');
                }
                write(item, text);
            }
            text.push(']');
        }
        Value::Object(fields) => {
            let mut fields: Vec<_> = fields.iter().filter(|(_, value)| !value.is_null()).collect();
            fields.sort_unstable_by_key(|(key, _)| *key);
            text.push('{');
            for (i, (key, value)) in fields.into_iter().enumerate() {
                if i > 0 {
                    text.push(',');
                }
                quote(key, text);
                text.push(':');
                write(value, text);
            }
            text.push('}');
        }
        Value::String(words) => quote(words, text),
        Value::Bool(true) => *text += "true",
        Value::Bool(false) => *text += "false",
        Value::Null => *text += "null",
    }
}

/// A whole number without point or exponent, however large; any other in the fewest digits that give it again.
fn spelled(number: &Number) -> String {
    /// Above this no whole number of JSON is read as one.
    const LARGEST: f64 = 18_446_744_073_709_551_616.0;
    match number.as_f64() {
        Some(float) if number.is_f64() => match float.fract() == 0.0 && float.abs() < LARGEST {
            // Exact, unlike the fewest digits; and without the sign of a zero.
            true => (float as i128).to_string(),
            false => float.to_string(),
        },
        _ => number.to_string(),
    }
}

fn quote(words: &str, text: &mut String) {
    text.push('"');
    for c in words.chars() {
        match c {
            '"' | '\\' => text.extend(['\\', c]),
            // Writing to a string does not fail.
            c if c < ' ' => _ = write!(text, "\\u{:04x}", u32::from(c)),
            c => text.push(c),
        }
    }
    text.push('"');
}
