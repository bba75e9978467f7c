//! What a dataset is: a folder of pictures, or a recording that a reader opens.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use pdk_components::registry::Registry;
use pdk_model::component::ComponentSpec;
use pdk_pipeline::readers::{self, Unopened};
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, ErrorKind, Result};
use pdk_sdk::form::Form;
use pdk_sdk::prelude::Dataset;
use pdk_supervise::calls::{self, Function};

use crate::contents::{Contents, Role, is_picture};
use crate::options::Options;

/// A dataset as it was found.
pub struct Source {
    /// How it is read, for people.
    pub read_as: String,
    /// Its folder; none for a recording that becomes pictures with a record beside each.
    pub root: Option<PathBuf>,
    /// The files of the folder.
    pub contents: Contents,
    /// The reader of a recording.
    pub reader: Option<ComponentSpec>,
    /// The number of the frame that a picture is, for recordings.
    pub frames: BTreeMap<String, usize>,
    /// The number of frames of a recording.
    pub count: usize,
    /// How the reader writes the recording, if its frames are not files of their own.
    pub form: Option<Form>,
    /// The files that the reader reads.
    pub listed: BTreeSet<String>,
    /// Why a folder that looks like a recording is not read as one.
    pub unread: Option<Error>,
}

/// Finds out what a dataset is: a recording, if a reader is named or one opens it and finds records beside its pictures; else a folder of
/// pictures.
pub fn source(registry: &Registry, dataset: &str, options: &Options) -> Result<Source> {
    let path = Path::new(dataset);
    if !path.exists() {
        let reader = ComponentSpec::parse("dataset", dataset)?;
        if registry.catalog().get(Kind::Dataset, &reader.name).is_err() {
            return Err(Error::new(format!(
                "`{dataset}` is neither a folder nor a dataset reader; `pdk list dataset` names the readers"
            )));
        }
        return recording(registry, reader, options);
    }
    let opened = readers::open(registry.catalog(), dataset, |reader| {
        let (found, _) = registry.dataset(&reader.name, &reader.parameters)?;
        if path.is_file() || self::form(found.as_ref()).map_or(true, |form| form.is_some()) {
            return Ok(());
        }
        let files = registry.input_files(Kind::Dataset, &reader.name, &reader.parameters)?;
        let is_record = |name: &PathBuf| !is_picture(&name.to_string_lossy());
        match files.iter().any(|files| files.names.iter().any(is_record)) && is_driven(found) {
            true => Ok(()),
            false => Err(Error::of(ErrorKind::Unsuitable, "nothing was recorded beside its pictures")),
        }
    });
    let unread = match opened {
        Ok((reader, ())) => return recording(registry, reader, options),
        Err(Unopened { error, .. }) if path.is_file() => return Err(error),
        Err(Unopened { error, recognised }) => recognised.then_some(error),
    };
    let contents = Contents::of(path, &options.masks)?;
    Ok(Source {
        read_as: "a folder of pictures".to_owned(),
        root: Some(path.to_owned()),
        contents,
        reader: None,
        frames: BTreeMap::new(),
        count: 0,
        form: None,
        listed: BTreeSet::new(),
        unread,
    })
}

/// Whether someone steered where frames were recorded: pictures with labels alone are not a recording.
fn is_driven(mut dataset: Box<dyn Dataset>) -> bool {
    const LOOKED_AT: usize = 5;
    (0..dataset.len().min(LOOKED_AT))
        .any(|index| dataset.read(index).is_ok_and(|entry| entry.steering.is_finite()))
}

/// How a recording is written again by its reader.
fn form(dataset: &dyn Dataset) -> Result<Option<Form>> {
    calls::call("the dataset", Function::Form, || dataset.form())
}

/// The steering of each frame; not a number if it has none, or cannot be read.
pub fn steerings(dataset: &mut dyn Dataset) -> Vec<f64> {
    (0..dataset.len()).map(|index| dataset.read(index).map_or(f64::NAN, |entry| entry.steering)).collect()
}

/// A recording, whose frames may be files of a folder.
fn recording(registry: &Registry, reader: ComponentSpec, options: &Options) -> Result<Source> {
    let dataset = registry.dataset(&reader.name, &reader.parameters)?.0;
    let count = dataset.len();
    let mut source = Source {
        read_as: format!("a recording, read by `{}`", reader.name),
        root: None,
        contents: Contents::default(),
        frames: BTreeMap::new(),
        count,
        form: None,
        listed: BTreeSet::new(),
        reader: None,
        unread: None,
    };
    let files = registry.input_files(Kind::Dataset, &reader.name, &reader.parameters)?;
    source.reader = Some(reader);
    if options.plain {
        return Ok(source);
    }
    let form = form(dataset.as_ref()).map_err(|error| {
        Error::new(format!("{error}; or add --plain to write pictures with a record beside each"))
    })?;
    if let Some(form) = form {
        let listed =
            files.iter().flat_map(|files| &files.names).map(|name| name.display().to_string()).collect();
        let (contents, root) = (Contents::of_form(&form)?, Some(form.folder.clone()));
        return Ok(Source { root, contents, listed, form: Some(form), ..source });
    }
    let [files] = files.as_slice() else { return Ok(source) };
    source.listed = files.names.iter().map(|name| name.display().to_string()).collect();
    let mut contents = Contents::of(&files.folder, &options.masks)?;
    for (name, role) in &mut contents.roles {
        let is_table = [".csv", ".tsv"].iter().any(|ending| name.to_ascii_lowercase().ends_with(ending));
        if is_table && source.listed.contains(name) {
            *role = Role::Table;
        }
    }
    let mut frames = BTreeMap::new();
    for index in 0..count {
        let name = dataset.name(index);
        let fresh = contents
            .picture_named(&name, "")
            .map(|picture| frames.insert(picture.to_owned(), index).is_none());
        // If a frame is not a file of its own, the form of the original cannot be kept.
        if fresh != Some(true) {
            return Ok(source);
        }
    }
    Ok(Source { root: Some(files.folder.clone()), contents, frames, ..source })
}
