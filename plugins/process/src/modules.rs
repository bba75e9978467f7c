//! The files that a program reads, as far as they can be known before it runs: for the record of a run.
//!
//! They are the modules beside each script in the command, and what the parameter `files` names. What else a program opens, such as
//! packages that are installed on the machine, is not known here.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};

use pdk_sdk::error::Place;
use pdk_sdk::prelude::*;

/// The endings of scripts. Other files in a command are data, beside which lies what has nothing to do with it.
const SOURCES: [&str; 15] =
    ["py", "pyw", "lua", "luau", "js", "mjs", "cjs", "ts", "rb", "pl", "php", "jl", "r", "R", "sh"];
/// More files than this are not modules of a program. The limit keeps a folder that was named by mistake from being read as a whole.
const MOST: usize = 100_000;

/// The files that the program of a command reads: the modules beside its scripts, and those in further folders.
///
/// # Errors
/// If a folder cannot be listed, something in `further` does not exist, or there are too many files.
pub fn input_files(command: &[String], further: &[String]) -> Result<Vec<InputFiles>> {
    let mut found = Vec::new();
    let mut known = BTreeSet::new();
    for script in command.iter().map(Path::new).filter(|path| path.is_file()) {
        let Some(ending) = script.extension().and_then(|ending| ending.to_str()) else { continue };
        if !SOURCES.contains(&ending) {
            continue;
        }
        let package = |folder: &Path| folder.join("__init__").with_extension(ending).is_file();
        let parent = |path: &Path| match path.parent()? {
            here if here.as_os_str().is_empty() => Some(PathBuf::from(".")),
            folder => Some(folder.to_owned()),
        };
        // A module of a package imports others of it, from its outermost folder on.
        let mut folder = parent(script).unwrap_or_default();
        while let Some(above) = parent(&folder).filter(|above| package(&folder) && package(above)) {
            folder = above;
        }
        if known.insert((folder.clone(), ending)) {
            let is_module = |path: &Path| path.extension().is_some_and(|other| other == ending);
            let names = list(&folder, &is_module, &package)?;
            found.push(InputFiles::new(&format!("modules .{ending}"), folder, names));
        }
    }
    for path in further.iter().map(Path::new) {
        if path.is_dir() {
            found.push(InputFiles::new("files of the program", path, list(path, &|_| true, &|_| true)?));
        } else if !path.is_file() {
            return Err(Error::of(
                ErrorKind::Configuration,
                format!("`files` names {}, which does not exist; correct the path", path.display()),
            ));
        }
    }
    Ok(found)
}

/// The names of the files of a folder that are wanted, also of those in folders within it that are to be entered. Hidden folders are
/// not entered, and neither is what Python keeps of its modules.
fn list(
    root: &Path,
    is_wanted: &dyn Fn(&Path) -> bool,
    is_entered: &dyn Fn(&Path) -> bool,
) -> Result<Vec<PathBuf>> {
    let mut names = Vec::new();
    let mut folders = vec![PathBuf::new()];
    while let Some(folder) = folders.pop() {
        let place = root.join(&folder);
        for entry in std::fs::read_dir(&place).place(place.display())? {
            let entry = entry.place(place.display())?;
            let name = folder.join(entry.file_name());
            let path = root.join(&name);
            // A link to a folder might lead back up.
            if entry.file_type().is_ok_and(|kind| kind.is_dir()) {
                let shown = entry.file_name().to_string_lossy().into_owned();
                if !shown.starts_with('.') && shown != "__pycache__" && is_entered(&path) {
                    folders.push(name);
                }
            } else if is_wanted(&path) && path.is_file() {
                names.push(name);
            }
            if names.len() + folders.len() > MOST {
                return Err(Error::of(
                    ErrorKind::Configuration,
                    format!("{} holds more than {MOST} files; name a smaller folder", root.display()),
                ));
            }
        }
    }
    names.sort();
    Ok(names)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn write(root: &Path, names: &[&str]) {
        for name in names {
            let path = root.join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, name).unwrap();
        }
    }

    #[test]
    fn modules_lie_beside_the_script_and_in_packages() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        let files = ["pilot.py", "helper.py", "net/__init__.py", "net/inner/__init__.py", "net/inner/a.py"];
        write(root, &files);
        write(
            root,
            &["notes.txt", "data/x.py", "net/data/y.py", ".venv/__init__.py", "__pycache__/__init__.py"],
        );
        let text = |name: &str| root.join(name).display().to_string();
        let command = ["python3".to_owned(), text("pilot.py"), "--notes".to_owned(), text("notes.txt")];
        let found = input_files(&command, &[]).unwrap();
        assert_eq!(found.len(), 1);
        let mut expected = files.map(PathBuf::from).to_vec();
        expected.sort();
        assert_eq!((found[0].what.as_str(), &found[0].names), ("modules .py", &expected));
        assert_eq!(found[0].folder, root);
        let found = input_files(&[text("net/inner/a.py")], &[]).unwrap();
        assert_eq!(found[0].folder, root.join("net"));
        assert_eq!(found[0].names, ["__init__.py", "inner/__init__.py", "inner/a.py"].map(PathBuf::from));
    }

    #[test]
    fn further_files_may_be_folders() {
        let folder = tempfile::tempdir().unwrap();
        let root = folder.path();
        write(root, &["net/a.bin", "net/inner/b.bin", "one.bin"]);
        let text = |name: &str| root.join(name).display().to_string();
        let found = input_files(&[], &[text("net"), text("one.bin")]).unwrap();
        assert_eq!(found.len(), 1, "a file that a parameter names need not be listed");
        assert_eq!(found[0].names, ["a.bin", "inner/b.bin"].map(PathBuf::from));
        let error = input_files(&[], &[text("none")]).unwrap_err().to_string();
        assert!(error.contains("none, which does not exist"), "{error}");
    }
}
