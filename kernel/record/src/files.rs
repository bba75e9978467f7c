//! The files that a run reads, with what is in them.

use std::path::{Path, PathBuf};

use pdk_components::hash;
use pdk_sdk::error::Result;
use serde::{Deserialize, Serialize};

/// A file and its content, or a group of files in a folder.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct FileRecord {
    /// The file, or the folder of a group.
    pub path: PathBuf,
    /// What the files of a group are; empty for a single file.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub group: String,
    /// How many files a group has.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub count: usize,
    /// BLAKE3 of its content, in hexadecimal; that of a group is of the names, sizes and hashes of its files.
    pub blake3: String,
}

/// A path as records have it: what lies below the working directory counts from there, so that a record says the same wherever that is.
pub fn recorded(path: &Path) -> PathBuf {
    let Ok(here) = std::env::current_dir() else { return path.to_owned() };
    match path.strip_prefix(here) {
        Ok(inside) if inside.as_os_str().is_empty() => PathBuf::from("."),
        Ok(inside) => inside.to_owned(),
        Err(_) => path.to_owned(),
    }
}

fn is_zero(count: &usize) -> bool {
    *count == 0
}

impl FileRecord {
    /// Reads a file's hash.
    ///
    /// # Errors
    /// If it cannot be read.
    pub fn of(path: &Path) -> Result<Self> {
        Ok(Self::new(path, hash::of(path)?))
    }

    /// A single file.
    pub fn new(path: &Path, blake3: String) -> Self {
        Self { path: recorded(path), group: String::new(), count: 0, blake3 }
    }

    /// How it differs from a recorded one of the same path and group, as a clause; none if it does not.
    pub(crate) fn difference(&self, recorded: &Self) -> Option<String> {
        let (path, group) = (self.path.display(), &self.group);
        if self.blake3 == recorded.blake3 {
            return None;
        }
        Some(match (group.is_empty(), recorded.count, self.count) {
            (true, ..) => format!("the file {path} is a different one"),
            (_, was, is) if was == is => format!("the {group} in {path} ({is} in all) are not the same"),
            (_, was, is) => format!("the {group} in {path} were {was} and are {is}"),
        })
    }
}
