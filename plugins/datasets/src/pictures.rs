//! A folder of pictures and nothing else: for networks that say what pictures show.

use std::path::{Path, PathBuf};

use pdk_sdk::error::Place;
use pdk_sdk::prelude::*;

use crate::inside::Inside;

/// How many folders may lie in one another.
const DEEPEST: usize = 16;

/// Reads all pictures of a folder and the folders in it, in the order of their names.
pub struct Pictures {
    folder: Inside,
    names: Vec<String>,
    rate: f64,
}

impl Component for Pictures {
    fn description() -> Description {
        let doc = "Reads all pictures of a folder and the folders in it, without records";
        Description::dataset("pictures", doc).parameter(Parameter::path("path", "the folder")).parameter(
            Parameter::number("rate", 20.0, "how many pictures follow each other in a second")
                .range(0.001, 100_000.0)
                .unit("1/s"),
        )
    }

    fn new(config: &Config) -> Result<Self> {
        let root = Path::new(config.text("path"));
        let place = format!("folder `{}`", root.display());
        let folder = Inside::new(root).map_err(|error| error.at(&place))?;
        if root.join("manifest.json").exists() {
            return Err(Error::new(format!(
                "{place} holds a tub, whose records go with its pictures; use the dataset `tub`"
            )));
        }
        let mut names = Vec::new();
        list(root, Path::new(""), 0, &mut names).map_err(|error| error.at(&place))?;
        if names.is_empty() {
            return Err(Error::new(format!("{place} has no pictures: it needs .jpg, .jpeg or .png files")));
        }
        // The order in which a folder lists its files is not defined.
        names.sort();
        Ok(Self { folder, names, rate: config.number("rate") })
    }

    fn input_files(config: &Config) -> Result<Vec<InputFiles>> {
        let Self { folder, names, .. } = Self::new(config)?;
        Ok(vec![folder.input_files(names.into_iter().map(PathBuf::from))])
    }
}

fn list(root: &Path, inside: &Path, depth: usize, names: &mut Vec<String>) -> Result<()> {
    if depth > DEEPEST {
        return Err(Error::new(format!(
            "more than {DEEPEST} folders lie in one another; name one further in"
        )));
    }
    for entry in std::fs::read_dir(root.join(inside)).place("cannot list it")? {
        let entry = entry.place("cannot list it")?;
        let name = inside.join(entry.file_name());
        // A link is not followed: it may lead outside.
        let kind = entry.file_type().place("cannot list it")?;
        if kind.is_dir() {
            list(root, &name, depth + 1, names)?;
        } else if kind.is_file() && is_picture(&name) {
            names.push(name.to_string_lossy().into_owned());
        }
    }
    Ok(())
}

fn is_picture(name: &Path) -> bool {
    name.extension()
        .and_then(|ending| ending.to_str())
        .is_some_and(|ending| ["jpg", "jpeg", "png"].iter().any(|known| ending.eq_ignore_ascii_case(known)))
}

impl Dataset for Pictures {
    fn len(&self) -> usize {
        self.names.len()
    }

    fn name(&self, index: usize) -> String {
        self.names.get(index).cloned().unwrap_or_default()
    }

    fn read(&mut self, index: usize) -> Result<Entry> {
        let name = self.names.get(index).ok_or_else(|| {
            Error::new(format!("the folder has {} pictures, so there is no frame {index}", self.names.len()))
        })?;
        Ok(Entry {
            frame: pdk_image::read(&self.folder.path(Path::new(name))?)?,
            // Not recorded.
            steering: f64::NAN,
            throttle: f64::NAN,
            time: index as f64 / self.rate,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture::{self, config};
    use pdk_sdk::serde_json::json;
    use tempfile::TempDir;

    #[test]
    fn pictures_come_in_the_order_of_their_names_from_all_folders() {
        let dir = TempDir::new().unwrap();
        for name in ["b/2.png", "b/1.png", "a/x/9.png", "c.png"] {
            std::fs::create_dir_all(dir.path().join(name).parent().unwrap()).unwrap();
            fixture::image(&dir.path().join(name), 8, 6);
        }
        std::fs::write(dir.path().join("notes.txt"), "").unwrap();
        let open = || Pictures::new(&config::<Pictures>(json!({"path": dir.path()})));
        let mut pictures = open().unwrap();
        let names: Vec<String> = (0..pictures.len()).map(|index| pictures.name(index)).collect();
        assert_eq!(names, ["a/x/9.png", "b/1.png", "b/2.png", "c.png"]);
        let entry = pictures.read(2).unwrap();
        assert!(entry.frame.width() == 8 && entry.steering.is_nan() && entry.time == 0.1);
        std::fs::write(dir.path().join("manifest.json"), "").unwrap();
        assert!(open().err().unwrap().message().contains("use the dataset `tub`"));
        let empty = TempDir::new().unwrap();
        let error = Pictures::new(&config::<Pictures>(json!({"path": empty.path()}))).err().unwrap();
        assert!(error.message().contains("has no pictures"));
    }
}
