//! The files of a dataset, which lie in its folder. The author of a dataset's records does not choose what is read of the rest
//! of the machine.

use std::path::{Component, Path, PathBuf};

use pdk_sdk::file;
use pdk_sdk::prelude::{Error, InputFiles, Result};

/// Bytes of a catalog or a manifest: some millions of records.
const LARGEST_CATALOG: u64 = 2 << 30;
/// Bytes of the record of a single frame.
const LARGEST_RECORD: u64 = 16 << 20;

/// The folder of a dataset.
#[derive(Debug, Clone)]
pub struct Inside {
    /// As the user gave it, for sentences.
    shown: PathBuf,
    /// Without links.
    root: PathBuf,
}

impl Inside {
    /// A dataset's folder.
    ///
    /// # Errors
    /// If there is none.
    pub fn new(folder: &Path) -> Result<Self> {
        match folder.canonicalize() {
            Ok(root) if root.is_dir() => Ok(Self { shown: folder.to_owned(), root }),
            Ok(_) => Err(Error::new("it is not a folder")),
            Err(_) => Err(Error::new("there is no such folder")),
        }
    }

    /// Where a file of the dataset is.
    ///
    /// # Errors
    /// If the name, or a link, leads out of the folder.
    pub fn path(&self, name: &Path) -> Result<PathBuf> {
        let path = self.shown.join(name);
        match path.canonicalize() {
            Ok(real) if !real.starts_with(&self.root) => Err(Error::new(format!(
                "`{}` is outside the dataset's folder, and pdk reads nothing there; copy it into the folder",
                name.display()
            ))),
            Ok(_) => Ok(path),
            Err(_) => Err(Error::new(format!("`{}` does not exist", path.display()))),
        }
    }

    /// Whether a name stays within the folder, so that its file is read if there is one.
    pub fn may_read(&self, name: &Path) -> bool {
        match self.shown.join(name).canonicalize() {
            Ok(real) => real.starts_with(&self.root),
            Err(_) => name.components().all(|part| matches!(part, Component::Normal(_) | Component::CurDir)),
        }
    }

    /// These of its files, as far as they stay within the folder, for the record of a run.
    pub fn input_files(&self, names: impl IntoIterator<Item = PathBuf>) -> InputFiles {
        let names = names.into_iter().filter(|name| self.may_read(name)).collect();
        InputFiles::new("files of the dataset", &self.shown, names)
    }

    /// The text of a manifest or a catalog.
    ///
    /// # Errors
    /// As [`path`](Self::path), and if it cannot be read or is not text.
    pub fn catalog(&self, name: &Path) -> Result<String> {
        self.text(name, LARGEST_CATALOG)
    }

    /// The text of the record of a frame.
    ///
    /// # Errors
    /// As [`path`](Self::path), and if it cannot be read or is not text.
    pub fn record(&self, name: &Path) -> Result<String> {
        self.text(name, LARGEST_RECORD)
    }

    fn text(&self, name: &Path, largest: u64) -> Result<String> {
        let path = self.path(name)?;
        file::read_text(&path, largest)
            .map_err(|error| error.at(format_args!("cannot read `{}`", path.display())))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tempfile::TempDir;

    #[test]
    fn what_lies_outside_is_not_read() {
        let outer = TempDir::new().unwrap();
        let folder = outer.path().join("dataset");
        std::fs::create_dir_all(folder.join("images")).unwrap();
        std::fs::write(outer.path().join("secret"), "s").unwrap();
        std::fs::write(folder.join("images/own"), "o").unwrap();
        std::os::unix::fs::symlink("../../secret", folder.join("images/link")).unwrap();
        std::os::unix::fs::symlink("own", folder.join("images/near")).unwrap();
        std::os::unix::fs::symlink(&folder, outer.path().join("linked")).unwrap();
        for folder in [folder, outer.path().join("linked")] {
            let inside = Inside::new(&folder).unwrap();
            let secret = outer.path().join("secret");
            for name in ["../secret", "images/../../secret", "images/link", secret.to_str().unwrap()] {
                let error = inside.record(Path::new(name)).unwrap_err().to_string();
                assert_eq!(
                    error,
                    format!(
                        "`{name}` is outside the dataset's folder, and pdk reads nothing there; copy it into the folder"
                    )
                );
            }
            for name in ["images/own", "images/near", "images/../images/own"] {
                assert_eq!(inside.catalog(Path::new(name)).unwrap(), "o");
            }
            assert!(
                inside.record(Path::new("none")).unwrap_err().message().ends_with("none` does not exist")
            );
            let names = ["../secret", "images/link", "images/own", "images/near", "none", "../none"];
            let files = inside.input_files(names.map(PathBuf::from));
            assert_eq!(files.names, ["images/own", "images/near", "none"].map(PathBuf::from));
            assert!(inside.record(Path::new("images")).unwrap_err().message().contains("it is a folder"));
        }
    }
}
