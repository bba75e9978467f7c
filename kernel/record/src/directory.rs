//! The record of a run: a folder that anyone can read, compare and replay from.
//!
//! | file | holds |
//! |---|---|
//! | `manifest.json` | what was run: pipeline, settings, seed, versions and hashes of all components and models |
//! | `scenarios.jsonl` | the ledger: one line for each scenario of the closed loop |
//! | `results.jsonl` | one line for each frame, perturbation and level of an offline evaluation |
//! | `blocks.jsonl` | one line for each block of a recording that a gate had a driver look at |
//! | `results.journal` | while an evaluation is under way: what is done and not among the results yet |
//! | `summary.json` | the table at the end |
//! | `traces/ID.mcap` | frames, control, state and events of the scenario with this id |
//! | `shard.json` | in the record of a part of a run: the scenarios and evaluations of the whole |
//! | `.lock` | nothing: the process that writes the record holds a lock on it, and one on the folder |
//! | `progress.json` | while a run is under way: how far it is |
//! | `performance.json` | when and how fast it ran; the one file that differs between two equal runs |

use std::fs::{self, File, TryLockError};
use std::io::Write;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use pdk_model::scenario::ScenarioId;
use pdk_sdk::error::{Error, Place, Result};
use pdk_sdk::file;
use serde::Serialize;

use crate::lines::{sync_folder, write_error};
use crate::manifest::Manifest;

/// The name of the manifest in a run directory.
pub const MANIFEST: &str = "manifest.json";
/// The name of the ledger: the file with one line for each scenario.
pub const SCENARIOS: &str = "scenarios.jsonl";
/// The name of the file with one line an offline result.
pub const RESULTS: &str = "results.jsonl";
/// The name of the file with what an evaluation has done and not put among its results yet.
pub const JOURNAL: &str = "results.journal";
/// The name of the file with the table at the end.
pub const SUMMARY: &str = "summary.json";
/// The name of the file with times.
pub const PERFORMANCE: &str = "performance.json";
/// The name of the file that says how far a run under way is.
pub const PROGRESS: &str = "progress.json";
/// The name of the file that says which scenarios the run has of which the record is a part.
pub const SHARD: &str = "shard.json";
/// The name of the page about the run.
pub const REPORT: &str = "report.html";
/// What a gate decided, and what it decided by.
pub const VERDICT: &str = "verdict.json";
/// The folder of the clips that the page shows.
pub const CLIPS: &str = "clips";
/// The name of the folder for files that other tools read.
pub const EXPORT: &str = "export";
/// The name of the file with one line a block of a recording that a gate had drivers look at.
pub const BLOCKS: &str = "blocks.jsonl";

/// The name of the layout in which the traces open in Foxglove and Lichtblick: cameras, steering, cross-track error, speed, events.
pub const LAYOUT: &str = "foxglove.json";
/// The layout itself.
pub const LAYOUT_TEXT: &str = include_str!("foxglove.json");

/// Held by the process that writes the record, like the folder itself; the system gives both back however that process ends.
const LOCK: &str = ".lock";
/// What a process that ended early leaves of files that are put in order at the end of a run.
const PARTS: [&str; 2] = ["scenarios.part", "results.part"];
/// The folder of the traces.
const TRACES: &str = "traces";

/// Whether a name is that of one of the record's own files, which nothing else may be written to. File systems may not tell small
/// letters from capitals.
pub fn is_own(name: &str) -> bool {
    let own = [
        MANIFEST,
        SCENARIOS,
        RESULTS,
        JOURNAL,
        SUMMARY,
        PERFORMANCE,
        PROGRESS,
        SHARD,
        REPORT,
        VERDICT,
        CLIPS,
        EXPORT,
        BLOCKS,
        LAYOUT,
        LOCK,
        TRACES,
    ];
    own.iter().any(|own| own.eq_ignore_ascii_case(name))
}

/// The folder of one run.
#[derive(Debug, Clone)]
pub struct RunDirectory {
    path: PathBuf,
    /// Keeps other processes from writing here; none if the record is only read.
    _lock: Option<Arc<Lock>>,
}

/// Two locks, because neither holds everywhere: that of the folder survives the removal of any file in it, and over a network file
/// system only that of a file is known to other machines.
#[derive(Debug)]
struct Lock {
    folder: Option<File>,
    file: File,
}

impl Drop for Lock {
    fn drop(&mut self) {
        // Not left to the closing of the files, which a process that another thread is just starting may have open too.
        for file in self.folder.iter().chain([&self.file]) {
            let _ = file.unlock();
        }
    }
}

impl RunDirectory {
    /// Makes the folder of a run, or takes one that holds a record or the beginning of one; whether that can be continued is for
    /// [`RunDirectory::manifest`] and the ledger to say.
    ///
    /// # Errors
    /// If the folder holds something else, another process writes there, or it cannot be made.
    pub fn create(path: &Path) -> Result<Self> {
        let remedy = "choose another with --out";
        if !path.is_dir() {
            // Of two runs that start at the same time, one makes it, and the lock decides which of them goes on.
            make(path).map_err(|error| {
                Error::new(format!("cannot make the output folder {} ({error}); {remedy}", path.display()))
            })?;
        }
        if let Some(other) = foreign(path)? {
            return Err(Error::new(format!(
                "the output folder {} is not empty (it holds `{other}`, which is not of a record that can be continued); {remedy}",
                path.display()
            )));
        }
        // Fails now rather than after an hour where the folder is read-only.
        let lock = File::options().create(true).append(true).open(path.join(LOCK)).map_err(|error| {
            Error::new(format!("cannot write to the output folder {} ({error}); {remedy}", path.display()))
        })?;
        let taken = || {
            Error::new(format!(
                "another process is writing to the output folder {}; wait for its end, or {remedy}",
                path.display()
            ))
        };
        match lock.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => return Err(taken()),
            Err(TryLockError::Error(error)) => {
                return Err(Error::new(format!(
                    "cannot lock the output folder {} ({error}); {remedy}",
                    path.display()
                )));
            }
        }
        let folder = match File::open(path).map(|folder| (folder.try_lock(), folder)) {
            Ok((Ok(()), folder)) => Some(folder),
            Ok((Err(TryLockError::WouldBlock), _)) => return Err(taken()),
            // There are file systems that cannot lock folders; the file is locked there.
            Ok((Err(TryLockError::Error(_)), _)) | Err(_) => None,
        };
        let directory = Self { path: path.to_owned(), _lock: Some(Arc::new(Lock { folder, file: lock })) };
        directory
            .remove_parts(path, |name| PARTS.contains(&name) || file::whole_of(name).is_some_and(is_saved));
        Ok(directory)
    }

    /// The manifest that an earlier process wrote here; none if it did not come to that.
    ///
    /// # Errors
    /// If it is damaged.
    pub fn manifest(&self) -> Result<Option<Manifest>> {
        let path = self.path.join(MANIFEST);
        if !path.is_file() {
            return Ok(None);
        }
        let text = fs::read(&path).place(path.display())?;
        serde_json::from_slice(&text).map(Some).map_err(|error| {
            Error::new(format!(
                "{} is damaged ({error}); bring it back from a copy, or make the record again",
                path.display()
            ))
        })
    }

    /// Makes the folder of a new run in the first of these places where nothing is. Runs that start at the same time get
    /// different ones.
    ///
    /// # Errors
    /// If the folder cannot be made.
    pub fn create_first(places: impl IntoIterator<Item = PathBuf>) -> Result<Self> {
        for place in places {
            let made = place.parent().map_or(Ok(()), make).and_then(|()| fs::create_dir(&place));
            match made {
                Ok(()) => {
                    sync_folder(&place);
                    return Self::create(&place);
                }
                Err(error) if error.kind() == std::io::ErrorKind::AlreadyExists && place.exists() => {}
                Err(error) => {
                    return Err(Error::new(format!(
                        "cannot make the output folder {} ({error}); choose another with --out",
                        place.display()
                    )));
                }
            }
        }
        Err(Error::new("there is no place for the record; name one with --out"))
    }

    /// The folder of a run that was recorded earlier.
    ///
    /// # Errors
    /// If it holds no record.
    pub fn open(path: &Path) -> Result<Self> {
        if !path.join(MANIFEST).is_file() {
            return Err(Error::new(format!(
                "{} holds no record: it has no {MANIFEST}; name the folder that `pdk run` printed",
                path.display()
            )));
        }
        Ok(Self { path: path.to_owned(), _lock: None })
    }

    /// The folder.
    pub fn path(&self) -> &Path {
        &self.path
    }

    /// Writes a JSON file as a whole: it is there complete, or not at all.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write_json(&self, name: &str, value: &impl Serialize) -> Result<()> {
        let mut failed = None;
        let written = self.write(name, |file| match serde_json::to_writer_pretty(&mut *file, value) {
            Ok(()) => file.write_all(b"\n"),
            // What cannot be JSON is a mistake in the value, and not in the writing.
            Err(error) if !error.is_io() => {
                failed = Some(Error::from(error));
                Err(std::io::ErrorKind::InvalidData.into())
            }
            Err(error) => Err(error.into()),
        });
        failed.map_or(written, Err)
    }

    /// Writes a text file as a whole: it is there complete, or not at all.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn write_text(&self, name: &str, text: &str) -> Result<()> {
        self.write(name, |file| file.write_all(text.as_bytes()))
    }

    fn write(
        &self,
        name: &str,
        fill: impl FnOnce(&mut std::io::BufWriter<File>) -> std::io::Result<()>,
    ) -> Result<()> {
        let path = self.path.join(name);
        file::write_with(&path, fill).map_err(|error| write_error(&path, &error))?;
        sync_folder(&path);
        Ok(())
    }

    /// The path of a scenario's trace; makes the folder around it, and a layout to look at traces beside it.
    ///
    /// # Errors
    /// If the folder cannot be made, or the layout cannot be written.
    pub fn trace(&self, scenario: &ScenarioId) -> Result<PathBuf> {
        let folder = self.path.join(TRACES);
        if !folder.is_dir() {
            fs::create_dir_all(&folder).map_err(|error| write_error(&folder, &error))?;
        }
        if !self.path.join(LAYOUT).is_file() {
            self.write_text(LAYOUT, LAYOUT_TEXT)?;
        }
        Ok(self.trace_path(scenario))
    }

    /// The path of a scenario's trace, whether there is one or not.
    pub fn trace_path(&self, scenario: &ScenarioId) -> PathBuf {
        self.path.join(TRACES).join(format!("{scenario}.mcap"))
    }

    /// Removes what processes that ended early left in the folder of the traces.
    pub fn remove_partial_traces(&self) {
        self.remove_parts(&self.path.join(TRACES), |name| name.ends_with(".part"));
    }

    /// Removes what processes that ended early left half-written.
    fn remove_parts(&self, folder: &Path, is_part: impl Fn(&str) -> bool) {
        for entry in fs::read_dir(folder).into_iter().flatten().flatten() {
            if is_part(&entry.file_name().to_string_lossy()) {
                // What cannot be removed does no harm: it is written anew.
                let _ = fs::remove_file(entry.path());
            }
        }
    }
}

/// Makes a folder and those that it lies in, so that all of them are there after a power cut.
fn make(folder: &Path) -> std::io::Result<()> {
    if folder.as_os_str().is_empty() || folder.is_dir() {
        return Ok(());
    }
    folder.parent().map_or(Ok(()), make)?;
    match fs::create_dir(folder) {
        Ok(()) => sync_folder(folder),
        // Another process was quicker.
        Err(_) if folder.is_dir() => {}
        Err(error) => return Err(error),
    }
    Ok(())
}

/// Whether a name may be that of a file that a pipeline or a search saved, or of one of the kernel's that is written whole.
fn is_saved(name: &str) -> bool {
    name.ends_with(".json") || name.ends_with(".csv")
}

/// What a folder holds besides a record or the beginning of one; none if it holds nothing else.
fn foreign(path: &Path) -> Result<Option<String>> {
    let begun = path.join(MANIFEST).is_file();
    let place = |error| Error::new(format!("cannot read the output folder {} ({error})", path.display()));
    for entry in fs::read_dir(path).map_err(place)? {
        let name = entry.map_err(place)?.file_name();
        let name = name.to_string_lossy();
        // A pipeline may save files of its own beside those of the kernel, and searches save tables.
        let whole = file::whole_of(&name);
        let saved = is_saved(whole.unwrap_or(&name));
        let lines = [SCENARIOS, RESULTS, JOURNAL, BLOCKS].contains(&&*name) || PARTS.contains(&&*name);
        let made_of_it = [TRACES, REPORT, CLIPS, EXPORT].contains(&whole.unwrap_or(&name));
        let known = name == LOCK || whole == Some(MANIFEST) || begun && (saved || lines || made_of_it);
        if !known {
            return Ok(Some(name.into_owned()));
        }
    }
    Ok(None)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_sdk::prelude::{Control, State};
    use serde_json::Value;

    /// The panels that a part of a layout shows.
    fn shown(layout: &Value, all: &mut Vec<String>) {
        match layout {
            Value::String(id) => all.push(id.clone()),
            split => ["first", "second"].iter().for_each(|side| shown(&split[side], all)),
        }
    }

    #[test]
    fn a_folder_is_free_when_its_owner_lets_go_even_while_a_starting_process_holds_its_files() {
        let folder = tempfile::tempdir().unwrap();
        let owner = RunDirectory::create(folder.path()).unwrap();
        assert!(RunDirectory::create(folder.path()).is_err());
        // What a process has between its fork and its exec: the same open files.
        let lock = owner._lock.as_deref().unwrap();
        let held = (lock.folder.as_ref().unwrap().try_clone().unwrap(), lock.file.try_clone().unwrap());
        drop(owner);
        RunDirectory::create(folder.path()).unwrap();
        drop(held);
    }

    #[test]
    fn the_layout_shows_each_panel_once_and_fields_that_traces_have() {
        let layout: Value = serde_json::from_str(LAYOUT_TEXT).unwrap();
        let mut all = Vec::new();
        shown(&layout["layout"], &mut all);
        all.sort();
        let panels = layout["configById"].as_object().unwrap();
        let mut known: Vec<&String> = panels.keys().collect();
        known.sort();
        assert_eq!(all.iter().collect::<Vec<_>>(), known);
        let paths: Vec<&str> = panels
            .values()
            .filter_map(|panel| panel["paths"].as_array())
            .flatten()
            .map(|path| path["value"].as_str().unwrap())
            .collect();
        assert_eq!(paths.len(), 4);
        for path in paths {
            let has = match path.split_once('.').unwrap() {
                ("/control", field) => Control::NUMBERS.contains(&field),
                ("/state", field) => State::NUMBERS.contains(&field),
                _ => false,
            };
            assert!(has, "{path}");
        }
    }

    #[test]
    fn one_process_writes_and_strangers_files_are_left_alone() {
        let folder = std::env::temp_dir().join(format!("pdk-record-{}", std::process::id()));
        let directory = RunDirectory::create(&folder).unwrap();
        let error = RunDirectory::create(&folder).unwrap_err().to_string();
        assert!(error.starts_with("another process is writing to"), "{error}");
        drop(directory);
        fs::write(folder.join(SCENARIOS), "").unwrap();
        let error = RunDirectory::create(&folder).unwrap_err().to_string();
        assert!(error.contains("is not empty (it holds `scenarios.jsonl`, "), "{error}");
        assert!(error.ends_with("; choose another with --out"), "{error}");
        fs::remove_file(folder.join(SCENARIOS)).unwrap();
        assert!(RunDirectory::create(&folder).unwrap().manifest().unwrap().is_none());
        // What a run had saved when it ended does not keep it from going on.
        for name in [MANIFEST, "search.csv", "search.json.123.part", "report.html.9.part", PARTS[0]] {
            fs::write(folder.join(name), "").unwrap();
        }
        fs::create_dir(folder.join(EXPORT)).unwrap();
        let directory = RunDirectory::create(&folder).unwrap();
        assert!(folder.join("search.csv").exists() && !folder.join("search.json.123.part").exists());
        assert!(!folder.join(PARTS[0]).exists());
        // The lock is not only that of a file, which anybody may tidy away.
        fs::remove_file(folder.join(LOCK)).unwrap();
        let error = RunDirectory::create(&folder).unwrap_err().to_string();
        assert!(error.starts_with("another process is writing to"), "{error}");
        drop(directory);
        fs::remove_dir_all(folder).unwrap();
    }
}
