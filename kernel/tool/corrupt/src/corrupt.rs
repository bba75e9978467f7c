//! A dataset, perturbed on all cores.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::mpsc;

use indicatif::ProgressBar;
use pdk_components::registry::Registry;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, Result};
use serde_json::{Map, Value, json};

use crate::checks::{apart, checked, distinct};
use crate::conditions::Condition;
use crate::contents::{Contents, Role};
use crate::manifest::{Manifest, Written};
use crate::options::{LabelsOption, Options};
use crate::source::{Source, source};
use crate::unit::{Job, Unit, Worker};

/// What was done.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Done {
    /// How the dataset was read.
    pub read_as: String,
    /// Pictures of the dataset.
    pub pictures: usize,
    /// The files of each role but pictures: what one is called, what several are, and how many there are.
    pub others: Vec<([&'static str; 2], usize)>,
    /// Files that were written, and those that were there.
    pub written: usize,
    /// Files that were there already.
    pub there: usize,
    /// Pictures among those that were written.
    pub pictures_written: usize,
    /// What a user should know.
    pub warnings: Vec<String>,
    /// The manifest.
    pub manifest: PathBuf,
}

/// The error for a dataset without pictures; `unread` says why it is not read as the recording that it looks like.
fn without_pictures(dataset: &str, unread: Option<&Error>) -> Error {
    Error::new(match unread {
        Some(unread) => format!(
            "`{dataset}` cannot be read as a recording ({unread}), and has no files with pictures (JPEG, PNG, BMP or WebP); name its reader with \
             parameters that fit, as in READER,path=DIR,PARAMETER=VALUE"
        ),
        None => format!(
            "`{dataset}` has no pictures (JPEG, PNG, BMP or WebP); name a folder with pictures, or a recording that `pdk list dataset` knows"
        ),
    })
}

/// Writes a dataset under each condition. `dataset` is a folder, or a reader with its parameters.
///
/// # Errors
/// If the dataset cannot be read, the folder to write to lies in it, two files would be written as one, a perturbation fails or cannot say how
/// it moves the labels, or something cannot be written. What was written stays, and the same call continues.
pub fn corrupt(
    registry: &Registry,
    dataset: &str,
    conditions: &[Condition],
    options: &Options,
    progress: &ProgressBar,
) -> Result<Done> {
    let source = source(registry, dataset, options)?;
    apart(dataset, &source, &options.out)?;
    distinct(&source, options)?;
    let mut done = Done { read_as: source.read_as.clone(), ..Done::default() };
    let moves = checked(registry, dataset, &source, conditions, options, &mut done.warnings)?;
    let units = units(&source, conditions.len(), options);
    done.pictures = match &source.form {
        Some(form) => form.files.iter().map(|file| file.frames).sum(),
        None => units.iter().filter(|unit| !matches!(unit, Unit::File(..))).count(),
    };
    done.others = counts(&source.contents);
    if done.pictures == 0 {
        return Err(without_pictures(dataset, source.unread.as_ref()));
    }
    let described = described(registry, conditions)?;
    let mut manifest = Manifest::open(&options.out, settings(dataset, &source, &described, options))?;
    let Source { root, contents, reader, frames, form, .. } = source;
    let held = form.into_iter().flat_map(|form| form.files).map(|file| (file.name, file.frames)).collect();
    let known = manifest.known();
    let job =
        Job { registry, options, conditions, moves, root, contents, reader, frames, held, known, progress };
    progress.set_length(units.iter().map(|unit| job.steps(unit)).sum());
    let (next, stop) = (AtomicUsize::new(0), AtomicBool::new(false));
    let mut failed: Option<(usize, Error)> = None;
    std::thread::scope(|scope| {
        let (send, receive) = mpsc::channel::<Message>();
        for _ in 0..options.workers.clamp(1, units.len()) {
            let send = send.clone();
            let (job, units, next, stop) = (&job, &units, &next, &stop);
            scope.spawn(move || work(job, units, next, stop, &send));
        }
        drop(send);
        for message in receive {
            let result = match message {
                Message::Written(written, there) => {
                    let counted = if there { &mut done.there } else { &mut done.written };
                    *counted += 1;
                    done.pictures_written += match there {
                        true => 0,
                        false => job.pictures_in(&written.file),
                    };
                    if there { Ok(()) } else { manifest.add(written).map_err(|error| (usize::MAX, error)) }
                }
                Message::Failed(place, error) => Err((place, error)),
            };
            if let Err((place, error)) = result {
                stop.store(true, Ordering::Relaxed);
                // Of several, the one that comes first in the dataset is reported.
                if failed.as_ref().is_none_or(|(before, _)| place < *before) {
                    failed = Some((place, error));
                }
            }
        }
    });
    progress.finish_and_clear();
    if let Some((_, error)) = failed {
        return Err(error);
    }
    done.manifest = manifest.finish(&described)?;
    Ok(done)
}

enum Message {
    Written(Written, bool),
    Failed(usize, Error),
}

/// Does units until there are none left.
fn work(job: &Job<'_>, units: &[Unit], next: &AtomicUsize, stop: &AtomicBool, send: &mpsc::Sender<Message>) {
    let tell = |message| _ = send.send(message);
    let mut worker = match Worker::new(job) {
        Ok(worker) => worker,
        Err(error) => return tell(Message::Failed(0, error)),
    };
    while !stop.load(Ordering::Relaxed) {
        let place = next.fetch_add(1, Ordering::Relaxed);
        let Some(unit) = units.get(place) else { return };
        if let Err(error) = worker.run(unit, &mut |written, there| tell(Message::Written(written, there))) {
            return tell(Message::Failed(place, error));
        }
    }
}

/// All that there is to do. What takes long for a single file comes first.
fn units(source: &Source, conditions: usize, options: &Options) -> Vec<Unit> {
    if source.root.is_none() {
        return (0..source.count).map(Unit::Frame).collect();
    }
    let roles = || source.contents.roles.iter();
    let kept = |role: Role| {
        let label =
            role.is_placed() || matches!(role, Role::Records | Role::Table | Role::Lengths | Role::Beside);
        !(label && options.labels == LabelsOption::Drop)
    };
    let alone = |role: Role| {
        matches!(
            role,
            Role::Coco
                | Role::Records
                | Role::Table
                | Role::Lengths
                | Role::Fixed
                | Role::Other
                | Role::Frames
                | Role::Beside
        )
    };
    let mut others: Vec<_> = roles().filter(|(_, role)| alone(**role) && kept(**role)).collect();
    others.sort_by_key(|(_, role)| !matches!(role, Role::Coco | Role::Frames));
    let others = others
        .into_iter()
        .flat_map(|(name, _)| (0..conditions).map(|condition| Unit::File(name.clone(), condition)));
    let pictures = source.contents.of_role(Role::Picture).map(|name| Unit::Picture(name.to_owned()));
    others.chain(pictures).collect()
}

fn counts(contents: &Contents) -> Vec<([&'static str; 2], usize)> {
    let mut counts: BTreeMap<[&str; 2], usize> = BTreeMap::new();
    contents
        .roles
        .values()
        .filter(|role| **role != Role::Picture)
        .for_each(|role| *counts.entry(role.names()).or_default() += 1);
    counts.into_iter().collect()
}

/// The conditions, for the manifest.
fn described(registry: &Registry, conditions: &[Condition]) -> Result<Value> {
    let describe = |condition: &Condition| {
        let entry = registry.catalog().get(Kind::Perturbation, &condition.applied.name)?;
        let Condition { applied, folder } = condition;
        let code = std::fs::read(entry.code()).ok().map(|bytes| blake3::hash(&bytes).to_hex().to_string());
        let of_user = if entry.is_built_in() { None } else { code };
        Ok(
            json!({ "folder": folder, "perturbation": applied, "version": entry.description.version, "blake3": of_user }),
        )
    };
    conditions.iter().map(describe).collect::<Result<Vec<_>>>().map(Value::Array)
}

/// All that decides what is written, but for the files of the dataset, which have hashes of their own.
fn settings(dataset: &str, source: &Source, described: &Value, options: &Options) -> Value {
    let name = Path::new(dataset).file_name().map(|name| name.to_string_lossy().into_owned());
    let Options { seed, visible, outside, quality, plain, .. } = options;
    let files = source.form.iter().flat_map(|form| &form.files).filter(|file| !file.stored.is_empty());
    let stored: BTreeMap<&str, &str> = files.map(|file| (file.name.as_str(), file.stored.as_str())).collect();
    let mut settings = json!({
        "format": 1,
        "dataset": source.reader.as_ref().map_or_else(|| name.unwrap_or_default(), |reader| reader.name.clone()),
        "seed": seed,
        "rule": match source.reader.is_none() {
            true => "each picture draws from the seed and its path in the dataset",
            false => "the recording is one sequence, which draws from the seed; the number and the time of a frame decide the rest",
        },
        "labels": match options.labels {
            LabelsOption::Move => "move",
            LabelsOption::Keep => "keep",
            LabelsOption::Drop => "drop",
        },
        "visible": visible,
        "outside": outside,
        "masks": options.masks,
        "pictures": options.format.name(),
        "quality": quality,
        "plain": plain,
        "conditions": described,
    });
    if !stored.is_empty() {
        settings["stored"] = json!(stored);
    }
    // The place of the recording does not matter, but what is read of it does.
    let parameters = source.reader.iter().flat_map(|reader| &reader.parameters);
    let parameters: Map<String, Value> = parameters
        .filter(|(name, _)| *name != "path")
        .map(|(name, value)| (name.clone(), value.clone()))
        .collect();
    if !parameters.is_empty() {
        settings["parameters"] = parameters.into();
    }
    settings
}
