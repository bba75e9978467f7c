//! Where the files of a record are.
//!
//! Paths in a record count from the folder in which the run was started, as its user wrote them, and the manifest says where that folder is
//! as seen from the record. So a project that is moved, with its record in it, is still the same project. Which file is meant follows from
//! the recorded hash: the one in that folder, or else the one of this name in the working directory.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use pdk_components::hash;
use pdk_model::json::replace;
use pdk_model::scenario::Scenario;
use pdk_sdk::error::Result;

use crate::files::{FileRecord, recorded};
use crate::manifest::Manifest;

/// The folder in which a run was started, as seen from the folder of its record; empty if it is not one of the folders around the record.
pub fn from_record(record: &Path) -> PathBuf {
    let inside = recorded(&std::fs::canonicalize(record).unwrap_or_else(|_| record.to_owned()));
    match inside.is_absolute() {
        true => PathBuf::new(),
        false if inside == Path::new(".") => inside,
        false => inside.components().map(|_| "..").collect(),
    }
}

/// Finds the files of a record.
pub struct Located {
    /// The folder in which the run was started; none if it is not known, or is the working directory.
    base: Option<PathBuf>,
}

impl Located {
    /// The files of the record in a folder.
    pub fn new(record: &Path, manifest: &Manifest) -> Self {
        let canonical = |path: &Path| std::fs::canonicalize(path).ok();
        let base = Some(&manifest.folder).filter(|folder| !folder.as_os_str().is_empty());
        let base = base.and_then(|folder| canonical(&record.join(folder)));
        Self { base: base.filter(|base| canonical(Path::new(".")).is_none_or(|here| here != *base)) }
    }

    /// A file or a folder of the record, as seen from here.
    fn find(&self, path: &Path, blake3: &str) -> PathBuf {
        let Some(base) = &self.base else { return path.to_owned() };
        let moved = recorded(&base.join(path));
        let has_content = |path: &Path| hash::of(path).is_ok_and(|hash| hash == blake3);
        if path == moved || !moved.exists() || has_content(path) && !has_content(&moved) {
            path.to_owned()
        } else {
            moved
        }
    }

    /// A manifest whose paths are as seen from here.
    pub fn manifest(&self, mut manifest: Manifest) -> Manifest {
        let locate = |file: &mut FileRecord| file.path = self.find(&file.path, &file.blake3);
        manifest.components.iter_mut().for_each(|component| locate(&mut component.file));
        manifest.files.iter_mut().for_each(locate);
        for folder in manifest.plugins.iter_mut().chain(&mut manifest.drop_ins) {
            *folder = self.find(folder, "");
        }
        manifest
    }

    /// A scenario whose paths are as seen from here. Its id is the same.
    ///
    /// # Errors
    /// If it cannot be written as JSON and read again.
    pub fn scenario(&self, scenario: &Scenario) -> Result<Scenario> {
        let found = scenario.files.iter().map(|(text, hash)| {
            let path = self.find(Path::new(text), hash).to_string_lossy().into_owned();
            (text.clone(), (path, hash.clone()))
        });
        let found: BTreeMap<String, (String, String)> = found.collect();
        if found.iter().all(|(text, (path, _))| text == path) {
            return Ok(scenario.clone());
        }
        let mut value = serde_json::to_value(scenario)?;
        replace(&mut value, &|text| found.get(text).map(|(path, _)| path.clone()));
        let mut located: Scenario = serde_json::from_value(value)?;
        located.files = found.into_values().collect();
        Ok(located)
    }
}
