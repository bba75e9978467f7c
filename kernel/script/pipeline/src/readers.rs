//! Finds the dataset reader for a folder or file: the first one that recognises it.

use pdk_model::component::ComponentSpec;
use pdk_sdk::error::{Error, ErrorKind, Result};

use pdk_components::catalog::Catalog;

/// Why no reader opened a folder or file.
pub struct Unopened {
    /// Their reasons.
    pub error: Error,
    /// Whether one recognised it as a recording that it reads, and could not read it.
    pub recognised: bool,
}

impl From<Unopened> for Error {
    fn from(unopened: Unopened) -> Self {
        unopened.error
    }
}

/// Opens a folder or file with the first dataset reader that can. `make` makes an instance of one.
///
/// # Errors
/// If no reader can. If one recognises the recording and cannot read it, its reason is given, and else the reasons of all.
pub fn open<T>(
    catalog: &Catalog,
    path: &str,
    mut make: impl FnMut(&ComponentSpec) -> Result<T>,
) -> Result<(ComponentSpec, T), Unopened> {
    let mut failed = Vec::new();
    let mut unsuitable = Vec::new();
    for reader in catalog.readers(path) {
        match make(&reader) {
            Ok(made) => return Ok((reader, made)),
            Err(error) => {
                let reasons =
                    if error.kind() == ErrorKind::Unsuitable { &mut unsuitable } else { &mut failed };
                // All readers say the same of a folder that does not exist.
                if !reasons.contains(&error.to_string()) {
                    reasons.push(error.to_string());
                }
            }
        }
    }
    let recognised = !failed.is_empty();
    let reasons = if recognised { failed } else { unsuitable };
    let error = Error::new(match reasons.is_empty() {
        true => format!("cannot open the dataset {path}: no dataset reader is installed"),
        false => format!("cannot open the dataset {path}: {}", reasons.join("; ")),
    });
    Err(Unopened { error, recognised })
}
