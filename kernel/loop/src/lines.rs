//! Messages as lines of JSON, written in one piece and read on a thread of their own.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader, Read, Write};
use std::sync::mpsc::Sender;

use pdk_sdk::error::Result;
use serde::Serialize;
use serde::de::{DeserializeOwned, IgnoredAny};

/// The longest line that is read, in bytes: far above the catalog of any installation.
const LONGEST: u64 = 64 << 20;

/// Writes a message as a line.
///
/// # Errors
/// If the reader is gone.
pub fn write(to: &mut impl Write, message: &impl Serialize) -> Result<()> {
    let mut line = serde_json::to_vec(message)?;
    line.push(b'\n');
    to.write_all(&line)?;
    to.flush()?;
    Ok(())
}

/// What a reading thread found.
#[derive(Debug)]
pub enum Found<T> {
    /// A message.
    Message(T),
    /// A line that is not a message, why, and the name that it has if it has the form of one.
    Nonsense(String, Option<String>),
    /// There will be no more.
    End,
}

/// The name of what has the form of a message: an object with one key.
fn name(line: &[u8]) -> Option<String> {
    let message: BTreeMap<String, IgnoredAny> = serde_json::from_slice(line).ok()?;
    let mut names = message.into_keys();
    names.next().filter(|_| names.next().is_none())
}

/// Reads messages until the end, and hands each on as the event that `wrap` makes of it.
pub fn read_all<T: DeserializeOwned, E>(from: impl Read, events: &Sender<E>, wrap: impl Fn(Found<T>) -> E) {
    let mut reader = BufReader::with_capacity(1 << 16, from);
    let mut line = Vec::new();
    loop {
        line.clear();
        let read = reader.by_ref().take(LONGEST).read_until(b'\n', &mut line);
        let found = match read {
            Ok(length) if length > 0 && line.ends_with(b"\n") => {
                if line.iter().all(u8::is_ascii_whitespace) {
                    continue;
                }
                match serde_json::from_slice(&line) {
                    Ok(message) => Found::Message(message),
                    Err(error) => Found::Nonsense(error.to_string(), name(&line)),
                }
            }
            Ok(length) if length as u64 == LONGEST => {
                Found::Nonsense(format!("a line of more than {} MiB", LONGEST >> 20), None)
            }
            // Without a line feed it was cut off.
            _ => Found::End,
        };
        let end = matches!(found, Found::End);
        if events.send(wrap(found)).is_err() || end {
            return;
        }
    }
}
