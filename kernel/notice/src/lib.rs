//! Lines for people and scripts. The standard macros panic where a line cannot be written; these do not: a closed pipe
//! (`pdk list | head`) is not an error, and anything else is an error that is reported at the end.
//!
//! Lines hold what scripts, files and components are called and say. So what a terminal would obey is shown instead.

use std::borrow::Cow;
use std::collections::BTreeSet;
use std::fmt;
use std::io::{self, ErrorKind, Write};
use std::sync::{Mutex, PoisonError};

use pdk_sdk::error::{Error, Result};

/// The first error on standard output.
static FAILURE: Mutex<Option<io::Error>> = Mutex::new(None);

/// Stands in for the standard macro of the same name in all of pdk: `use pdk_notice::println`.
#[macro_export]
macro_rules! println {
    () => { $crate::line(format_args!("")) };
    ($($argument:tt)*) => { $crate::line(format_args!($($argument)*)) };
}

/// As above, for standard error.
#[macro_export]
macro_rules! eprintln {
    ($($argument:tt)*) => { $crate::error_line(format_args!($($argument)*)) };
}

/// Writes a line to standard output.
pub fn line(text: fmt::Arguments<'_>) {
    note(writeln!(io::stdout().lock(), "{}", printable(&text.to_string())));
}

/// Writes bytes to standard output, as they are.
pub fn bytes(bytes: &[u8]) {
    note(io::stdout().lock().write_all(bytes));
}

/// Writes a line to standard error. If that fails, the failure cannot be reported.
pub fn error_line(text: fmt::Arguments<'_>) {
    let _ = writeln!(io::stderr().lock(), "{}", printable(&text.to_string()));
}

/// Writes a line to standard error, unless this process has written the same one so before.
pub fn error_line_once(text: fmt::Arguments<'_>) {
    static WRITTEN: Mutex<BTreeSet<String>> = Mutex::new(BTreeSet::new());
    let text = text.to_string();
    if WRITTEN.lock().unwrap_or_else(PoisonError::into_inner).insert(text.clone()) {
        error_line(format_args!("{text}"));
    }
}

/// Whether a terminal would obey a character, or write others in another direction because of it. Line feeds and tabs stay.
pub fn is_obeyed(c: char) -> bool {
    c.is_control() && !matches!(c, '\n' | '\t')
        || matches!(c, '\u{61c}' | '\u{200e}' | '\u{200f}' | '\u{202a}'..='\u{202e}' | '\u{2066}'..='\u{2069}')
}

/// A text in which the characters that a terminal would obey are written out, such as `\u{1b}`.
pub fn printable(text: &str) -> Cow<'_, str> {
    if !text.contains(is_obeyed) {
        return Cow::Borrowed(text);
    }
    let mut shown = String::with_capacity(text.len() + 16);
    for c in text.chars() {
        match is_obeyed(c) {
            true => shown.extend(c.escape_unicode()),
            false => shown.push(c),
        }
    }
    Cow::Owned(shown)
}

/// Writes what is left in memory.
///
/// # Errors
/// If standard output did not take everything although it is open.
pub fn finish() -> Result<()> {
    note(io::stdout().lock().flush());
    match FAILURE.lock().unwrap_or_else(PoisonError::into_inner).take() {
        Some(error) => Err(Error::new(format!("cannot write to standard output ({error})"))),
        None => Ok(()),
    }
}

fn note(written: io::Result<()>) {
    if let Err(error) = written
        && error.kind() != ErrorKind::BrokenPipe
    {
        FAILURE.lock().unwrap_or_else(PoisonError::into_inner).get_or_insert(error);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_a_terminal_would_obey_is_shown() {
        for plain in ["", "a sentence\n\twith two lines", "Überraschung ┌─┐ 日本"] {
            assert!(matches!(printable(plain), Cow::Borrowed(text) if text == plain));
        }
        assert_eq!(printable("a\u{1b}[2Jb\u{7}\r"), "a\\u{1b}[2Jb\\u{7}\\u{d}");
        // The same without an escape character, and what hides the order of characters.
        assert_eq!(printable("\u{9b}2J \u{202e}gnp.exe"), "\\u{9b}2J \\u{202e}gnp.exe");
    }
}
