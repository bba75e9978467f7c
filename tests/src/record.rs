//! What a record holds besides lines that can be read as text.

use std::path::{Path, PathBuf};

use pdk_core::directory::{RunDirectory, SCENARIOS};
use pdk_core::ledger::{self, Ledger, Line};
use serde_json::Value;

/// The trace of a scenario, of which this is the line in `scenarios.jsonl`.
///
/// # Panics
/// Where the line has no id.
pub fn trace(record: &Path, line: &Value) -> PathBuf {
    record.join(format!("traces/{}.mcap", line["id"].as_str().unwrap()))
}

/// Changes the lines of `scenarios.jsonl`, so that their checksums are right all the same.
///
/// # Panics
/// Where they cannot be read or written.
pub fn edit(record: &Path, change: impl FnOnce(&mut Vec<Line>)) {
    let directory = RunDirectory::open(record).unwrap();
    let (mut lines, cut_off) = ledger::read(&directory).unwrap();
    assert!(!cut_off, "the last line is cut off");
    change(&mut lines);
    std::fs::remove_file(record.join(SCENARIOS)).unwrap();
    let mut ledger = Ledger::open(&directory).unwrap();
    lines.iter().for_each(|line| ledger.add(line).unwrap());
}
