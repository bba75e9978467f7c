//! The records of the parts of a run, and how they become that of the whole.

use std::collections::{BTreeMap, HashMap};
use std::fmt;
use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};

use pdk_model::scenario::ScenarioId;
use pdk_model::shard::{EvaluatedFrames, ShardList};
use pdk_record::directory::{MANIFEST, RESULTS, RunDirectory, SHARD};
use pdk_record::ledger::{self, Ledger, Line};
use pdk_record::lines::Lines;
use pdk_record::manifest::Manifest;
use pdk_record::trace::reader::{self, Owner};
use pdk_sdk::error::{Error, Place, Result};
use pdk_sdk::file;
use serde::Deserialize;

/// What was put together.
pub struct Merged {
    /// How many scenarios there are.
    pub scenarios: usize,
    /// How many evaluated frames there are.
    pub frames: usize,
}

/// The record of a part.
struct Part {
    directory: RunDirectory,
    manifest: Manifest,
    list: ShardList,
}

impl Part {
    fn open(path: &Path) -> Result<Self> {
        let directory = RunDirectory::open(path)?;
        let shown = path.display();
        let Some(mut manifest) = directory.manifest()? else {
            return Err(Error::new(format!("{shown} holds no {MANIFEST}")));
        };
        let Some(shard) = manifest.shard.take() else {
            return Err(Error::new(format!(
                "{shown} is the record of a whole run; a part is what `pdk run --shard` makes"
            )));
        };
        let Some((list, _)) = file::open_if_there(&path.join(SHARD)).place(&shown)? else {
            return Err(Error::new(format!(
                "part {shard} in {shown} has not come to its end; run it again with --out and its folder"
            )));
        };
        let list: ShardList =
            serde_json::from_reader(std::io::BufReader::new(list)).place(path.join(SHARD).display())?;
        Ok(Self { directory, manifest, list: ShardList { shard, ..list } })
    }

    fn shown(&self) -> impl fmt::Display + '_ {
        self.directory.path().display()
    }
}

/// Puts the records of all parts of a run together: their manifests, their lines in the order of the whole, and their traces. Running the
/// pipeline on the new folder completes it: what is there is not computed again.
///
/// # Errors
/// If a part is missing, is there twice, has not come to its end, or is of another run or of a run that went another way; if the
/// folder is not empty, or something cannot be read or written; if a trace is not there or not whole.
pub fn merge(parts: &[PathBuf], out: &Path) -> Result<Merged> {
    let mut parts = parts.iter().map(|path| Part::open(path)).collect::<Result<Vec<Part>>>()?;
    parts.sort_by_key(|part| part.list.shard.index);
    check(&parts)?;
    let Some((first, others)) = parts.split_first() else { return Ok(Merged { scenarios: 0, frames: 0 }) };
    let mut manifest = first.manifest.clone();
    for other in others {
        manifest = manifest.continuing(&other.manifest).map_err(|difference| {
            Error::new(format!("{} is of another run than {}: {difference}", first.shown(), other.shown()))
        })?;
    }
    check_lists(first, others)?;
    let directory = RunDirectory::create(out)?;
    if directory.manifest()?.is_some() {
        return Err(Error::new(format!(
            "{} holds a record already; choose an empty folder with --out",
            out.display()
        )));
    }
    directory.write_json(MANIFEST, &manifest)?;
    Ok(Merged {
        scenarios: merge_scenarios(&parts, &first.list.scenarios, &directory)?,
        frames: merge_frames(&parts, &first.list.evaluations, &directory)?,
    })
}

/// Puts the ledgers of all parts together, and their traces. Returns how many scenarios there are.
fn merge_scenarios(parts: &[Part], scenarios: &[ScenarioId], directory: &RunDirectory) -> Result<usize> {
    if scenarios.is_empty() {
        return Ok(0);
    }
    let mut lines: HashMap<ScenarioId, (usize, Line)> = HashMap::new();
    for (place, part) in parts.iter().enumerate() {
        // A part without scenarios of its own has no ledger.
        if part.list.shard.own(scenarios.len()).next().is_some() {
            let (found, _) = ledger::read(&part.directory)?;
            lines.extend(found.into_iter().map(|line| (line.id, (place, line))));
        }
    }
    let mut ordered = Vec::with_capacity(scenarios.len());
    for id in scenarios {
        let Some((place, line)) = lines.remove(id) else {
            return Err(Error::new(format!(
                "no part has a line of scenario {id}; run the parts again with --out and their folders"
            )));
        };
        let (from, to) = (parts[place].directory.trace_path(id), directory.trace(id)?);
        reader::check(&from, Owner::of(&line))?;
        link(&from, &to).place(format_args!("cannot take over the trace {}", from.display()))?;
        ordered.push(line);
    }
    Ledger::open(directory)?.add_all(&ordered)?;
    Ok(ordered.len())
}

/// Which frame a line of results is of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Deserialize)]
struct FramePlace {
    evaluation: usize,
    index: usize,
}

/// Puts the results of all parts together. Returns how many frames there are.
fn merge_frames(parts: &[Part], evaluations: &[EvaluatedFrames], directory: &RunDirectory) -> Result<usize> {
    if evaluations.is_empty() {
        return Ok(0);
    }
    // The lines of a frame, one for each perturbation, stay in their order.
    let mut found: BTreeMap<FramePlace, Vec<u8>> = BTreeMap::new();
    for part in parts {
        let path = part.directory.path().join(RESULTS);
        let Some((mut file, _)) = file::open_if_there(&path).place(path.display())? else { continue };
        let mut text = Vec::new();
        file.read_to_end(&mut text).place(path.display())?;
        for (number, line) in text.split_inclusive(|byte| *byte == b'\n').enumerate() {
            let place: FramePlace =
                serde_json::from_slice(line).place(format_args!("{}:{}", path.display(), number + 1))?;
            found.entry(place).or_default().extend_from_slice(line);
        }
    }
    let (mut lines, _) = Lines::open(&directory.path().join(RESULTS))?;
    for (evaluation, EvaluatedFrames { frames, .. }) in evaluations.iter().enumerate() {
        for index in 0..*frames {
            let Some(text) = found.get(&FramePlace { evaluation, index }) else {
                return Err(Error::new(format!(
                    "no part has frame {index} of evaluation {evaluation}; run the parts again with --out and their folders"
                )));
            };
            lines.add(text)?;
        }
    }
    lines.sync()?;
    Ok(evaluations.iter().map(|evaluation| evaluation.frames).sum())
}

/// Makes sure that these are all parts of one run, each once.
fn check(parts: &[Part]) -> Result<()> {
    let Some(first) = parts.first() else { return Err(Error::new("name the records of the parts")) };
    let of = first.list.shard.of;
    if let Some(other) = parts.iter().find(|part| part.list.shard.of != of) {
        return Err(Error::new(format!(
            "{} is part {} and {} part {}, which is another division of the run",
            first.shown(),
            first.list.shard,
            other.shown(),
            other.list.shard
        )));
    }
    if let Some(pair) = parts.windows(2).find(|pair| pair[0].list.shard == pair[1].list.shard) {
        return Err(Error::new(format!(
            "{} and {} are the same part, {}",
            pair[0].shown(),
            pair[1].shown(),
            pair[0].list.shard
        )));
    }
    let is_there = |index: &usize| parts.iter().any(|part| part.list.shard.index == *index);
    let missing: Vec<String> =
        (1..=of).filter(|index| !is_there(index)).map(|index| index.to_string()).collect();
    if !missing.is_empty() {
        return Err(Error::new(format!("of {of} parts these are missing: {}", missing.join(", "))));
    }
    Ok(())
}

/// Makes sure that all parts came to the same scenarios and evaluations.
fn check_lists(first: &Part, others: &[Part]) -> Result<()> {
    let differs = |part: &&Part| {
        (&part.list.scenarios, &part.list.evaluations) != (&first.list.scenarios, &first.list.evaluations)
    };
    match others.iter().find(differs) {
        None => Ok(()),
        Some(other) => Err(Error::new(format!(
            "the parts {} and {} have different scenarios: the pipeline decides by outcomes what to drive, so it cannot be run in parts; \
             use --pool",
            first.list.shard, other.list.shard
        ))),
    }
}

/// The same file at another place, without a copy where the file system allows that.
fn link(from: &Path, to: &Path) -> std::io::Result<()> {
    match fs::hard_link(from, to) {
        Ok(()) => Ok(()),
        Err(_) => fs::copy(from, to).map(drop),
    }
}
