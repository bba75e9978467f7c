//! Where the modules of a pipeline are: names become files, and none of them leaves its folder.

use std::path::{Path, PathBuf};

use pdk_sdk::error::{Error, Result};
use pdk_sdk::file;

use crate::chunk::LARGEST_SCRIPT;

/// What names of the library begin with.
const LIBRARY: &str = "@pdk/";
/// What a file may end in; a name has none of them.
const ENDINGS: [&str; 2] = ["lua", "luau"];

/// A folder that modules lie in, with what is below it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Root {
    /// That of the pipeline.
    Pipeline,
    /// A folder of the library, by its place in the list.
    Library(usize),
}

/// The folders.
pub(crate) struct Places {
    pipeline: PathBuf,
    library: Vec<PathBuf>,
}

/// A module's file.
#[derive(Debug)]
pub(crate) struct Found {
    /// The file, without symbolic links, by which it is known.
    pub file: PathBuf,
    /// As errors call it: the path that leads there.
    pub shown: String,
    /// As the pipeline would name it.
    pub name: String,
    pub root: Root,
    /// Its folder, seen from the root.
    pub folder: PathBuf,
}

impl Places {
    pub(crate) fn new(pipeline: &Path, library: Vec<PathBuf>) -> Self {
        // The folder of a file without one is the working directory.
        let pipeline = if pipeline.as_os_str().is_empty() { Path::new(".") } else { pipeline };
        Self { pipeline: pipeline.to_owned(), library }
    }

    /// The file of a module that is asked for by a file in a folder below a root, or by the pipeline.
    ///
    /// # Errors
    /// Where the name is none, leads out of the folder, or names no file.
    pub(crate) fn find(&self, asking: Option<(Root, &Path)>, name: &str) -> Result<Found> {
        if let Some(rest) = name.strip_prefix(LIBRARY) {
            let path = inner(Path::new(""), rest, name)?;
            for number in 0..self.library.len() {
                if let Some(found) = self.look(Root::Library(number), &path, name)? {
                    return Ok(found);
                }
            }
            return Err(missing(name, self.library.iter().map(|folder| folder.join(&path)).collect()));
        }
        if !name.starts_with("./") && !name.starts_with("../") {
            return Err(Error::new(format!(
                "require(\"{name}\") has to begin with ./ for a file beside this one, or with {LIBRARY} for one that comes with \
                 pdk"
            )));
        }
        let (root, folder) = asking.unwrap_or((Root::Pipeline, Path::new("")));
        let path = inner(folder, name, name)?;
        self.look(root, &path, name)?.ok_or_else(|| missing(name, vec![self.root(root).join(&path)]))
    }

    fn root(&self, root: Root) -> &Path {
        match root {
            Root::Pipeline => &self.pipeline,
            Root::Library(number) => &self.library[number],
        }
    }

    /// The file at a path below a root, without its ending.
    fn look(&self, root: Root, path: &Path, name: &str) -> Result<Option<Found>> {
        let folder = self.root(root);
        let with_ending = |ending: &&str| folder.join(format!("{}.{ending}", path.display()));
        let files: Vec<PathBuf> = ENDINGS.iter().map(with_ending).filter(|file| file.exists()).collect();
        let shown = match files.as_slice() {
            [] => return Ok(None),
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
            path.canonicalize().map_err(|error| {
                Error::new(format!("the module {} cannot be read ({error})", shown.display()))
            })
        };
        let file = real(shown)?;
        if !file.starts_with(real(folder)?) {
            return Err(leaves(name, &format!("it is a symbolic link to {}", file.display())));
        }
        let plain = path.display();
        Ok(Some(Found {
            file,
            shown: shown.display().to_string(),
            name: match root {
                Root::Pipeline => format!("./{plain}"),
                Root::Library(_) => format!("{LIBRARY}{plain}"),
            },
            root,
            folder: path.parent().unwrap_or(Path::new("")).to_owned(),
        }))
    }
}

impl Found {
    /// The text of the file.
    ///
    /// # Errors
    /// Where it cannot be read, is too large, or is no text.
    pub(crate) fn read(&self) -> Result<String> {
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

fn missing(name: &str, paths: Vec<PathBuf>) -> Error {
    let wanted: Vec<_> = paths.iter().map(|path| format!("{}.lua", path.display())).collect();
    let remedy = match wanted.is_empty() {
        true => "this installation has no library".to_owned(),
        false => format!("there is no {}", wanted.join(" and no ")),
    };
    let hint = match ENDINGS.iter().any(|ending| name.ends_with(&format!(".{ending}"))) {
        true => "; leave out the ending",
        false => "",
    };
    Error::new(format!("require(\"{name}\") finds no module: {remedy}{hint}"))
}
