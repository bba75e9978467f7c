//! The record of a run: a folder that anyone can read, compare and replay from.
//!
//! | file | holds |
//! |---|---|
//! | `manifest.json` | what was run: pipeline, settings, seed, versions and hashes of all components and models |
//! | `scenarios.jsonl` | one line a scenario of the closed loop |
//! | `results.jsonl` | one line a frame, perturbation and level of an offline evaluation |
//! | `summary.json` | the table at the end |
//! | `traces/N.mcap` | frames, control, state and events of scenario N |
//! | `.lock` | nothing: the process that writes the record holds it |
//! | `performance.json` | when and how fast it ran; the one file that differs between two equal runs |

use std::collections::BTreeMap;
use std::fs::{self, File, TryLockError};
use std::io::{ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use pdk_sdk::error::{Error, Place, Result};
use serde::Serialize;

use crate::drive::Outcome;
use crate::report::{CLIPS, REPORT};

pub mod manifest;
mod protobuf;
pub mod published;
pub mod trace;
pub mod trace_reader;

/// The name of the manifest in a run directory.
pub const MANIFEST: &str = "manifest.json";
/// The name of the file with one line a scenario.
pub const SCENARIOS: &str = "scenarios.jsonl";
/// The name of the file with one line an offline result.
pub const RESULTS: &str = "results.jsonl";
/// The name of the file with the table at the end.
pub const SUMMARY: &str = "summary.json";
/// The name of the file with times.
pub const PERFORMANCE: &str = "performance.json";

/// Held by the process that writes the record; the system gives it back however that process ends.
const LOCK: &str = ".lock";
/// The folder of the traces.
const TRACES: &str = "traces";

/// The folder of one run.
#[derive(Debug, Clone)]
pub struct RunDirectory {
    path: PathBuf,
    /// Keeps other processes from writing here; none where the record is only read.
    _lock: Option<Arc<File>>,
}

impl RunDirectory {
    /// Makes the folder of a run, or takes one that holds a record or the beginning of one; whether that can be continued is for
    /// [`RunDirectory::recorded`] to say.
    ///
    /// # Errors
    /// Where the folder holds something else, another process writes there, or it cannot be made.
    pub fn create(path: &Path) -> Result<Self> {
        let remedy = "choose another with --out";
        if !path.is_dir() {
            // Of two runs that start at the same time, one makes it, and the lock decides which of them goes on.
            fs::create_dir_all(path).map_err(|error| {
                Error::new(format!("cannot make the output folder {} ({error}); {remedy}", path.display()))
            })?;
        }
        if !is_ours(path)? {
            return Err(Error::new(format!("the output folder {} is not empty; {remedy}", path.display())));
        }
        // Fails now rather than after an hour where the folder is read-only.
        let lock = File::options().create(true).append(true).open(path.join(LOCK)).map_err(|error| {
            Error::new(format!("cannot write to the output folder {} ({error}); {remedy}", path.display()))
        })?;
        match lock.try_lock() {
            Ok(()) => Ok(Self { path: path.to_owned(), _lock: Some(Arc::new(lock)) }),
            Err(TryLockError::WouldBlock) => Err(Error::new(format!(
                "another process is writing to the output folder {}; wait for its end, or {remedy}",
                path.display()
            ))),
            Err(TryLockError::Error(error)) => Err(Error::new(format!(
                "cannot lock the output folder {} ({error}); {remedy}",
                path.display()
            ))),
        }
    }

    /// What an earlier process recorded here, for this one to continue; none where it did not come to its manifest.
    ///
    /// # Errors
    /// Where the record holds offline results, which cannot be continued, or is damaged.
    pub fn recorded(&self) -> Result<Option<Recorded>> {
        let manifest = self.path.join(MANIFEST);
        if !manifest.is_file() {
            return Ok(None);
        }
        if self.path.join(RESULTS).exists() {
            return Err(Error::new(format!(
                "the output folder {} holds results of pdk.evaluate, which cannot be continued; choose another with --out",
                self.path.display()
            )));
        }
        self.read().map(Some)
    }

    /// The manifest, and the scenarios that are complete; none where the run drove none.
    ///
    /// # Errors
    /// Where the record is damaged.
    pub fn read(&self) -> Result<Recorded> {
        let manifest = self.path.join(MANIFEST);
        let text = fs::read(&manifest).place(manifest.display())?;
        let manifest = serde_json::from_slice(&text).place(manifest.display())?;
        let path = self.path.join(SCENARIOS);
        let mut outcomes = BTreeMap::new();
        if path.exists() {
            for outcome in read_outcomes(self)? {
                let index = outcome.index;
                if outcomes.insert(index, outcome).is_some() {
                    return Err(Error::new(format!(
                        "{} holds scenario {index} twice, so it is no record that pdk wrote",
                        path.display()
                    )));
                }
            }
        }
        Ok(Recorded { manifest, outcomes })
    }

    /// Makes the folder of a new run in the first of these places where nothing is. Runs that start at the same time get
    /// different ones.
    ///
    /// # Errors
    /// Where the folder cannot be made.
    pub fn create_first(places: impl IntoIterator<Item = PathBuf>) -> Result<Self> {
        for place in places {
            let made =
                place.parent().map_or(Ok(()), fs::create_dir_all).and_then(|()| fs::create_dir(&place));
            match made {
                Ok(()) => return Self::create(&place),
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
    /// Where it holds no record.
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
    /// Where it cannot be written.
    pub fn write_json(&self, name: &str, value: &impl Serialize) -> Result<()> {
        let (path, part) = (self.path.join(name), self.path.join(format!("{name}.part")));
        let mut text = serde_json::to_vec_pretty(value)?;
        text.push(b'\n');
        let written = File::create(&part)
            .and_then(|mut file| file.write_all(&text).and_then(|()| file.sync_all()))
            .and_then(|()| fs::rename(&part, &path));
        written.map_err(|error| write_error(&path, &error))
    }

    /// Opens a file to which lines are added as they come. A last line that an earlier process did not complete is removed.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub fn lines(&self, name: &str) -> Result<Lines> {
        let path = self.path.join(name);
        let file =
            File::options().create(true).append(true).open(&path).map_err(|e| write_error(&path, &e))?;
        let text = fs::read(&path).map_err(|e| write_error(&path, &e))?;
        let complete = text.iter().rposition(|&byte| byte == b'\n').map_or(0, |end| end as u64 + 1);
        if complete < text.len() as u64 {
            file.set_len(complete).map_err(|e| write_error(&path, &e))?;
        }
        Ok(Lines { path, file, complete })
    }

    /// The path of a scenario's trace; makes the folder around it.
    ///
    /// # Errors
    /// Where the folder cannot be made.
    pub fn trace(&self, scenario: u64) -> Result<PathBuf> {
        let folder = self.path.join(TRACES);
        fs::create_dir_all(&folder).map_err(|error| write_error(&folder, &error))?;
        Ok(self.trace_path(scenario))
    }

    /// The path of a scenario's trace, whether there is one or not.
    pub fn trace_path(&self, scenario: u64) -> PathBuf {
        self.path.join(TRACES).join(format!("{scenario:04}.mcap"))
    }
}

/// What is recorded of a run, such as a process that ended early left it.
#[derive(Debug, Clone)]
pub struct Recorded {
    /// What was run.
    pub manifest: manifest::Manifest,
    /// The scenarios that were over, by their numbers.
    pub outcomes: BTreeMap<u64, Outcome>,
}

/// Whether a folder holds nothing but a record or the beginning of one.
fn is_ours(path: &Path) -> Result<bool> {
    let begun = path.join(MANIFEST).is_file();
    let place = |error| Error::new(format!("cannot read the output folder {} ({error})", path.display()));
    for entry in fs::read_dir(path).map_err(place)? {
        let name = entry.map_err(place)?.file_name();
        let name = name.to_string_lossy();
        // A pipeline may save JSON files of its own beside those of the kernel.
        let json = name.ends_with(".json") || name.ends_with(".json.part");
        let lines = [SCENARIOS, "scenarios.part", RESULTS, "results.part"].contains(&&*name);
        let made_of_it = [TRACES, REPORT, CLIPS].contains(&&*name);
        let known = name == LOCK || name == "manifest.json.part" || begun && (json || lines || made_of_it);
        if !known {
            return Ok(false);
        }
    }
    Ok(true)
}

/// A file of JSON lines. Each line is in the file when `write` returns.
pub struct Lines {
    path: PathBuf,
    file: File,
    complete: u64,
}

impl Lines {
    /// Adds lines that are already JSON and end with a line feed. Where that fails, what was written of them is taken
    /// back, so that the file holds complete lines only.
    ///
    /// # Errors
    /// Where they cannot be written.
    pub fn write_text(&mut self, lines: &[u8]) -> Result<()> {
        match self.file.write_all(lines) {
            Ok(()) => {
                self.complete += lines.len() as u64;
                Ok(())
            }
            Err(error) => {
                // The first error is the one to report; a second one here would say the same.
                let _ = self.file.set_len(self.complete);
                Err(write_error(&self.path, &error))
            }
        }
    }

    /// Adds a line.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub fn write(&mut self, value: &impl Serialize) -> Result<()> {
        let mut line = serde_json::to_vec(value)?;
        line.push(b'\n');
        self.write_text(&line)
    }

    /// Makes sure that the lines survive a power cut.
    ///
    /// # Errors
    /// Where the disk does not take them.
    pub fn sync(&mut self) -> Result<()> {
        self.file.sync_data().map_err(|error| write_error(&self.path, &error))
    }
}

/// The scenarios of a run, in the order in which they were recorded. A last line that was cut off, as a power cut leaves
/// it, is left out with a warning on standard error.
///
/// # Errors
/// Where the run drove none, or a line is damaged.
pub fn read_outcomes(directory: &RunDirectory) -> Result<Vec<Outcome>> {
    let path = directory.path().join(SCENARIOS);
    let text = fs::read_to_string(&path).map_err(|error| match error.kind() {
        ErrorKind::NotFound => Error::new(format!(
            "there is no {}, so no scenarios to read; was it an offline run?",
            path.display()
        )),
        ErrorKind::InvalidData => Error::new(format!(
            "{} is damaged: it is no text; restore it or run the pipeline anew",
            path.display()
        )),
        _ => Error::new(format!("cannot read {} ({error})", path.display())),
    })?;
    let complete = text.rfind('\n').map_or(0, |end| end + 1);
    if complete < text.len() {
        eprintln!(
            "pdk: warning: the last line of {} was cut off and is left out; run the pipeline again with --out and its folder to drive its scenario",
            path.display()
        );
    }
    let parse = |(number, line): (usize, &str)| {
        serde_json::from_str(line).place(format_args!("{}:{}", path.display(), number + 1))
    };
    text[..complete].lines().enumerate().map(parse).collect()
}

/// Puts the lines of a file in order of a number in each of them, if they are not.
///
/// # Errors
/// Where the file cannot be read or written.
pub fn sort_lines(directory: &RunDirectory, name: &str, field: &str) -> Result<()> {
    let path = directory.path().join(name);
    let text = fs::read_to_string(&path).place(path.display())?;
    let mut lines = Vec::new();
    for line in text.lines() {
        let value: serde_json::Value = serde_json::from_str(line).place(path.display())?;
        lines.push((value[field].as_u64().unwrap_or(u64::MAX), line));
    }
    if lines.is_sorted_by_key(|(number, _)| *number) {
        return Ok(());
    }
    lines.sort_by_key(|(number, _)| *number);
    let part = path.with_extension("part");
    let sorted: String = lines.iter().flat_map(|(_, line)| [*line, "\n"]).collect();
    fs::write(&part, sorted).and_then(|()| fs::rename(&part, &path)).map_err(|error| {
        // On a full disk what is there matters more than its order.
        let _ = fs::remove_file(&part);
        write_error(&path, &error)
    })
}

/// What went wrong with writing, and what to do.
pub fn write_error(path: &Path, error: &std::io::Error) -> Error {
    let remedy = match error.kind() {
        std::io::ErrorKind::StorageFull
        | std::io::ErrorKind::QuotaExceeded
        | std::io::ErrorKind::FileTooLarge => {
            "; free some space and run again, what was recorded so far is kept"
        }
        std::io::ErrorKind::PermissionDenied | std::io::ErrorKind::ReadOnlyFilesystem => {
            "; choose another folder with --out"
        }
        _ => "",
    };
    Error::new(format!("cannot write {} ({error}){remedy}", path.display()))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn lines_are_sorted_by_number_and_complete() {
        let folder = std::env::temp_dir().join(format!("pdk-record-{}", std::process::id()));
        let directory = RunDirectory::create(&folder).unwrap();
        let mut lines = directory.lines(SCENARIOS).unwrap();
        for index in [2, 0, 1] {
            lines.write(&serde_json::json!({ "index": index })).unwrap();
        }
        sort_lines(&directory, SCENARIOS, "index").unwrap();
        let text = fs::read_to_string(folder.join(SCENARIOS)).unwrap();
        assert_eq!(text, "{\"index\":0}\n{\"index\":1}\n{\"index\":2}\n");
        let error = RunDirectory::create(&folder).unwrap_err().to_string();
        assert!(error.ends_with("is not empty; choose another with --out"), "{error}");
        fs::remove_file(folder.join(SCENARIOS)).unwrap();
        let error = RunDirectory::create(&folder).unwrap_err().to_string();
        assert!(error.starts_with("another process is writing to"), "{error}");
        drop(lines);
        drop(directory);
        assert!(RunDirectory::create(&folder).unwrap().recorded().unwrap().is_none());
        fs::remove_dir_all(folder).unwrap();
    }
}
