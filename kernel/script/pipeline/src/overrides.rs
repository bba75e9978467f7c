//! `--set KEY=VALUE`.

use std::collections::BTreeSet;

use pdk_sdk::error::{Error, Result};

/// One `--set KEY=VALUE`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Override {
    /// The setting; dots lead into tables.
    pub key: String,
    /// The value as it was written.
    pub value: String,
}

impl std::str::FromStr for Override {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text.split_once('=') {
            Some((key, value)) if !key.trim().is_empty() => {
                Ok(Self { key: key.trim().to_owned(), value: value.to_owned() })
            }
            _ => Err(Error::new(format!("`{text}` sets nothing; write KEY=VALUE"))),
        }
    }
}

/// Refuses what sets the same twice: one of the values would be dropped without a word.
///
/// # Errors
/// Names the first that is there twice.
pub fn refuse_repeated(overrides: &[Override]) -> Result<()> {
    let mut seen = BTreeSet::new();
    match overrides.iter().find(|given| !seen.insert(given.key.as_str())) {
        Some(Override { key, .. }) => {
            Err(Error::new(format!("--set {key} is given more than once; give it once")))
        }
        None => Ok(()),
    }
}
