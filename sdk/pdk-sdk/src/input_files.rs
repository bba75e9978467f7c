//! Files that a component reads and its parameters do not name, so that the record of a run holds their hashes too.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};

/// Files that belong together. Their content decides what a component does; names without a file count as well, so that one which
/// appears later is noticed.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct InputFiles {
    /// What they are, such as "pictures and catalogs"; two groups in the same folder have different words.
    pub what: String,
    /// The folder that they are in.
    pub folder: PathBuf,
    /// Their names in that folder, in any order.
    pub names: Vec<PathBuf>,
}

impl InputFiles {
    /// Files in a folder.
    pub fn new(what: &str, folder: impl Into<PathBuf>, names: Vec<PathBuf>) -> Self {
        Self { what: what.to_owned(), folder: folder.into(), names }
    }
}
