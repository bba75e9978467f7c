//! The record of a run: a folder that anyone can read, compare and replay from.
//!
//! | file | holds |
//! |---|---|
//! | `manifest.json` | what was run: pipeline, settings, seed, versions and hashes of all components and models |
//! | `scenarios.jsonl` | one line a scenario of the closed loop |
//! | `results.jsonl` | one line a frame, perturbation and level of an offline evaluation |
//! | `summary.json` | the table at the end |
//! | `traces/N.mcap` | frames, control, state and events of scenario N |
//! | `performance.json` | when and how fast it ran; the one file that differs between two equal runs |

use std::fs::{self, File};
use std::io::Write;
use std::path::{Path, PathBuf};

use pdk_sdk::error::{Error, Place, Result};
use serde::Serialize;

use crate::drive::Outcome;

pub mod manifest;
pub mod published;
pub mod trace;

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

/// The folder of one run.
#[derive(Debug, Clone)]
pub struct RunDirectory {
    path: PathBuf,
}

impl RunDirectory {
    /// Makes the folder of a new run.
    ///
    /// # Errors
    /// Where the folder holds something already, or cannot be made.
    pub fn create(path: &Path) -> Result<Self> {
        let remedy = "choose another with --out";
        let make = || match fs::read_dir(path).map(|mut entries| entries.next().is_none()) {
            Ok(empty) => Ok(empty),
            Err(_) => {
                path.parent().map_or(Ok(()), fs::create_dir_all)?;
                // Of two runs that start at the same time, one makes it.
                fs::create_dir(path).map(|()| true)
            }
        };
        let empty = make().map_err(|error| {
            Error::new(format!("cannot make the output folder {} ({error}); {remedy}", path.display()))
        })?;
        if !empty {
            return Err(Error::new(format!("the output folder {} is not empty; {remedy}", path.display())));
        }
        // Fails now rather than after an hour where the folder is read-only.
        let probe = path.join(".pdk-write-test");
        File::create(&probe).and_then(|_| fs::remove_file(&probe)).map_err(|error| {
            Error::new(format!("cannot write to the output folder {} ({error}); {remedy}", path.display()))
        })?;
        Ok(Self { path: path.to_owned() })
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
        Ok(Self { path: path.to_owned() })
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

    /// Opens a file to which lines are added as they come.
    ///
    /// # Errors
    /// Where it cannot be written.
    pub fn lines(&self, name: &str) -> Result<Lines> {
        let path = self.path.join(name);
        let file =
            File::options().create(true).append(true).open(&path).map_err(|e| write_error(&path, &e))?;
        let complete = file.metadata().map_err(|e| write_error(&path, &e))?.len();
        Ok(Lines { path, file, complete })
    }

    /// The path of a scenario's trace; makes the folder around it.
    ///
    /// # Errors
    /// Where the folder cannot be made.
    pub fn trace(&self, scenario: u64) -> Result<PathBuf> {
        let folder = self.path.join("traces");
        fs::create_dir_all(&folder).map_err(|error| write_error(&folder, &error))?;
        Ok(folder.join(format!("{scenario:04}.mcap")))
    }
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
    let text = fs::read_to_string(&path).map_err(|error| {
        Error::new(format!("{} has no scenarios to read ({error}); was it an offline run?", path.display()))
    })?;
    let complete = text.rfind('\n').map_or(0, |end| end + 1);
    if complete < text.len() {
        eprintln!(
            "pdk: warning: the last line of {} was cut off and is left out; its scenario has to be driven again",
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
        fs::remove_dir_all(folder).unwrap();
    }
}
