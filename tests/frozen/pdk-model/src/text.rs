//! Values as people write them on the command line.

use serde_json::Value;

/// A value from the command line: JSON where it is JSON, a number also as people write it, else a text.
pub fn parse_value(text: &str) -> Value {
    parse_json(text).unwrap_or_else(|| Value::String(text.to_owned()))
}

/// A value from the command line that is no plain text: JSON, or a number as people write it.
pub fn parse_json(text: &str) -> Option<Value> {
    serde_json::from_str(text).ok().or_else(|| number(text))
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
pub(crate) fn split_outside_brackets(text: &str) -> Vec<&str> {
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
