//! Compares the records of runs, changes them, and waits for what comes into them.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Child;
use std::time::{Duration, Instant};

use pdk_model::scenario::{Scenario, ScenarioId};
use pdk_record::directory::{PERFORMANCE, RunDirectory, SCENARIOS};
use pdk_record::ledger::{self, Ledger, Line};
use pdk_record::trace::reader::{Entry, TraceReader, read_steps};
use pdk_record::trace::step::{Digest, Step};
use pdk_record::trace::writer::Trace;
use serde_json::Value;

use crate::process::LIMIT;

/// The trace of a scenario, of which this is the line in `scenarios.jsonl`.
///
/// # Panics
/// If the line has no id.
pub fn trace(record: &Path, line: &Value) -> PathBuf {
    record.join(format!("traces/{}.mcap", line["id"].as_str().unwrap()))
}

/// Changes the lines of `scenarios.jsonl`, and makes their checksums right again.
///
/// # Panics
/// If they cannot be read or written.
pub fn edit(record: &Path, change: impl FnOnce(&mut Vec<Line>)) {
    let directory = RunDirectory::open(record).unwrap();
    let (mut lines, cut_off) = ledger::read(&directory).unwrap();
    assert!(!cut_off, "the last line is cut off");
    change(&mut lines);
    fs::remove_file(record.join(SCENARIOS)).unwrap();
    let mut ledger = Ledger::open(&directory).unwrap();
    lines.iter().for_each(|line| ledger.add(line).unwrap());
}

/// Changes the scenario of a line as if it had been submitted so: the line has its id, and the trace is of it.
///
/// # Panics
/// If line or trace cannot be read or written.
pub fn change_scenario(record: &Path, number: usize, change: impl FnOnce(&mut Scenario)) {
    let (mut before, mut after) = (None, None);
    edit(record, |lines| {
        let line = &mut lines[number];
        before = Some(line.id);
        change(&mut line.scenario);
        line.id = line.scenario.id();
        after = Some(line.id);
    });
    let trace = |id: Option<ScenarioId>| record.join(format!("traces/{}.mcap", id.unwrap()));
    // That of before stays: the line may be put back.
    write_trace_again(&trace(before), &trace(after), |_| ());
}

/// Changes the steps of a trace and leaves out its images, and makes the digest in the line of its scenario right again.
///
/// # Panics
/// If line or trace cannot be read or written.
pub fn change_steps(trace: &Path, change: impl FnOnce(&mut Vec<Step>)) {
    let digest = write_trace_again(trace, trace, change);
    let record = trace.ancestors().nth(2).unwrap();
    let id = trace.file_stem().unwrap().to_string_lossy().into_owned();
    edit(record, |lines| {
        let line = lines.iter_mut().find(|line| line.id.to_string() == id).unwrap();
        line.outcome.digest = digest;
    });
}

/// Writes the steps and events of a trace to another one, which is of the scenario that it is named after. Returns its digest.
fn write_trace_again(from: &Path, to: &Path, change: impl FnOnce(&mut Vec<Step>)) -> String {
    let mut steps = read_steps(from).unwrap();
    let events: Vec<_> = TraceReader::open(from)
        .unwrap()
        .filter_map(|entry| match entry.unwrap() {
            Entry::Event(event) => Some(event),
            _ => None,
        })
        .collect();
    assert!(!steps.is_empty() && !events.is_empty());
    change(&mut steps);
    let scenario = to.file_stem().unwrap().to_string_lossy().parse().unwrap();
    let mut trace = Trace::create(to, &scenario).unwrap();
    let mut digest = Digest::default();
    for step in &steps {
        trace.step(step).unwrap();
        digest.add(step.frame_hash, &step.control);
    }
    for event in &events {
        trace.event(event.time(), event.failure, &event.text).unwrap();
    }
    trace.finish().unwrap();
    digest.text()
}

/// All files of a record by their path in it, but the one with times.
///
/// # Panics
/// If one cannot be read.
pub fn files(record: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    assert!(record.is_dir(), "there is no {}", record.display());
    let read = |path: PathBuf| {
        let bytes = fs::read(&path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        (path.strip_prefix(record).unwrap().to_owned(), bytes)
    };
    paths(record).into_iter().filter(|path| !path.ends_with(PERFORMANCE)).map(read).collect()
}

/// The first thing in which a record differs from what is expected; none if it is equal.
///
/// # Panics
/// If a file cannot be read.
pub fn difference(record: &Path, expected: &BTreeMap<PathBuf, Vec<u8>>) -> Option<String> {
    let found = files(record);
    let missing = expected.keys().find(|path| !found.contains_key(*path));
    let other = found.iter().find(|(path, bytes)| expected.get(*path) != Some(bytes));
    match (missing, other) {
        (Some(path), _) => Some(format!("{} is missing", path.display())),
        (None, Some((path, bytes))) => match expected.get(path) {
            None => Some(format!("{} is there besides", path.display())),
            Some(wanted) => {
                let place = bytes.iter().zip(wanted).position(|(is, was)| is != was);
                let place = place.unwrap_or(bytes.len().min(wanted.len()));
                let near = |bytes: &[u8]| {
                    let part = &bytes[place.saturating_sub(60)..bytes.len().min(place + 60)];
                    String::from_utf8_lossy(part).into_owned()
                };
                Some(format!(
                    "{} differs from byte {place}: `{}` instead of `{}`",
                    path.display(),
                    near(bytes),
                    near(wanted)
                ))
            }
        },
        (None, None) => None,
    }
}

/// Makes sure that a record is as expected.
///
/// # Panics
/// If it differs.
#[track_caller]
pub fn assert_equal(record: &Path, expected: &BTreeMap<PathBuf, Vec<u8>>) {
    if let Some(difference) = difference(record, expected) {
        panic!("{}: {difference}", record.display());
    }
}

/// How many complete lines a file has; none if there is no such file yet.
pub fn lines(path: &Path) -> usize {
    fs::read(path).map_or(0, |bytes| bytes.iter().filter(|&&byte| byte == b'\n').count())
}

/// Waits until a record has this many scenarios, or the process that writes it has ended.
///
/// # Panics
/// If neither happens within [`LIMIT`].
pub fn wait_for_scenarios(child: &mut Child, record: &Path, count: usize) {
    wait_for_lines(child, &record.join(SCENARIOS), count);
}

/// Waits until a file has this many lines, or the process that writes it has ended.
///
/// # Panics
/// If neither happens within [`LIMIT`].
pub fn wait_for_lines(child: &mut Child, path: &Path, count: usize) {
    let started = Instant::now();
    while lines(path) < count && child.try_wait().unwrap().is_none() {
        assert!(started.elapsed() < LIMIT, "line {count} of {} did not come", path.display());
        std::thread::sleep(Duration::from_millis(1));
    }
}

/// The files of a record that are not complete; none if there is no record yet.
pub fn partial(record: &Path) -> Vec<PathBuf> {
    paths(record).into_iter().filter(|path| path.extension().is_some_and(|ending| ending == "part")).collect()
}

/// The path of each file of a record, as far as they are not removed meanwhile.
fn paths(record: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    let mut folders = vec![record.to_owned()];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(&folder).into_iter().flatten().flatten() {
            let path = entry.path();
            if path.is_dir() { folders.push(path) } else { found.push(path) }
        }
    }
    found
}
