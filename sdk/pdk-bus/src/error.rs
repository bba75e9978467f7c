//! The error of the bus: one sentence that names the topic and the remedy.

use std::fmt;

/// What went wrong on the bus, in one sentence for the person who runs pdk.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Error(String);

/// The result of everything the bus does.
pub type Result<T, E = Error> = std::result::Result<T, E>;

impl Error {
    pub(crate) fn new(message: impl Into<String>) -> Self {
        Self(message.into())
    }

    /// The sentence.
    pub fn message(&self) -> &str {
        &self.0
    }
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Error {}
