//! What came of blocks of recordings, as the record keeps it: a line each, in the order in which they were looked at.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use pdk_model::scenario::{Scenario, ScenarioId};
use pdk_record::directory::BLOCKS;
use pdk_record::lines::Lines;
use pdk_sdk::error::{Error, Place, Result};
use pdk_sdk::file;
use serde::{Deserialize, Serialize};

use crate::came::{BlockOutcome, Came};

/// A line.
#[derive(Debug, Serialize, Deserialize)]
struct Line {
    /// The id of the scenario.
    id: ScenarioId,
    /// What the gate calls it.
    name: String,
    /// The scenario.
    scenario: Scenario,
    /// What came of it.
    outcome: BlockOutcome,
    /// The checksum of the outcome and the id.
    checksum: String,
}

/// The file with the blocks of a record that is being written.
pub struct Kept {
    lines: Lines,
    known: BTreeMap<ScenarioId, BlockOutcome>,
}

impl Kept {
    /// Opens the file in the folder of a record, which may have none yet.
    ///
    /// # Errors
    /// If it cannot be read or written, or a line is damaged.
    pub fn open(folder: &Path) -> Result<Self> {
        let path = folder.join(BLOCKS);
        let (lines, text) = Lines::open(&path)?;
        Ok(Self { lines, known: parse(&path, &text)? })
    }

    /// What came of a scenario, if it is known.
    pub fn get(&self, id: &ScenarioId) -> Option<&BlockOutcome> {
        self.known.get(id)
    }

    /// Adds what came of a scenario, unless it is there.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn add(&mut self, name: &str, scenario: &Scenario, outcome: &BlockOutcome) -> Result<()> {
        let id = scenario.id();
        if self.known.insert(id, outcome.clone()).is_some() {
            return Ok(());
        }
        let (name, scenario, outcome) = (name.to_owned(), scenario.clone(), outcome.clone());
        let checksum = Came::Block(outcome.clone()).checksum(&id);
        let line = Line { id, name, scenario, outcome, checksum };
        let mut text = serde_json::to_vec(&line)?;
        text.push(b'\n');
        self.lines.add(&text)?;
        self.lines.sync()
    }
}

/// The blocks of a record; none if it has no file of them.
///
/// # Errors
/// If the file cannot be read, or a line is damaged.
pub fn read(folder: &Path) -> Result<Option<BTreeMap<ScenarioId, BlockOutcome>>> {
    /// Bytes of a file that may be one.
    const LARGEST: u64 = 4 << 30;
    let path: PathBuf = folder.join(BLOCKS);
    if !path.is_file() {
        return Ok(None);
    }
    let text = file::read(&path, LARGEST).place(path.display())?;
    parse(&path, &text).map(Some)
}

fn parse(path: &Path, text: &[u8]) -> Result<BTreeMap<ScenarioId, BlockOutcome>> {
    let mut known = BTreeMap::new();
    // A last line that was cut off does not count.
    for (number, line) in text.split_inclusive(|byte| *byte == b'\n').enumerate() {
        if line.last() != Some(&b'\n') {
            break;
        }
        let place = || format!("{}:{}", path.display(), number + 1);
        let line: Line = serde_json::from_slice(line).place(place())?;
        let own = Came::Block(line.outcome.clone()).checksum(&line.id);
        if own != line.checksum || line.scenario.id() != line.id {
            return Err(Error::new(format!(
                "{} is damaged or was edited: its checksum or its id is wrong; delete the line, and run the gate again with --out and this folder",
                place()
            )));
        }
        known.insert(line.id, line.outcome);
    }
    Ok(known)
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_model::component::ComponentSpec;

    #[test]
    fn blocks_are_known_to_the_next_process_and_an_edited_line_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let scenario = |seed: u64| Scenario {
            seed,
            ..Scenario::new(ComponentSpec::new("tape"), ComponentSpec::new("x"))
        };
        let outcome = |steering_error: f64| BlockOutcome {
            kept: true,
            frames: 3,
            bad_frames: 0,
            steering_error,
            max_steering_error: 0.5,
            throttle_error: None,
            digest: "00".into(),
        };
        assert_eq!(read(folder.path()).unwrap(), None);
        let mut kept = Kept::open(folder.path()).unwrap();
        for seed in [1, 2, 1] {
            kept.add("a", &scenario(seed), &outcome(0.1 * seed as f64)).unwrap();
        }
        drop(kept);
        let path = folder.path().join(BLOCKS);
        let text = std::fs::read_to_string(&path).unwrap();
        assert_eq!(text.lines().count(), 2);
        std::fs::write(&path, format!("{text}{{\"id\"")).unwrap();
        assert_eq!(read(folder.path()).unwrap().unwrap().len(), 2);
        let kept = Kept::open(folder.path()).unwrap();
        assert_eq!(kept.get(&scenario(2).id()), Some(&outcome(0.2)));
        assert_eq!(kept.get(&scenario(3).id()), None);
        for (what, with) in
            [("\"steering_error\":0.1", "\"steering_error\":0.3"), ("\"seed\":1", "\"seed\":4")]
        {
            assert!(text.contains(what), "{text}");
            std::fs::write(&path, text.replace(what, with)).unwrap();
            let error = read(folder.path()).unwrap_err().to_string();
            assert!(error.contains("blocks.jsonl:1 is damaged or was edited"), "{error}");
        }
    }
}
