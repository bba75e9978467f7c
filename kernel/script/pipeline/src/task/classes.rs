//! The classes of pictures.

use std::collections::BTreeMap;
use std::path::Path;

use pdk_sdk::error::{Error, Result};
use serde_json::Value;

/// The class of each picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Classes {
    /// Their names; the place of each is the number that the network has for it.
    names: Vec<String>,
    /// The class of a picture by its name; none if the first folder of its name is the class.
    by_picture: Option<BTreeMap<String, String>>,
}

impl Classes {
    /// Classes from what a pipeline wrote: `labels`, which is `"folders"` or a table of a class for each picture, and `classes`, the names
    /// in the order in which the network has them. Without these the names are sorted; `folders` are those of the dataset.
    ///
    /// # Errors
    /// If a class has no place among the names.
    pub fn new(labels: &Value, classes: Option<Vec<Value>>, folders: &[String]) -> Result<Self> {
        let by_picture = match labels {
            Value::Null => None,
            Value::String(word) if word == "folders" => None,
            Value::Object(table) => {
                let class = |(picture, class): (&String, &Value)| match class.as_str() {
                    Some(class) => Ok((picture.clone(), class.to_owned())),
                    None => Err(Error::new(format!(
                        "task: the class of `{picture}` in `labels` is {class}, but has to be a text"
                    ))),
                };
                Some(table.iter().map(class).collect::<Result<BTreeMap<_, _>>>()?)
            }
            other => {
                return Err(Error::new(format!(
                    "task: `labels` of a classification is {other}, but has to be \"folders\" or a table with a class for each picture"
                )));
            }
        };
        let name = |name: &Value| {
            name.as_str().map(str::to_owned).ok_or_else(|| {
                Error::new(format!("task: {name} in `classes` is not the name of a class; write texts"))
            })
        };
        let names = match classes {
            Some(names) => names.iter().map(name).collect::<Result<_>>()?,
            None => {
                let mut names: Vec<String> = match &by_picture {
                    Some(table) => table.values().cloned().collect(),
                    None => folders.to_vec(),
                };
                names.sort();
                names.dedup();
                names
            }
        };
        Ok(Self { names, by_picture })
    }

    fn class<'a>(&'a self, picture: &'a str) -> Option<&'a str> {
        match &self.by_picture {
            Some(table) => table.get(picture).map(String::as_str),
            None => picture.split_once('/').map(|(folder, _)| folder),
        }
    }

    /// The number of the class of a picture.
    ///
    /// # Errors
    /// If it has none, or one that is not among the names.
    pub fn of(&self, picture: &str) -> Result<usize> {
        let Some(class) = self.class(picture) else {
            return Err(Error::new(match &self.by_picture {
                Some(_) => format!("`labels` has no class for the picture `{picture}`"),
                None => format!("the picture `{picture}` lies in no folder, which would be its class"),
            }));
        };
        self.names.iter().position(|name| name == class).ok_or_else(|| {
            Error::new(format!("the class `{class}` of the picture `{picture}` is not among `classes`"))
        })
    }
}

/// The folders in a folder: the classes of the pictures in them.
///
/// # Errors
/// If it cannot be listed.
pub fn folders(root: &Path) -> Result<Vec<String>> {
    let unlisted = |error: std::io::Error| Error::new(format!("cannot list {}: {error}", root.display()));
    let mut names = Vec::new();
    for entry in std::fs::read_dir(root).map_err(unlisted)? {
        let entry = entry.map_err(unlisted)?;
        let name = entry.file_name().to_string_lossy().into_owned();
        // Hidden folders are those of tools, such as notebooks.
        if entry.file_type().map_err(unlisted)?.is_dir() && !name.starts_with('.') {
            names.push(name);
        }
    }
    names.sort();
    Ok(names)
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn the_first_folder_of_a_picture_is_its_class() {
        let folders = ["dog", "cat"].map(str::to_owned);
        let classes = Classes::new(&Value::Null, None, &folders).unwrap();
        assert_eq!((classes.of("cat/3.png"), classes.of("dog/1.png")), (Ok(0), Ok(1)));
        assert!(classes.of("1.png").unwrap_err().message().contains("lies in no folder"));
        assert!(classes.of("cow/1.png").unwrap_err().message().contains("`cow` of the picture"));
        let ordered = Classes::new(&json!("folders"), Some(vec![json!("dog"), json!("cat")]), &[]).unwrap();
        assert_eq!(ordered.of("cat/3.png"), Ok(1));
        let table = Classes::new(&json!({"1.png": "b", "2.png": "a"}), None, &[]);
        assert_eq!(table.unwrap().of("1.png"), Ok(1));
        assert!(Classes::new(&json!(3), None, &folders).is_err());
        let root = tempfile::tempdir().unwrap();
        for name in ["dog", ".ipynb_checkpoints", "cat"] {
            std::fs::create_dir(root.path().join(name)).unwrap();
        }
        assert_eq!(super::folders(root.path()).unwrap(), ["cat", "dog"]);
    }
}
