//! Finds the dataset reader for a folder or file: the first one that recognises it. Opens recordings.

use std::collections::BTreeMap;
use std::path::Path;

use pdk_components::catalog::Catalog;
use pdk_components::hash;
use pdk_loop::protocol::Made;
use pdk_model::component::ComponentSpec;
use pdk_record::manifest::InUse;
use pdk_record::settle::Settler;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, ErrorKind, Result};
use pdk_sdk::input_files::InputFiles;
use pdk_session::session::Session;
use serde_json::Value;

pub use crate::requests::DatasetSpec;

/// A recording that was opened.
#[derive(Debug, Clone)]
pub struct Recording {
    /// Its reader.
    pub reader: ComponentSpec,
    /// What it is like.
    pub made: Made,
    /// The hash of its contents.
    pub content: String,
}

/// Opens a recording outside of a run: a folder, a file, or a reader with its parameters.
///
/// # Errors
/// If no reader opens it.
pub fn recording(session: &mut Session, dataset: &Value) -> Result<Recording> {
    let catalog = session.catalog().clone();
    let (mut reader, made) = match DatasetSpec::from_json(dataset)? {
        DatasetSpec::Path(path) => open(&catalog, &path, |reader| session.make(Kind::Dataset, reader))?,
        DatasetSpec::Reader(reader) => {
            let made = session.make(Kind::Dataset, &reader)?;
            (reader, made)
        }
    };
    let (settled, contents) = (&mut Vec::new(), &mut BTreeMap::new());
    Settler { catalog: &catalog, wanted: BTreeMap::new(), settled, contents }
        .component(Kind::Dataset, &mut reader);
    let groups = session.input_files(Kind::Dataset, &reader)?;
    let mut in_use = InUse::default();
    in_use.add_input_files(&groups, &mut |_, _| Ok(()))?;
    let content = content(&reader, &groups, &in_use)?;
    Ok(Recording { reader, made, content })
}

/// The hash of what is in a recording: in the groups of files that its reader reads, which have been noted, and in the files that its
/// parameters name.
///
/// # Errors
/// If a file cannot be read.
pub fn content(reader: &ComponentSpec, groups: &[InputFiles], noted: &InUse) -> Result<String> {
    let mut hasher = blake3::Hasher::new_derive_key("pdk recording, version 1");
    for group in groups {
        let content = noted.content_of(group).ok_or_else(|| {
            Error::new(format!(
                "the {} in {} became others while they were read; begin again when no program writes there",
                group.what,
                group.folder.display()
            ))
        })?;
        hasher.update(content.as_bytes());
    }
    let named = reader.parameters.values().filter_map(Value::as_str).map(Path::new);
    for file in named.filter(|path| path.is_file()) {
        match noted.hash_of(file) {
            Some(hash) => hasher.update(hash.as_bytes()),
            None => hasher.update(hash::of(file)?.as_bytes()),
        };
    }
    Ok(hasher.finalize().to_hex().to_string())
}

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
/// If no reader can. If one recognises the recording and cannot read it, its reason is given, and else the reasons of all, unless there is
/// nothing at the path.
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
        // Each reader would only say so once more.
        false if !recognised && !Path::new(path).exists() => {
            format!("there is no file or folder {path} to open as a dataset; correct its path")
        }
        false => format!("cannot open the dataset {path}: {}", reasons.join("; ")),
    });
    Err(Unopened { error, recognised })
}
