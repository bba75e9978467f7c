//! Where the modules of a pipeline are: names become files, and none of them leaves its folder.

use std::path::{Path, PathBuf};

use pdk_components::product::BuiltInScript;
use pdk_sdk::error::{Error, Result};
use pdk_sdk::file;
use pdk_sdk::suggest;

use crate::chunk::LARGEST_SCRIPT;

/// What names of the library begin with.
const LIBRARY: &str = "@pdk/";
/// What a file may end in; a name has none of them.
const ENDINGS: [&str; 2] = ["lua", "luau"];

/// Where modules lie.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Root {
    /// In the folder of the pipeline, or below it.
    Pipeline,
    /// In the library.
    Library,
}

/// Where modules are looked for.
pub(crate) struct Places {
    /// The folder of the pipeline; none if it is part of pdk.
    pipeline: Option<PathBuf>,
    library: &'static [BuiltInScript],
}

/// A module that was found.
#[derive(Debug)]
pub(crate) struct Found {
    /// By what it is known: its file without symbolic links, or its name in the library.
    pub file: PathBuf,
    /// As errors call it: the path that leads there, or its name.
    pub shown: String,
    /// As the pipeline would name it.
    pub name: String,
    pub root: Root,
    /// Its folder, seen from the root.
    pub folder: PathBuf,
    /// Its text if it is part of pdk.
    built_in: Option<&'static str>,
}

impl Places {
    pub(crate) fn new(pipeline: Option<&Path>, library: &'static [BuiltInScript]) -> Self {
        // The folder of a file without one is the working directory.
        let folder =
            |path: &Path| if path.as_os_str().is_empty() { PathBuf::from(".") } else { path.to_owned() };
        Self { pipeline: pipeline.map(folder), library }
    }

    /// The module that a file in a folder below a root asks for, or the pipeline.
    ///
    /// # Errors
    /// If the name is none, leads out of the folder, or names no module.
    pub(crate) fn find(&self, asking: Option<(Root, &Path)>, name: &str) -> Result<Found> {
        if let Some(rest) = name.strip_prefix(LIBRARY) {
            return self.in_library(&inner(Path::new(""), rest, name)?, name);
        }
        if !name.starts_with("./") && !name.starts_with("../") {
            return Err(Error::new(format!(
                "require(\"{name}\") has to begin with ./ for a file beside this one, or with {LIBRARY} for one that comes with \
                 pdk"
            )));
        }
        let (root, folder) = asking.unwrap_or((Root::Pipeline, Path::new("")));
        let path = inner(folder, name, name)?;
        match (root, &self.pipeline) {
            (Root::Library, _) => self.in_library(&path, name),
            (Root::Pipeline, Some(pipeline)) => beside(pipeline, &path, name),
            (Root::Pipeline, None) => Err(Error::new(format!(
                "require(\"{name}\") finds no module: the pipeline is part of pdk, so nothing lies beside it; write {LIBRARY} and \
                 the name of a module that comes with pdk"
            ))),
        }
    }

    /// The module at a path in the library.
    fn in_library(&self, path: &Path, name: &str) -> Result<Found> {
        let plain = path.to_string_lossy();
        let Some(script) = self.library.iter().find(|script| script.name == plain) else {
            let names = self.library.iter().map(|script| script.name);
            let hint = suggest::hint(&plain, names);
            return Err(Error::new(format!(
                "require(\"{name}\") finds no module: pdk comes with no `{plain}`; {hint}"
            )));
        };
        let name = format!("{LIBRARY}{plain}");
        Ok(Found {
            file: PathBuf::from(&name),
            shown: name.clone(),
            name,
            root: Root::Library,
            folder: path.parent().unwrap_or(Path::new("")).to_owned(),
            built_in: Some(script.source),
        })
    }
}

/// The file at a path below the folder of the pipeline, without its ending.
fn beside(folder: &Path, path: &Path, name: &str) -> Result<Found> {
    let with_ending = |ending: &&str| folder.join(format!("{}.{ending}", path.display()));
    let files: Vec<PathBuf> = ENDINGS.iter().map(with_ending).filter(|file| file.exists()).collect();
    let shown = match files.as_slice() {
        [] => return Err(missing(name, &folder.join(path))),
        [file] => file,
        [first, second, ..] => {
            return Err(Error::new(format!(
                "require(\"{name}\") could be {} or {}; rename one of them",
                first.display(),
                second.display()
            )));
        }
    };
    let real = |path: &Path| {
        path.canonicalize()
            .map_err(|error| Error::new(format!("the module {} cannot be read ({error})", shown.display())))
    };
    let file = real(shown)?;
    if !file.starts_with(real(folder)?) {
        return Err(leaves(name, &format!("it is a symbolic link to {}", file.display())));
    }
    Ok(Found {
        file,
        shown: shown.display().to_string(),
        name: format!("./{}", path.display()),
        root: Root::Pipeline,
        folder: path.parent().unwrap_or(Path::new("")).to_owned(),
        built_in: None,
    })
}

impl Found {
    /// The text of the module.
    ///
    /// # Errors
    /// If it is in a file that cannot be read, is too large, or is not text.
    pub(crate) fn read(&self) -> Result<String> {
        if let Some(source) = self.built_in {
            return Ok(source.to_owned());
        }
        file::read_text(&self.file, LARGEST_SCRIPT as u64)
            .map_err(|why| Error::new(format!("the module {} cannot be read ({why})", self.shown)))
    }
}

/// Follows a name from a folder, both seen from the root, and never above it.
fn inner(folder: &Path, path: &str, name: &str) -> Result<PathBuf> {
    let mut place = folder.to_owned();
    let mut parts = path.split('/').peekable();
    while let Some(part) = parts.next() {
        let is_last = parts.peek().is_none();
        match part {
            "." if !is_last => {}
            ".." if !is_last => {
                if !place.pop() {
                    return Err(leaves(name, "modules lie beside the pipeline or in folders below"));
                }
            }
            "" | "." | ".." => {
                return Err(Error::new(format!(
                    "require(\"{name}\") names no file; write it as in ./folder/name"
                )));
            }
            part if part.contains(['\\', '\0', ':']) => {
                return Err(Error::new(format!(
                    "require(\"{}\") has a character that no name of a module has; use letters, digits, - and _",
                    name.escape_debug()
                )));
            }
            part => place.push(part),
        }
    }
    Ok(place)
}

fn leaves(name: &str, why: &str) -> Error {
    Error::new(format!("require(\"{name}\") leads out of its folder: {why}"))
}

fn missing(name: &str, path: &Path) -> Error {
    let hint = match ENDINGS.iter().any(|ending| name.ends_with(&format!(".{ending}"))) {
        true => "; leave out the ending",
        false => "",
    };
    Error::new(format!("require(\"{name}\") finds no module: there is no {}.lua{hint}", path.display()))
}
