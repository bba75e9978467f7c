//! JSON on standard output. It may be read at a terminal, so it has nothing that a terminal would obey, and stays JSON nevertheless.

use std::fmt::Write;

/// Writes a JSON text and a line feed to standard output.
pub fn print(text: &str) {
    pdk_notice::bytes(format!("{}\n", escaped(text)).as_bytes());
}

/// A JSON text in which the characters that a terminal would obey are escaped, such as `\u009b`. They only occur in strings, so the value is the same.
fn escaped(text: &str) -> String {
    let mut shown = String::with_capacity(text.len());
    for c in text.chars() {
        match pdk_notice::is_obeyed(c) {
            // All of them are below U+10000, so four digits are enough. Writing to a text cannot fail.
            true => _ = write!(shown, "\\u{:04x}", u32::from(c)),
            false => shown.push(c),
        }
    }
    shown
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn json_stays_json_and_has_nothing_that_a_terminal_would_obey() {
        let plain = "{\n\t\"a\": \"Überraschung\"\n}";
        assert_eq!(escaped(plain), plain);
        let text = serde_json::to_string("\u{1b}\u{7f}\u{9b}\u{200e}\u{2069}").unwrap();
        assert_eq!(escaped(&text), r#""\u001b\u007f\u009b\u200e\u2069""#);
        assert_eq!(
            serde_json::from_str::<String>(&escaped(&text)).unwrap(),
            "\u{1b}\u{7f}\u{9b}\u{200e}\u{2069}"
        );
    }
}
