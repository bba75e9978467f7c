//! The ledger of a run: one line for each scenario that was driven, in `scenarios.jsonl`.
//!
//! While the run lasts, lines are added as outcomes come, after the traces that they speak of, and are synced before the pipeline gets them. When the run is over
//! they are put in the order in which the scenarios were submitted, so that equal runs write equal files on any number of
//! workers. A scenario whose id is in the ledger is answered from it: that is all that continuing a run is.
//!
//! A line is a JSON object that begins with the id and ends with a checksum over all before it, so that neither a half-written
//! nor an edited line counts as a result.

use std::collections::{HashMap, HashSet};
use std::fs::{self, File};
use std::io::{self, Read, Write};
use std::os::unix::fs::FileExt;
use std::path::{Path, PathBuf};

use pdk_model::outcome::Outcome;
use pdk_model::scenario::{Scenario, ScenarioId};
use pdk_sdk::error::{Error, Place, Result};
use pdk_sdk::file;
use serde::{Deserialize, Serialize};

use crate::directory::{RunDirectory, SCENARIOS};
use crate::lines::{Lines, complete, sync_folder, write_error};

/// A line of the ledger.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Line {
    /// The id of the scenario, which its trace is named after.
    pub id: ScenarioId,
    /// What the pipeline calls it.
    pub name: String,
    /// What was driven.
    pub scenario: Scenario,
    /// Every how many frames there is an image in the trace; 0 for none.
    pub images_every: u64,
    /// What happened.
    #[serde(flatten)]
    pub outcome: Outcome,
}

/// What stands before the checksum, and behind it.
const CHECKSUM: &str = ",\"checksum\":\"";
const END: &str = "\"}";
/// What stands before the id.
const ID: &str = "{\"id\":\"";
/// Hexadecimal digits of a checksum.
const DIGITS: usize = 16;

impl Line {
    /// As it is written, with its checksum and a line feed.
    ///
    /// # Errors
    /// If it cannot be JSON.
    fn print(&self) -> Result<String> {
        let mut text = serde_json::to_string(self)?;
        text.pop();
        let sum = checksum(&text);
        Ok(text + CHECKSUM + &sum + END + "\n")
    }
}

fn checksum(text: &str) -> String {
    blake3::hash(text.as_bytes()).to_hex()[..DIGITS].to_owned()
}

/// The id of a written line, and the part of it that is JSON but for a closing brace; none if its checksum is wrong.
fn checked(line: &str) -> Option<(ScenarioId, &str)> {
    let rest = line.strip_suffix(END)?;
    let split = rest.len().checked_sub(DIGITS)?;
    let (before, sum) = (rest.get(..split)?, rest.get(split..)?);
    let body = before.strip_suffix(CHECKSUM)?;
    if checksum(body) != sum {
        return None;
    }
    let (id, _) = body.strip_prefix(ID)?.split_once('"')?;
    Some((id.parse().ok()?, body))
}

/// The line with this number, from 1, of a ledger.
fn parse(path: &Path, number: usize, line: &str) -> Result<Line> {
    let shown = path.display();
    let (_, body) = checked(line).ok_or_else(|| damaged(path, number))?;
    let line: Line = serde_json::from_str(&format!("{body}}}")).place(format_args!("{shown}:{number}"))?;
    let own = line.scenario.id();
    match line.id == own {
        true => Ok(line),
        false => Err(Error::new(format!(
            "{shown}:{number} is not a line as pdk writes it: its id is {} and that of its scenario is {own}; delete the line, and run the \
             pipeline again with --out and this folder",
            line.id
        ))),
    }
}

/// What is wrong with a line that is complete and has a wrong checksum.
fn damaged(path: &Path, number: usize) -> Error {
    Error::new(format!(
        "{}:{number} is damaged or was edited: its checksum is wrong; restore the line, or delete it and run the pipeline \
         again with --out and this folder",
        path.display()
    ))
}

/// The ledger of a run that is being written.
pub struct Ledger {
    path: PathBuf,
    lines: Lines,
    /// Where the line of each scenario is: its first byte and its length without the line feed. Of several the last one counts.
    places: HashMap<ScenarioId, (u64, usize)>,
    /// Whether there are lines that do not count.
    superseded: bool,
}

impl Ledger {
    /// Opens the ledger of a run directory, which may have none yet. A last line that was cut off is removed.
    ///
    /// # Errors
    /// If it cannot be read or written, a line is damaged, or an id is not that of its scenario.
    pub fn open(directory: &RunDirectory) -> Result<Self> {
        let path = directory.path().join(SCENARIOS);
        let (lines, text) = Lines::open(&path)?;
        let text = String::from_utf8(text).map_err(|_| damaged(&path, 1))?;
        let mut places = HashMap::new();
        let mut superseded = false;
        let mut start = 0;
        // Not `lines`, which would forgive an editor that changes how lines end.
        for (number, line) in text.split_terminator('\n').enumerate() {
            let Line { id, .. } = parse(&path, number + 1, line)?;
            superseded |= places.insert(id, (start, line.len())).is_some();
            start += line.len() as u64 + 1;
        }
        Ok(Self { path, lines, places, superseded })
    }

    /// How many scenarios it holds.
    pub fn len(&self) -> usize {
        self.places.len()
    }

    /// Whether it holds none.
    pub fn is_empty(&self) -> bool {
        self.places.is_empty()
    }

    /// Whether there is a line of a scenario.
    pub fn has(&self, id: &ScenarioId) -> bool {
        self.places.contains_key(id)
    }

    /// The line of a scenario; none if it has not been driven.
    ///
    /// # Errors
    /// If it cannot be read any more.
    pub fn get(&self, id: &ScenarioId) -> Result<Option<Line>> {
        let Some((start, length)) = self.places.get(id) else { return Ok(None) };
        let text = read_at(&self.path, *start, *length).place(self.path.display())?;
        parse(&self.path, 0, &text).map(Some)
    }

    /// Adds a line, which is on the disk when this returns.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn add(&mut self, line: &Line) -> Result<()> {
        self.add_all(std::slice::from_ref(line))
    }

    /// Adds a line, which is on the disk after the next [`sync`](Self::sync).
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn push(&mut self, line: &Line) -> Result<()> {
        let (text, start) = (line.print()?, self.lines.length());
        self.lines.add(text.as_bytes())?;
        self.superseded |= self.places.insert(line.id, (start, text.len() - 1)).is_some();
        Ok(())
    }

    /// Makes sure that all lines survive a power cut.
    ///
    /// # Errors
    /// If the disk does not take them.
    pub fn sync(&mut self) -> Result<()> {
        self.lines.sync()
    }

    /// Adds lines, which are on the disk when this returns.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn add_all(&mut self, lines: &[Line]) -> Result<()> {
        for line in lines {
            self.push(line)?;
        }
        self.sync()
    }

    /// Puts the lines in this order, in which each scenario stands once; others come behind them.
    ///
    /// # Errors
    /// If the file cannot be read or written.
    pub fn finish(&mut self, order: &[ScenarioId]) -> Result<()> {
        let mut rank: HashMap<ScenarioId, usize> = HashMap::with_capacity(order.len());
        for (number, id) in order.iter().enumerate() {
            rank.entry(*id).or_insert(number);
        }
        let mut sorted: Vec<(ScenarioId, u64, usize)> =
            self.places.iter().map(|(id, (start, length))| (*id, *start, *length)).collect();
        sorted.sort_by_key(|(id, start, _)| (rank.get(id).copied().unwrap_or(usize::MAX), *start));
        if !self.superseded && sorted.is_sorted_by_key(|(_, start, _)| *start) {
            return Ok(());
        }
        let part = self.path.with_extension("part");
        let written = self.write_sorted(&part, &sorted).and_then(|()| fs::rename(&part, &self.path));
        written.map_err(|error| {
            // On a full disk what is there matters more than its order.
            let _ = fs::remove_file(&part);
            write_error(&self.path, &error)
        })?;
        sync_folder(&self.path);
        self.superseded = false;
        let mut start = 0;
        for (id, _, length) in sorted {
            self.places.insert(id, (start, length));
            start += length as u64 + 1;
        }
        self.lines.replaced(start)
    }

    fn write_sorted(&self, part: &Path, sorted: &[(ScenarioId, u64, usize)]) -> io::Result<()> {
        let from = File::open(&self.path)?;
        let mut file = io::BufWriter::new(File::create(part)?);
        let mut line = Vec::new();
        for (_, start, length) in sorted {
            // With the line feed.
            line.resize(length + 1, 0);
            from.read_exact_at(&mut line, *start)?;
            file.write_all(&line)?;
        }
        file.into_inner().map_err(io::IntoInnerError::into_error)?.sync_all()
    }
}

fn read_at(path: &Path, start: u64, length: usize) -> io::Result<String> {
    let mut bytes = vec![0; length];
    File::open(path)?.read_exact_at(&mut bytes, start)?;
    String::from_utf8(bytes).map_err(|_| io::ErrorKind::InvalidData.into())
}

/// All lines of a record, in the order in which they stand, and whether a last line that was cut off is left out.
///
/// # Errors
/// If the run drove no scenarios, a line is damaged, or an id is not that of its scenario.
pub fn read(directory: &RunDirectory) -> Result<(Vec<Line>, bool)> {
    let path = directory.path().join(SCENARIOS);
    let Some((mut file, _)) = file::open_if_there(&path).place(path.display())? else {
        return Err(Error::new(format!(
            "there is no {}, so no scenarios to read; was it an offline run?",
            path.display()
        )));
    };
    let mut text = Vec::new();
    file.read_to_end(&mut text)
        .map_err(|error| Error::new(format!("cannot read {} ({error})", path.display())))?;
    let complete = complete(&text);
    let whole = std::str::from_utf8(&text[..complete]).map_err(|_| damaged(&path, 1))?;
    let line = |(number, line): (usize, &str)| parse(&path, number + 1, line);
    let mut lines: Vec<Line> = whole.split_terminator('\n').enumerate().map(line).collect::<Result<_>>()?;
    // Of several lines of a scenario, which only a run that has not ended has, the last one counts.
    let mut seen = HashSet::new();
    let mut last: Vec<bool> = lines.iter().rev().map(|line| seen.insert(line.id)).collect();
    lines.retain(|_| last.pop().unwrap_or_default());
    Ok((lines, complete < text.len()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_sdk::error::ErrorKind;
    use serde_json::json;

    fn line(seed: u64) -> Line {
        let scenario: Scenario = serde_json::from_value(json!({
            "simulator": {"name": "lane"}, "driver": {"name": "dave2"}, "duration": 9.5, "seed": seed,
        }))
        .unwrap();
        let outcome = Outcome::of_error(ErrorKind::Failed, "driver `x`: it cannot see".to_owned());
        Line { id: scenario.id(), name: "nominal".to_owned(), scenario, images_every: 6, outcome }
    }

    fn directory(name: &str) -> RunDirectory {
        let folder = std::env::temp_dir().join(format!("pdk-ledger-{name}-{}", std::process::id()));
        let _ = fs::remove_dir_all(&folder);
        RunDirectory::create(&folder).unwrap()
    }

    #[test]
    fn lines_end_in_the_order_of_submission_and_are_found_by_id() {
        let directory = directory("order");
        let mut ledger = Ledger::open(&directory).unwrap();
        let order: Vec<ScenarioId> = (0..5).map(|seed| line(seed).id).collect();
        for seed in [3, 0, 4, 1, 2] {
            ledger.add(&line(seed)).unwrap();
        }
        ledger.finish(&order).unwrap();
        assert_eq!(ledger.get(&order[4]).unwrap(), Some(line(4)));
        ledger.add(&line(9)).unwrap();
        let (lines, cut) = read(&directory).unwrap();
        assert_eq!((lines, cut), ([0, 1, 2, 3, 4, 9].map(line).to_vec(), false));
        drop(ledger);
        let ledger = Ledger::open(&directory).unwrap();
        assert_eq!(ledger.len(), 6);
        assert_eq!(ledger.get(&line(9).id).unwrap(), Some(line(9)));
        assert_eq!(ledger.get(&line(7).id).unwrap(), None);
        fs::remove_dir_all(directory.path()).unwrap();
    }

    #[test]
    fn what_failed_can_be_driven_again_and_the_last_line_counts() {
        let directory = directory("lost");
        let mut ledger = Ledger::open(&directory).unwrap();
        let lost = Outcome::of_error(ErrorKind::Late, "driver `x` has not come back".to_owned());
        ledger.add(&Line { outcome: lost, ..line(0) }).unwrap();
        ledger.add(&line(1)).unwrap();
        assert!(ledger.has(&line(0).id) && !ledger.has(&line(2).id));
        ledger.add(&line(0)).unwrap();
        assert_eq!(ledger.get(&line(0).id).unwrap(), Some(line(0)));
        assert_eq!(read(&directory).unwrap().0, [1, 0].map(line));
        let mut ledger = Ledger::open(&directory).unwrap();
        ledger.finish(&[0, 1].map(|seed| line(seed).id)).unwrap();
        assert_eq!(fs::read_to_string(directory.path().join(SCENARIOS)).unwrap().lines().count(), 2);
        assert_eq!(read(&directory).unwrap().0, [0, 1].map(line));
        fs::remove_dir_all(directory.path()).unwrap();
    }

    #[test]
    fn an_id_is_that_of_its_scenario() {
        let directory = directory("forged");
        let forged = Line { id: line(1).id, ..line(0) };
        let mut ledger = Ledger::open(&directory).unwrap();
        ledger.add_all(&[line(2), forged]).unwrap();
        let sentence = format!("its id is {} and that of its scenario is {}", line(1).id, line(0).id);
        for error in [ledger.get(&line(1).id).err(), Ledger::open(&directory).err(), read(&directory).err()] {
            let error = error.unwrap().to_string();
            assert!(error.contains("scenarios.jsonl:") && error.contains(&sentence), "{error}");
        }
        fs::remove_dir_all(directory.path()).unwrap();
    }

    #[test]
    fn half_lines_are_healed_and_edited_ones_refused() {
        let directory = directory("damage");
        let mut ledger = Ledger::open(&directory).unwrap();
        (0..3).for_each(|seed| ledger.add(&line(seed)).unwrap());
        drop(ledger);
        let path = directory.path().join(SCENARIOS);
        let text = fs::read_to_string(&path).unwrap();
        fs::write(&path, &text[..text.len() - 20]).unwrap();
        assert_eq!(read(&directory).unwrap(), ([0, 1].map(line).to_vec(), true));
        assert_eq!(Ledger::open(&directory).unwrap().len(), 2);
        assert!(!read(&directory).unwrap().1);
        for position in 0..text.find('\n').unwrap() {
            let mut bytes = text.clone().into_bytes();
            bytes[position] ^= 1;
            fs::write(&path, bytes).unwrap();
            let error = Ledger::open(&directory).err().unwrap().to_string();
            assert!(error.contains("scenarios.jsonl:1 is damaged"), "{position}: {error}");
            assert!(read(&directory).is_err());
        }
        fs::remove_dir_all(directory.path()).unwrap();
    }
}
