//! What was written, with hashes and seeds; and the journal by which a run that was ended is continued.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};

use pdk_sdk::error::{Error, Place, Result};
use pdk_sdk::file;
use serde::{Deserialize, Serialize};
use serde_json::{Value, json};
use walkdir::WalkDir;

/// The file that lists all that was written.
pub const MANIFEST: &str = "manifest.json";
/// Bytes of a manifest that is read: some hundreds of millions of files.
const LARGEST: u64 = 64 << 30;
/// The journal of a run that is not done.
const JOURNAL: &str = ".manifest.journal";

/// A file of the dataset, as it was written under one condition.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Written {
    /// The folder of the condition.
    pub condition: String,
    /// The file's path in it.
    pub file: String,
    /// BLAKE3 of what was written.
    pub blake3: String,
    /// BLAKE3 of what it was made from.
    pub source: String,
    /// What its draws come from; none for what is copied, and for labels of many pictures.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
}

/// What has been written by now.
pub struct Manifest {
    folder: PathBuf,
    settings: Value,
    written: BTreeMap<(String, String), Written>,
    journal: File,
}

impl Drop for Manifest {
    fn drop(&mut self) {
        // Not left to the closing of the file, which a process that another thread is just starting may have open too.
        let _ = self.journal.unlock();
    }
}

impl Manifest {
    /// Begins or continues in a folder. `settings` is all that decides what is written.
    ///
    /// # Errors
    /// If the folder holds something else, another process writes to it, or it cannot be written to.
    pub fn open(folder: &Path, settings: Value) -> Result<Self> {
        let place = format!("the folder {}", folder.display());
        let (done, journal) = (folder.join(MANIFEST), folder.join(JOURNAL));
        if !done.is_file()
            && !journal.is_file()
            && folder.read_dir().is_ok_and(|mut entries| entries.next().is_some())
        {
            return Err(Error::new(format!(
                "{place} has other files in it; name an empty or a new folder with -o"
            )));
        }
        std::fs::create_dir_all(folder).place(&place)?;
        let opened = File::options().create(true).append(true).read(true).open(&journal).place(&place)?;
        opened.try_lock().map_err(|_| {
            Error::new(format!(
                "another process writes to {place}; wait for it, or name another folder with -o"
            ))
        })?;
        let mut manifest =
            Self { folder: folder.to_owned(), settings, written: BTreeMap::new(), journal: opened };
        let fits = |found: &Value| match *found == manifest.settings {
            true => Ok(()),
            false => {
                let [before, now] = differing(found, &manifest.settings);
                Err(Error::new(format!(
                    "{place} was written with {before}, and this command has {now}; name another folder with -o, or repeat the command \
                     as it was"
                )))
            }
        };
        let mut known = Vec::new();
        if done.is_file() {
            let text = file::read_text(&done, LARGEST).place(&place)?;
            let document: Value = serde_json::from_str(&text).place(format_args!("{}", done.display()))?;
            fits(&document["settings"])?;
            for file in document["files"].as_array().into_iter().flatten() {
                for (condition, blake3) in file["written"].as_object().into_iter().flatten() {
                    let text = |value: &Value| value.as_str().unwrap_or_default().to_owned();
                    known.push(Written {
                        condition: condition.clone(),
                        file: text(&file["file"]),
                        blake3: text(blake3),
                        source: text(&file["source"]),
                        seed: file["seed"].as_u64(),
                    });
                }
            }
        }
        let mut lines = BufReader::new(File::open(&journal).place(&place)?).lines();
        // A line that was cut off is one that was not written.
        let first =
            lines.next().and_then(Result::ok).and_then(|line| serde_json::from_str::<Value>(&line).ok());
        match first {
            Some(found) => {
                fits(&found)?;
                known.extend(
                    lines
                        .map_while(Result::ok)
                        .filter_map(|line| serde_json::from_str::<Written>(&line).ok()),
                );
            }
            None => {
                manifest.journal.set_len(0).place(&place)?;
                manifest.line(&manifest.settings.clone())?;
            }
        }
        for written in known {
            manifest.written.insert((written.condition.clone(), written.file.clone()), written);
        }
        manifest.remove_parts()?;
        Ok(manifest)
    }

    /// Removes what a process left that was ended in the middle of a file.
    fn remove_parts(&self) -> Result<()> {
        for entry in WalkDir::new(&self.folder).into_iter().flatten() {
            if entry.file_type().is_file() && file::whole_of(&entry.file_name().to_string_lossy()).is_some() {
                std::fs::remove_file(entry.path())
                    .place(format_args!("cannot remove {}", entry.path().display()))?;
            }
        }
        Ok(())
    }

    /// What was written under a condition before this process, by the file's path.
    pub fn known(&self) -> BTreeMap<(String, String), Written> {
        self.written.clone()
    }

    /// Notes a file.
    ///
    /// # Errors
    /// If the journal cannot be written.
    pub fn add(&mut self, written: Written) -> Result<()> {
        self.line(&serde_json::to_value(&written)?)?;
        self.written.insert((written.condition.clone(), written.file.clone()), written);
        Ok(())
    }

    fn line(&self, value: &Value) -> Result<()> {
        let mut line = serde_json::to_string(value)?;
        line.push('\n');
        (&self.journal)
            .write_all(line.as_bytes())
            .place(format_args!("cannot write to {}", self.folder.display()))
    }

    /// Writes the manifest, which is the same whatever the order in which files were written, and removes the journal.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn finish(self, conditions: &Value) -> Result<PathBuf> {
        let mut files: BTreeMap<&str, Value> = BTreeMap::new();
        for ((condition, name), written) in &self.written {
            let entry = files.entry(name).or_insert_with(|| {
                let mut entry = json!({ "file": name, "source": written.source });
                if let Some(seed) = written.seed {
                    entry["seed"] = seed.into();
                }
                entry["written"] = json!({});
                entry
            });
            entry["written"][condition] = written.blake3.clone().into();
        }
        let path = self.folder.join(MANIFEST);
        let document = json!({ "settings": self.settings, "conditions": conditions, "files": files.values().collect::<Vec<_>>() });
        let place = format!("cannot write {}", path.display());
        file::write_with(&path, |out| {
            serde_json::to_writer_pretty(&mut *out, &document).map_err(std::io::Error::from)?;
            out.write_all(b"\n")
        })
        .place(&place)?;
        std::fs::remove_file(self.folder.join(JOURNAL)).place(&place)?;
        Ok(path)
    }
}

/// Settings of a kind that an error names before it only counts them.
const NAMED: usize = 3;
/// What settings are called that are not options of the same name.
const OTHER_NAMES: [(&str, &str); 6] = [
    ("conditions", "conditions"),
    ("dataset", "dataset"),
    ("format", "form of the manifest"),
    ("parameters", "parameters of the reader"),
    ("pictures", "--format"),
    ("stored", "form of the files"),
];

/// In what settings differ: what these were, and what they are now.
fn differing(before: &Value, now: &Value) -> [String; 2] {
    // The rule follows from the dataset.
    let differs = |key: &&String| before[key.as_str()] != now[key.as_str()] && *key != "rule";
    let keys = || now.as_object().into_iter().chain(before.as_object()).flat_map(serde_json::Map::keys);
    let mut differing: Vec<&str> = Vec::new();
    for key in keys().filter(differs).map(String::as_str) {
        if !differing.contains(&key) {
            differing.push(key);
        }
    }
    if differing.is_empty() {
        return ["other settings", "its own"].map(str::to_owned);
    }
    let side = |own: &Value, other: &Value| {
        let parts: Vec<_> = differing.iter().map(|key| setting(key, &own[*key], &other[*key])).collect();
        parts.join(" and ")
    };
    [side(before, now), side(now, before)]
}

/// A setting as a user writes it; of a list or a table what the other one does not have.
fn setting(key: &str, own: &Value, other: &Value) -> String {
    let name = match OTHER_NAMES.iter().find(|(setting, _)| *setting == key) {
        Some((_, name)) => (*name).to_owned(),
        None => format!("--{key}"),
    };
    let plain = |value: &Value| value.as_str().map_or_else(|| value.to_string(), str::to_owned);
    let entries: Vec<String> = match own {
        Value::Null | Value::Bool(false) => return format!("no {name}"),
        Value::Array(list) if list.is_empty() => return format!("no {name}"),
        Value::Bool(true) => return name,
        Value::Array(list) => {
            let others: &[Value] = other.as_array().map_or(&[], Vec::as_slice);
            let entry = |entry: &Value| {
                let Some(folder) = entry["folder"].as_str() else { return plain(entry) };
                match others.iter().find(|other| other["folder"] == folder) {
                    // The perturbation itself has changed, and not the condition.
                    Some(other) if other["version"] != entry["version"] => {
                        format!("{folder} of version {}", entry["version"])
                    }
                    Some(_) => format!("{folder} of other code"),
                    None => folder.to_owned(),
                }
            };
            list.iter().filter(|own| !others.contains(own)).map(entry).collect()
        }
        Value::Object(table) => table
            .iter()
            .filter(|(key, own)| other[key.as_str()] != **own)
            .map(|(key, own)| format!("{key}={}", plain(own)))
            .collect(),
        value => vec![plain(value)],
    };
    match entries.len() {
        0 => format!("no other {name}"),
        few if few <= NAMED => format!("{name} {}", entries.join(", ")),
        many => format!("{name} {} and {} more", entries[..NAMED].join(", "), many - NAMED),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_settings_that_differ_are_named_with_both_values() {
        let before = json!({
            "dataset": "a", "seed": 3, "rule": "each", "masks": [], "plain": false, "pictures": "same",
            "conditions": [{"folder": "fog/1", "version": 1}, {"folder": "fog/2", "version": 1}],
        });
        let differs = |key: &str, value: Value| {
            let mut now = before.clone();
            now[key] = value;
            let [before, now] = differing(&before, &now);
            format!("{before} | {now}")
        };
        assert_eq!(differs("seed", json!(4)), "--seed 3 | --seed 4");
        assert_eq!(differs("dataset", json!("b")), "dataset a | dataset b");
        assert_eq!(differs("pictures", json!("png")), "--format same | --format png");
        assert_eq!(differs("plain", json!(true)), "no --plain | --plain");
        assert_eq!(differs("masks", json!(["x", "y"])), "no --masks | --masks x, y");
        let conditions = json!([{"folder": "fog/1", "version": 1}, {"folder": "rain/1", "version": 1}]);
        assert_eq!(differs("conditions", conditions), "conditions fog/2 | conditions rain/1");
        let other_version = json!([{"folder": "fog/1", "version": 2}, {"folder": "fog/2", "version": 1}]);
        assert_eq!(
            differs("conditions", other_version),
            "conditions fog/1 of version 1 | conditions fog/1 of version 2"
        );
        assert_eq!(
            differs("parameters", json!({"side": "left"})),
            "no parameters of the reader | parameters of the reader side=left"
        );
        let mut now = before.clone();
        (now["seed"], now["quality"]) = (json!(1), json!(50));
        assert_eq!(differing(&before, &now), ["--seed 3 and no --quality", "--seed 1 and --quality 50"]);
    }
}
