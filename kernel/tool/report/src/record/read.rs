//! Reads a record as a whole.

use std::collections::HashSet;
use std::io::{Read as _, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use pdk_record::directory::{
    BLOCKS, MANIFEST, PERFORMANCE, RESULTS, RunDirectory, SCENARIOS, SUMMARY, VERDICT,
};
use pdk_record::ledger::{self, Line};
use pdk_sdk::error::{Error, Place, Result};
use pdk_sdk::file;
use serde::de::DeserializeOwned;
use serde_json::Value;

use super::clips::clip_folder;
use super::setup::{setup, title};
use super::times::Performance;
use super::{closed_loop, offline, search, tasks, traces};
use crate::view::{Drive, Other, Run};

/// Failures whose last frames are shown.
const SHOWN_FAILURES: usize = 6;

/// What was read.
#[derive(Debug)]
pub struct Read {
    /// What the page is about.
    pub run: Run,
    /// What could not be read, although the page does without it; one sentence each.
    pub warnings: Vec<String>,
}

/// Reads all that the page in this file says about a run.
///
/// # Errors
/// If the folder holds no record, the record is damaged, or nothing was recorded yet.
pub fn read(folder: &Path, page: &Path) -> Result<Read> {
    let directory = RunDirectory::open(folder)?;
    let manifest = directory
        .manifest()?
        .ok_or_else(|| Error::new(format!("{} lost its {MANIFEST} while it was read", folder.display())))?;
    // An offline run has no ledger.
    let (lines, cut_off) = match folder.join(SCENARIOS).is_file() {
        true => ledger::read(&directory)?,
        false => (Vec::new(), false),
    };
    let mut tasks =
        json::<Value>(&directory, SUMMARY)?.as_ref().map(tasks::read).transpose()?.unwrap_or_default();
    let known: Vec<u64> = tasks.iter().map(|task| task.number).collect();
    let (evaluations, under_way) = offline::read(&directory, &manifest.evaluations, &known)?;
    tasks.extend(under_way);
    let searches = search::read(&directory, folder, &lines)?;
    if lines.is_empty() && evaluations.is_empty() && tasks.is_empty() && searches.is_empty() {
        if folder.join(BLOCKS).is_file() {
            return Err(Error::new(format!(
                "the record in {} is that of a gate on recordings, which has no drives to show; see its {BLOCKS} and {VERDICT}",
                folder.display()
            )));
        }
        return Err(Error::new(format!(
            "the record in {} holds no scenario and no result yet; wait for the first, or run the pipeline again",
            folder.display()
        )));
    }
    let unfinished = unfinished(&directory, &lines, cut_off, evaluations.len() + tasks.len())?;
    let mut drives = closed_loop::drives(&lines, folder, &clip_folder(folder, page)?);
    let mut warnings: Vec<String> =
        cut_off_files(&directory, cut_off).map(|name| cut_off_warning(&folder.join(name))).collect();
    warnings.extend(traces::add(&directory, &lines, &mut drives, SHOWN_FAILURES));
    let performance: Option<Performance> = json(&directory, PERFORMANCE)?;
    let run = Run {
        title: title(&manifest),
        folder: folder.display().to_string(),
        started: performance.as_ref().map(|performance| performance.started_unix_seconds),
        unfinished,
        setup: setup(&manifest),
        drives,
        evaluations,
        tasks,
        searches,
        drive_times: performance.as_ref().and_then(Performance::drive),
        evaluate_times: performance.as_ref().map(Performance::evaluations).unwrap_or_default(),
        others: Vec::new(),
    };
    Ok(Read { run, warnings })
}

/// Reads several records for one page that compares them.
///
/// # Errors
/// As for [`read`]; also if there are none.
pub fn read_all(folders: &[PathBuf], page: &Path) -> Result<Read> {
    let mut all = folders.iter().map(|folder| read(folder, page)).collect::<Result<Vec<_>>>()?;
    let names = |read: &Read| -> Vec<(String, String, String)> {
        let name = |drive: &Drive| (drive.simulator.clone(), drive.driver.clone(), drive.mode.clone());
        read.run.drives.iter().map(name).collect()
    };
    let known: Vec<_> = all.iter().map(names).collect();
    for (place, read) in all.iter_mut().enumerate() {
        let folder = read.run.folder.clone();
        let elsewhere = |name: &(String, String, String)| {
            known.iter().enumerate().any(|(other, names)| other != place && names.contains(name))
        };
        // The record tells the same driver in two records apart.
        for (drive, name) in read.run.drives.iter_mut().zip(&known[place]).filter(|(_, name)| elsewhere(name))
        {
            drive.driver = format!("{} of {folder}", name.1);
        }
    }
    let mut all = all.into_iter();
    let Some(mut first) = all.next() else { return Err(Error::new("name at least one record")) };
    let mut titles = vec![first.run.title.clone()];
    for Read { run, warnings } in all {
        titles.push(run.title);
        first.warnings.extend(warnings);
        first.run.drives.extend(run.drives);
        // Evaluations and tasks of a run share their numbers, and one that failed has one too.
        let numbers = first.run.evaluations.iter().map(|one| one.number);
        let numbers = numbers.chain(first.run.tasks.iter().map(|one| one.number));
        let count = numbers.max().map_or(0, |last| last + 1);
        let evaluations = run.evaluations.into_iter();
        first
            .run
            .evaluations
            .extend(evaluations.map(|one| crate::Evaluation { number: count + one.number, ..one }));
        let tasks = run.tasks.into_iter();
        first.run.tasks.extend(tasks.map(|one| crate::Task { number: count + one.number, ..one }));
        first.run.searches.extend(run.searches);
        first.run.unfinished = first.run.unfinished.or_else(|| run.unfinished.clone());
        first.run.others.push(Other { folder: run.folder, unfinished: run.unfinished, setup: run.setup });
    }
    titles.dedup();
    first.run.title = titles.join(" and ");
    Ok(first)
}

/// How many scenarios a page is about.
pub fn scenarios(run: &Run) -> usize {
    run.drives.iter().map(|drive: &Drive| drive.scenarios.len()).sum()
}

/// A JSON file of the record; none if it is not there.
fn json<T: DeserializeOwned>(directory: &RunDirectory, name: &str) -> Result<Option<T>> {
    let path = directory.path().join(name);
    let Some((mut file, _)) = file::open_if_there(&path).place(path.display())? else { return Ok(None) };
    let mut text = Vec::new();
    file.read_to_end(&mut text).place(path.display())?;
    serde_json::from_slice(&text).map(Some).place(path.display())
}

/// How the record shows that its run did not come to the end: the summary is written last, and knows all lines.
fn unfinished(
    directory: &RunDirectory,
    lines: &[Line],
    cut_off: bool,
    evaluations: usize,
) -> Result<Option<String>> {
    let what = "This page is about the part that was recorded.";
    if let Some(name) = cut_off_files(directory, cut_off).next() {
        return Ok(Some(format!("The last line of {name} is cut off and left out. {what}")));
    }
    let summary: Option<Value> = json(directory, SUMMARY)?;
    let Some(summary) = summary else {
        return Ok(Some(format!("It has no {SUMMARY}: it was ended early or is still going on. {what}")));
    };
    let known = |field: &str| summary[field].as_array().map_or(&[][..], Vec::as_slice);
    // A scenario that was asked for several times has one line, and an outcome each time.
    let ids: HashSet<&str> = known("outcomes").iter().filter_map(|outcome| outcome["id"].as_str()).collect();
    let same = lines.iter().all(|line| ids.contains(line.id.to_string().as_str()))
        && known("evaluations").len() == evaluations;
    Ok((!same).then(|| format!("Its {SUMMARY} does not know all that was recorded. {what}")))
}

/// The files of a record whose last lines are cut off; of its ledger it is known.
fn cut_off_files(directory: &RunDirectory, ledger: bool) -> impl Iterator<Item = &'static str> {
    let files = [(SCENARIOS, ledger), (RESULTS, ends_within_a_line(&directory.path().join(RESULTS)))];
    files.into_iter().filter_map(|(name, cut_off)| cut_off.then_some(name))
}

/// What a user should know of a ledger or a file of results whose last line is cut off.
pub fn cut_off_warning(file: &Path) -> String {
    let what = if file.ends_with(RESULTS) { "result" } else { "scenario" };
    format!("the last line of {} is cut off, so its {what} is left out", file.display())
}

/// Whether a file ends within a line.
fn ends_within_a_line(path: &Path) -> bool {
    let mut last = [b'\n'];
    let Ok((mut file, _)) = file::open(path) else { return false };
    let read = file.seek(SeekFrom::End(-1)).and_then(|_| file.read_exact(&mut last));
    // One that is empty has no line.
    read.is_ok() && last != [b'\n']
}
