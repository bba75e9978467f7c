//! Messages as lines of JSON, written in one piece and read on a thread of their own.

use std::io::{BufRead, BufReader, Read, Write};
use std::sync::mpsc::Sender;

use pdk_sdk::error::Result;
use serde::Serialize;
use serde::de::DeserializeOwned;

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
    /// A line that is not a message, and why.
    Nonsense(String),
    /// There will be no more.
    End,
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
                    Err(error) => Found::Nonsense(error.to_string()),
                }
            }
            Ok(length) if length as u64 == LONGEST => {
                Found::Nonsense(format!("a line of more than {} MiB", LONGEST >> 20))
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
