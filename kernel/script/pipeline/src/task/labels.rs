//! What pictures show, from the files in which people keep it.

use std::collections::BTreeMap;
use std::path::Path;

use pdk_metrics::detection::Labelled;
use pdk_sdk::error::{Error, Place, Result};
use pdk_sdk::file;
use serde::Deserialize;
use serde_json::Value;

/// Bytes of a file with labels.
const LARGEST: u64 = 1 << 30;

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

/// The objects in each picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Objects {
    /// The names of the classes, in the order of their numbers.
    pub names: Vec<String>,
    by_picture: BTreeMap<String, Vec<Labelled>>,
}

#[derive(Deserialize)]
struct Coco {
    images: Vec<CocoImage>,
    annotations: Vec<CocoAnnotation>,
    categories: Vec<CocoCategory>,
}

#[derive(Deserialize)]
struct CocoImage {
    id: i64,
    file_name: String,
}

#[derive(Deserialize)]
struct CocoAnnotation {
    image_id: i64,
    category_id: i64,
    bbox: [f64; 4],
    #[serde(default)]
    iscrowd: u8,
    area: Option<f64>,
}

#[derive(Deserialize)]
struct CocoCategory {
    id: i64,
    #[serde(default)]
    name: String,
}

impl Objects {
    /// Reads a file of COCO. The classes are its categories in the order of their ids.
    ///
    /// # Errors
    /// If it cannot be read, is not such a file, or names a category or a picture that it does not have.
    pub fn read_coco(path: &Path) -> Result<Self> {
        let coco: Coco = serde_json::from_slice(&file::read(path, LARGEST).place(path.display())?)
            .map_err(|error| Error::new(format!("{} is not a file of COCO ({error})", path.display())))?;
        let Coco { images, annotations, mut categories } = coco;
        categories.sort_by_key(|category| category.id);
        let mut by_picture: BTreeMap<String, Vec<Labelled>> =
            images.iter().map(|image| (image.file_name.clone(), Vec::new())).collect();
        let names: BTreeMap<i64, &String> = images.iter().map(|image| (image.id, &image.file_name)).collect();
        for CocoAnnotation { image_id, category_id, bbox, iscrowd, area } in annotations {
            let missing = |what: &str, id: i64| {
                Error::new(format!(
                    "{}: an annotation names the {what} {id}, which is not there",
                    path.display()
                ))
            };
            let class = categories
                .binary_search_by_key(&category_id, |category| category.id)
                .map_err(|_| missing("category", category_id))?;
            let picture = names.get(&image_id).ok_or_else(|| missing("image", image_id))?;
            let area = area.unwrap_or(bbox[2] * bbox[3]);
            if let Some(objects) = by_picture.get_mut(*picture) {
                objects.push(Labelled { bounds: bbox, class, crowd: iscrowd != 0, area });
            }
        }
        Ok(Self { names: categories.into_iter().map(|category| category.name).collect(), by_picture })
    }

    /// The objects in a picture, which has this name or ends in it.
    ///
    /// # Errors
    /// If the file does not have the picture.
    pub fn of(&self, picture: &str) -> Result<&[Labelled]> {
        let file_name = picture.rsplit_once('/').map_or(picture, |(_, name)| name);
        self.by_picture
            .get(picture)
            .or_else(|| self.by_picture.get(file_name))
            .map(Vec::as_slice)
            .ok_or_else(|| Error::new(format!("the labels do not have the picture `{picture}`")))
    }
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
    }

    #[test]
    fn a_file_of_coco_has_its_categories_in_order() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("labels.json");
        let coco = json!({
            "images": [{"id": 7, "file_name": "a.png"}, {"id": 9, "file_name": "b.png"}],
            "categories": [{"id": 3, "name": "car"}, {"id": 1, "name": "person"}],
            "annotations": [{"image_id": 7, "category_id": 3, "bbox": [1, 2, 3, 4], "area": 9.5, "iscrowd": 1}],
        });
        std::fs::write(&path, coco.to_string()).unwrap();
        let objects = Objects::read_coco(&path).unwrap();
        assert_eq!(objects.names, ["person", "car"]);
        let expected = Labelled { bounds: [1.0, 2.0, 3.0, 4.0], class: 1, crowd: true, area: 9.5 };
        assert_eq!(objects.of("val/a.png").unwrap(), [expected]);
        assert!(objects.of("b.png").unwrap().is_empty());
        assert!(objects.of("c.png").unwrap_err().message().contains("do not have the picture `c.png`"));
        let mut wrong = coco;
        wrong["annotations"][0]["category_id"] = json!(2);
        std::fs::write(&path, wrong.to_string()).unwrap();
        assert!(Objects::read_coco(&path).unwrap_err().message().contains("the category 2"));
    }
}
