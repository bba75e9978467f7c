//! The error of a component: one sentence that names the thing, the place and the remedy.

use std::fmt;

/// What went wrong, in one sentence for the person who runs pdk.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Error(String);

/// The result of everything a component does.
pub type Result<T, E = Error> = std::result::Result<T, E>;

impl Error {
    /// An error that says `message`.
    pub fn new(message: impl Into<String>) -> Self {
        Self(message.into())
    }

    /// Puts the place before the message: `"{place}: {message}"`.
    pub fn at(self, place: impl fmt::Display) -> Self {
        Self(format!("{place}: {}", self.0))
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

impl From<String> for Error {
    fn from(message: String) -> Self {
        Self(message)
    }
}

impl From<&str> for Error {
    fn from(message: &str) -> Self {
        Self(message.to_owned())
    }
}

impl From<std::io::Error> for Error {
    fn from(error: std::io::Error) -> Self {
        Self(error.to_string())
    }
}

impl From<serde_json::Error> for Error {
    fn from(error: serde_json::Error) -> Self {
        Self(error.to_string())
    }
}

impl From<pdk_ops::FrameError> for Error {
    fn from(error: pdk_ops::FrameError) -> Self {
        Self(error.to_string())
    }
}

/// Names the place of an error where it is passed on.
pub trait Place<T> {
    /// Turns the error into `"{place}: {error}"`.
    ///
    /// # Errors
    /// The error of `self`, with its place.
    fn place(self, place: impl fmt::Display) -> Result<T>;
}

impl<T, E: fmt::Display> Place<T> for std::result::Result<T, E> {
    fn place(self, place: impl fmt::Display) -> Result<T> {
        self.map_err(|error| Error(format!("{place}: {error}")))
    }
}
