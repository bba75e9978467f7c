//! What a user names as a recording: a folder, or a file in one. And how readers say that it is not theirs.

use std::path::{Path, PathBuf};

use pdk_sdk::prelude::*;

use crate::inside::Inside;

/// Said of a path that leads nowhere.
pub const MISSING: &str = "there is no such file or folder";

/// A folder, with the file in it that the user named, if that was one.
pub struct Named {
    /// The folder.
    pub folder: Inside,
    /// Where it is.
    pub path: PathBuf,
    /// The file in it.
    pub file: Option<PathBuf>,
}

impl Named {
    /// What a path names.
    ///
    /// # Errors
    /// If there is nothing.
    pub fn new(path: &Path) -> Result<Self> {
        if path.is_file() {
            let name = path.file_name().map(PathBuf::from);
            let folder = match path.parent() {
                Some(folder) if !folder.as_os_str().is_empty() => folder,
                _ => Path::new("."),
            };
            return Ok(Self { folder: Inside::new(folder)?, path: folder.to_owned(), file: name });
        }
        if !path.exists() {
            return Err(unsuitable(MISSING));
        }
        let folder = Inside::new(path).map_err(|error| Error::of(ErrorKind::Unsuitable, error.message()))?;
        Ok(Self { folder, path: path.to_owned(), file: None })
    }
}

/// The error of a reader that does not recognise a recording: `what` says what it looks for.
pub fn unsuitable(what: impl std::fmt::Display) -> Error {
    Error::of(ErrorKind::Unsuitable, what.to_string())
}

/// The error for a frame beyond the last.
pub fn beyond(index: usize, len: usize) -> Error {
    Error::new(format!("the recording has {len} frames, so there is no frame {index}"))
}

/// The error for a file that a recording does not have.
pub fn not_listed(name: &str) -> Error {
    Error::new(format!("the recording has no file `{name}`; run the command again if its folder has changed"))
}
