//! A folder of pictures and nothing else: image sequences without labels, and pictures for networks that say what they show.

use std::path::{Path, PathBuf};

use pdk_sdk::error::Place;
use pdk_sdk::prelude::*;

use crate::comma2k19::VIDEO;
use crate::inside::Inside;
use crate::lerobot::INFO;
use crate::listing::{ends_in, in_order, is_picture, names};
use crate::place::{Named, beyond, unsuitable};

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
        let doc = "Reads all pictures of a folder and the folders in it; they have no labels";
        let alone = "reads the pictures alone, although there are files beside them from which other readers take labels";
        Description::dataset("pictures", doc)
            .parameter(Parameter::path("path", "the folder"))
            .parameter(
                Parameter::number("rate", 20.0, "how many pictures follow each other in a second")
                    .range(0.001, 100_000.0)
                    .unit("1/s"),
            )
            .parameter(Parameter::boolean("unlabelled", false, alone))
    }

    fn new(config: &Config) -> Result<Self> {
        let path = Path::new(config.text("path"));
        let place = format!("folder `{}`", path.display());
        let Named { folder, path: root, file: None } = Named::new(path)? else {
            return Err(unsuitable("it is not a folder of pictures"));
        };
        let beside = self::names(&root).map_err(|error| error.at(&place))?;
        let labels = beside.iter().find(|name| {
            let text = name.to_string_lossy();
            ends_in(name, &["csv", "mcap"])
                || matches!(&*text, "manifest.json" | "metadata.yaml")
                || text == "meta" && root.join(INFO).is_file()
                || text.starts_with("record_") && ends_in(name, &["json"])
        });
        if let (Some(labels), false) = (labels, config.boolean("unlabelled")) {
            return Err(unsuitable(format_args!(
                "it has `{}`, from which another reader may take labels; `unlabelled=true` of the dataset `pictures` reads pictures alone",
                labels.display()
            )));
        }
        let mut names = Vec::new();
        list(&root, Path::new(""), 0, &mut names).map_err(|error| match error.kind() {
            ErrorKind::Unsuitable => error,
            _ => error.at(&place),
        })?;
        if names.is_empty() {
            return Err(unsuitable("it has no pictures (JPEG, PNG, BMP or WebP)"));
        }
        names.sort_by(|a, b| in_order(a, b));
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
        } else if name.file_name().is_some_and(|name| name == VIDEO) {
            // Its previews are not the recording.
            return Err(unsuitable(format_args!("it has `{}`, as comma2k19 has", name.display())));
        } else if kind.is_file() && is_picture(&name) {
            names.push(name.to_string_lossy().into_owned());
        }
    }
    Ok(())
}

impl Dataset for Pictures {
    fn len(&self) -> usize {
        self.names.len()
    }

    fn name(&self, index: usize) -> String {
        self.names.get(index).cloned().unwrap_or_default()
    }

    fn read(&mut self, index: usize) -> Result<Entry> {
        let name = self.names.get(index).ok_or_else(|| beyond(index, self.names.len()))?;
        let frame = pdk_image::read(&self.folder.path(Path::new(name))?)?;
        Ok(Entry { frame, time: index as f64 / self.rate, ..Entry::default() })
    }

    fn info(&self) -> Vec<(String, String)> {
        let frames = format!("{} pictures without labels, {} a second", self.names.len(), self.rate);
        vec![("frames".to_owned(), frames)]
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
        for name in ["b/10.png", "b/9.png", "a/x/9.png", "c.png"] {
            std::fs::create_dir_all(dir.path().join(name).parent().unwrap()).unwrap();
            fixture::image(&dir.path().join(name), 8, 6);
        }
        std::fs::write(dir.path().join("notes.txt"), "").unwrap();
        let open = || Pictures::new(&config::<Pictures>(json!({"path": dir.path()})));
        let mut pictures = open().unwrap();
        let names: Vec<String> = (0..pictures.len()).map(|index| pictures.name(index)).collect();
        assert_eq!(names, ["a/x/9.png", "b/9.png", "b/10.png", "c.png"]);
        let entry = pictures.read(2).unwrap();
        assert!(entry.frame.width() == 8 && entry.steering.is_nan() && entry.time == 0.1);
        std::fs::write(dir.path().join("manifest.json"), "").unwrap();
        let error = open().err().unwrap();
        assert_eq!(error.kind(), ErrorKind::Unsuitable);
        assert!(error.message().contains("`manifest.json`"), "{error}");
        let alone = config::<Pictures>(json!({"path": dir.path(), "unlabelled": true}));
        assert_eq!(Pictures::new(&alone).unwrap().len(), 4);
        let empty = TempDir::new().unwrap();
        let error = Pictures::new(&config::<Pictures>(json!({"path": empty.path()}))).err().unwrap();
        assert!(error.message().contains("has no pictures"));
    }
}
