//! Files with labels, of which each belongs to a picture by its name.

use std::path::{Component, Path, PathBuf};

use pdk_sdk::error::{Error, Place, Result};
use serde::{Deserialize, Serialize};

/// Files that are looked at in a folder at most, and folders in folders.
const MOST_FILES: usize = 1 << 22;
const DEEPEST: usize = 16;

/// A folder with a file for each picture.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Beside {
    /// The folder.
    pub folder: PathBuf,
    /// The endings that a file may have, such as `png`.
    pub endings: Vec<String>,
    /// What the name of a picture ends with before its ending, and what that of its file ends with instead.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub replace: Option<(String, String)>,
}

impl Beside {
    /// The names that the file of a picture may have in the folder, without ending: with all folders of the picture's name, or
    /// without the first ones.
    fn stems(&self, picture: &str) -> Result<Vec<PathBuf>> {
        let path = Path::new(picture);
        if !path.components().all(|part| matches!(part, Component::Normal(_))) {
            return Err(Error::new(format!("the name `{picture}` leads out of its folder")));
        }
        let stem = path.file_stem().and_then(|stem| stem.to_str()).unwrap_or(picture);
        let stem = match &self.replace {
            Some((from, to)) => format!("{}{to}", stem.strip_suffix(from.as_str()).unwrap_or(stem)),
            None => stem.to_owned(),
        };
        let folders: Vec<Component<'_>> =
            path.parent().map(|path| path.components().collect()).unwrap_or_default();
        Ok((0..=folders.len())
            .map(|first| folders[first..].iter().collect::<PathBuf>().join(&stem))
            .collect())
    }

    /// The file that belongs to a picture; none if there is none.
    ///
    /// # Errors
    /// If the picture's name leads out of its folder.
    pub fn find(&self, picture: &str) -> Result<Option<PathBuf>> {
        let paths = self.stems(picture)?.into_iter().flat_map(|stem| {
            let named = move |ending: &String| {
                let mut name = stem.clone().into_os_string();
                name.push(format!(".{ending}"));
                self.folder.join(name)
            };
            self.endings.iter().map(named).collect::<Vec<_>>()
        });
        Ok(paths.into_iter().find(|path| path.is_file()))
    }

    /// The file that belongs to a picture.
    ///
    /// # Errors
    /// If there is none.
    pub fn of(&self, picture: &str) -> Result<PathBuf> {
        self.find(picture)?.ok_or_else(|| {
            let stems = self.stems(picture).unwrap_or_default();
            Error::new(format!(
                "the picture `{picture}` has no label `{}.{}` in {}",
                stems.first().map(|stem| stem.display().to_string()).unwrap_or_default(),
                self.endings.join("` or `."),
                self.folder.display()
            ))
        })
    }

    /// The names of all files in the folder, and in the folders in it, that have one of the endings.
    ///
    /// # Errors
    /// If a folder cannot be read, or there are none.
    pub fn names(&self) -> Result<Vec<PathBuf>> {
        let (mut names, mut folders) = (Vec::new(), vec![(PathBuf::new(), 0)]);
        while let Some((folder, depth)) = folders.pop() {
            let path = self.folder.join(&folder);
            let unlisted = || format!("cannot list {}", path.display());
            for entry in std::fs::read_dir(&path).place(unlisted())? {
                let entry = entry.place(unlisted())?;
                let name = folder.join(entry.file_name());
                let is = entry.file_type().place(unlisted())?;
                let ending = name.extension().and_then(|ending| ending.to_str()).unwrap_or_default();
                if is.is_dir() && depth < DEEPEST {
                    folders.push((name, depth + 1));
                } else if is.is_file() && self.endings.iter().any(|known| known == ending) {
                    names.push(name);
                }
                if names.len() > MOST_FILES {
                    return Err(Error::new(format!(
                        "{} has more than {MOST_FILES} files",
                        self.folder.display()
                    )));
                }
            }
        }
        names.sort();
        match names.is_empty() {
            true => Err(Error::new(format!(
                "{} has no files that end in `.{}`; name the folder with the labels",
                self.folder.display(),
                self.endings.join("` or `.")
            ))),
            false => Ok(names),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_file_belongs_to_a_picture_by_its_name() {
        let folder = tempfile::tempdir().unwrap();
        for name in ["val/a.png", "b.png", "c_gt.png", "notes.txt"] {
            let path = folder.path().join(name);
            std::fs::create_dir_all(path.parent().unwrap()).unwrap();
            std::fs::write(path, "").unwrap();
        }
        let mut beside =
            Beside { folder: folder.path().to_owned(), endings: vec!["png".to_owned()], replace: None };
        let found = |beside: &Beside, picture: &str| {
            beside
                .find(picture)
                .unwrap()
                .map(|path| path.strip_prefix(folder.path()).unwrap().display().to_string())
        };
        assert_eq!(found(&beside, "val/a.jpg").as_deref(), Some("val/a.png"));
        assert_eq!(found(&beside, "images/val/a.jpg").as_deref(), Some("val/a.png"));
        assert_eq!(found(&beside, "val/b.jpg").as_deref(), Some("b.png"));
        assert_eq!(found(&beside, "a.jpg"), None);
        assert!(beside.of("x/a.jpg").unwrap_err().message().contains("has no label `x/a.png`"));
        assert_eq!(beside.names().unwrap().len(), 3);
        for outside in ["../b.jpg", "/b.jpg"] {
            assert!(beside.find(outside).is_err(), "{outside}");
        }
        beside.replace = Some(("_left".to_owned(), "_gt".to_owned()));
        assert_eq!(found(&beside, "c_left.png").as_deref(), Some("c_gt.png"));
        beside.endings = vec!["npy".to_owned()];
        assert!(beside.names().unwrap_err().message().contains("has no files that end in `.npy`"));
    }
}
