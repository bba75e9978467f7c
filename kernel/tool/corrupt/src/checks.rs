//! What is checked before anything is written: that labels can be moved along under all conditions, and that no file takes the place of another.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use pdk_chain::chain::Chain;
use pdk_chain::moment::Moment;
use pdk_components::registry::Registry;
use pdk_labels::Labels;
use pdk_sdk::describe::{Kind, Temporal};
use pdk_sdk::error::{Error, Result};
use pdk_sdk::file;

use crate::conditions::Condition;
use crate::contents::{LARGEST_LABELS, Role};
use crate::labels::table;
use crate::options::{Format, LabelsOption, Options};
use crate::source::{Source, steerings};

/// Whether each condition moves things.
///
/// # Errors
/// If there are labels that one of them cannot move.
pub fn checked(
    registry: &Registry,
    dataset: &str,
    source: &Source,
    conditions: &[Condition],
    options: &Options,
    warnings: &mut Vec<String>,
) -> Result<Vec<bool>> {
    let present = |placed: fn(&Role) -> bool| source.contents.roles.values().find(|role| placed(role));
    let labels = match present(|role| role.is_placed()) {
        Some(role) => Some(role.name()),
        None if source.reader.is_some() => Some("steering"),
        None => present(|role| *role == Role::Records).map(|role| role.name()),
    };
    if options.format != Format::Same
        && source.root.is_some()
        && (source.reader.is_some() || present(|role| *role == Role::Records).is_some())
    {
        let why = match source.form {
            Some(_) => format!("the pictures of `{dataset}` are stored as they were"),
            None => format!("the records of `{dataset}` name their pictures, which keep their names"),
        };
        return Err(Error::new(format!("{why}; leave --format out, or add --plain")));
    }
    if let Some(form) = &source.form {
        if let (Some(why), LabelsOption::Drop) = (&form.undropped, options.labels) {
            return Err(Error::new(format!(
                "the labels of `{dataset}` cannot be left out, because {why}; use --labels keep, or add --plain"
            )));
        }
        warnings.extend(form.notes.iter().cloned());
    }
    if let Some(unread) = &source.unread {
        warnings.push(format!("`{dataset}` is read as a folder of pictures, not as a recording: {unread}"));
    }
    let mut moves = Vec::with_capacity(conditions.len());
    let mut sequence = false;
    for condition in conditions {
        let mut chain = Chain::new(registry, std::slice::from_ref(&condition.applied), options.seed)?;
        let name = &condition.applied.name;
        let description = &registry.catalog().get(Kind::Perturbation, name)?.description;
        sequence |= description.temporal == Temporal::Dynamic;
        if description.history > 0 && source.reader.is_none() {
            return Err(Error::new(format!(
                "perturbation `{name}` shows earlier frames, and nothing says in which order the pictures of `{dataset}` were taken; leave it \
                 out, or name a recording, such as a video or a folder with a CSV"
            )));
        }
        let moved = match (chain.moves(), labels) {
            (moved, _) if options.labels != LabelsOption::Move => moved.unwrap_or(false),
            (Ok(moved), _) => moved,
            (Err(_), None) => false,
            (Err(error), Some(labels)) => {
                return Err(Error::new(format!(
                    "{error}, so the labels of `{dataset}` ({labels}) cannot be moved along; leave them out with --labels drop, keep \
                     them as they are with --labels keep, or leave the perturbation out"
                )));
            }
        };
        if moved && options.labels == LabelsOption::Move {
            if let Some(fixed) = source.contents.of_role(Role::Fixed).next() {
                return Err(Error::new(format!(
                    "perturbation `{name}` moves things, and pdk does not move labels such as `{fixed}`; convert them to COCO, or use \
                     --labels drop"
                )));
            }
            mirrored_steering(registry, dataset, source, &mut chain, name)?;
        }
        moves.push(moved);
    }
    if moves.contains(&true) && options.labels == LabelsOption::Move {
        // What the reader of a recording reads, it knows.
        let unknown = |name: &str| may_be_labels(name) && !source.listed.contains(name);
        let others: Vec<&str> = source.contents.of_role(Role::Other).filter(|name| unknown(name)).collect();
        if let Some(first) = others.first() {
            let count = others.len();
            warnings.push(format!(
                "{count} files that pdk does not know as labels are copied as they are, such as `{first}`; where pictures are moved, \
                 places in them are not"
            ));
        }
    }
    if sequence && source.reader.is_none() {
        warnings.push(
            "perturbations that move over time stand at their beginning in every picture, because the pictures are not a recording".to_owned(),
        );
    }
    Ok(moves)
}

/// Makes sure that a repeat does not take what was written for files of the dataset.
///
/// # Errors
/// If the folder to write to lies in that of the dataset.
pub fn apart(dataset: &str, source: &Source, out: &Path) -> Result<()> {
    let whole = source.form.as_ref().is_none_or(|form| form.whole);
    let root = source.root.as_deref().filter(|_| whole);
    let of_reader = source.reader.as_ref().and_then(|reader| reader.parameters.get("path")?.as_str());
    let folders = [root, Some(Path::new(dataset)), of_reader.map(Path::new)];
    for folder in folders.into_iter().flatten().filter(|folder| folder.is_dir()) {
        if placed(out).starts_with(placed(folder)) {
            return Err(Error::new(format!(
                "the folder {} lies in the dataset {}, so a repeat could perturb what was written as well; name a folder outside of it with -o",
                out.display(),
                folder.display()
            )));
        }
    }
    Ok(())
}

/// The place of a folder that need not be there yet, without links in the part of it that is.
fn placed(folder: &Path) -> PathBuf {
    let whole = std::path::absolute(folder).unwrap_or_else(|_| folder.to_owned());
    let real = whole
        .ancestors()
        .find_map(|there| Some(there.canonicalize().ok()?.join(whole.strip_prefix(there).ok()?)));
    real.unwrap_or(whole)
}

/// Makes sure that no file of the result takes the place of another one.
///
/// # Errors
/// If two pictures differ in their format alone, and are written in one.
pub fn distinct(source: &Source, options: &Options) -> Result<()> {
    let mut from: BTreeMap<String, &str> = BTreeMap::new();
    for (name, role) in &source.contents.roles {
        let target = match role {
            Role::Picture => options.format.renamed(name),
            role if role.is_placed() && options.labels == LabelsOption::Drop => continue,
            _ => name.clone(),
        };
        if let Some(other) = from.insert(target.clone(), name) {
            return Err(Error::new(format!(
                "`{other}` and `{name}` would both be written as `{target}`; rename one of them, or leave --format out"
            )));
        }
    }
    Ok(())
}

/// Whether a file could say where things are.
fn may_be_labels(name: &str) -> bool {
    let ending = name.rsplit_once('.').map(|(_, ending)| ending.to_ascii_lowercase()).unwrap_or_default();
    ["txt", "json", "jsonl", "csv", "xml", "npy", "npz", "mat", "parquet"].contains(&ending.as_str())
}

/// Refuses to mirror a recording whose steering stands where pdk does not write it.
fn mirrored_steering(
    registry: &Registry,
    dataset: &str,
    source: &Source,
    chain: &mut Chain,
    name: &str,
) -> Result<()> {
    let may_be_steered = source.reader.is_some() || source.unread.is_some();
    let written = source.reader.is_some() && source.root.is_none()
        || source.contents.of_role(Role::Records).next().is_some();
    if !may_be_steered
        || written
        || !Labels::new(chain, [160, 120], &Moment::new(0, 0.0).alone()).mirrors()?
    {
        return Ok(());
    }
    let mirrors = format!("perturbation `{name}` mirrors the frames, so that steering changes its sign");
    if let Some(unread) = &source.unread {
        return Err(Error::new(format!(
            "{mirrors}, and `{dataset}` cannot be read as a recording ({unread}); name its reader with parameters that fit, or use \
             --labels keep"
        )));
    }
    if let Some(form) = &source.form {
        return form.unturned.as_ref().map_or(Ok(()), |why| {
            Err(Error::new(format!(
                "{mirrors}, which pdk does not write into `{dataset}`, because {why}; add --plain to write pictures with a record beside \
                 each, or use --labels keep"
            )))
        });
    }
    let Some(table) = source.contents.of_role(Role::Table).next() else {
        return Err(Error::new(format!(
            "{mirrors}, which pdk does not write into the files of `{dataset}`; add --plain to write pictures with a record beside each"
        )));
    };
    turnable(registry, source, table).map_err(|error| {
        Error::new(format!(
            "{mirrors}, which cannot be written into `{table}` of `{dataset}` ({}); add --plain to write pictures with a record beside each",
            error.message()
        ))
    })
}

/// Whether the steering in a table can be turned: it is found, and so are the sides of the cameras if there are several, which change places.
fn turnable(registry: &Registry, source: &Source, table: &str) -> Result<()> {
    let Some(reader) = &source.reader else { return Ok(()) };
    let mut dataset = registry.dataset(&reader.name, &reader.parameters)?.0;
    let steering = steerings(dataset.as_mut());
    let path = source.root.as_deref().unwrap_or(Path::new("")).join(table);
    let has_sides = table::check(&file::read_text(&path, LARGEST_LABELS)?, &steering)?;
    match source.contents.of_role(Role::Picture).count() > source.frames.len() && !has_sides {
        true => Err(Error::new(
            "it has pictures of several cameras, and no columns `left` and `right` say which of them would change places",
        )),
        false => Ok(()),
    }
}
