//! Boxes around objects in a JSON file of COCO.

use std::collections::BTreeMap;

use pdk_metrics::detection::Labelled;
use pdk_sdk::error::{Error, Result};
use serde::Deserialize;

/// The objects in each picture.
#[derive(Debug, Clone, PartialEq)]
pub struct Coco {
    /// The names of the classes, in the order of their numbers.
    pub classes: Vec<String>,
    by_picture: BTreeMap<String, Vec<Labelled>>,
}

#[derive(Deserialize)]
struct Document {
    images: Vec<Image>,
    annotations: Vec<Annotation>,
    categories: Vec<Category>,
}

#[derive(Deserialize)]
struct Image {
    id: i64,
    file_name: String,
}

#[derive(Deserialize)]
struct Annotation {
    image_id: i64,
    category_id: i64,
    bbox: [f64; 4],
    #[serde(default)]
    iscrowd: u8,
    area: Option<f64>,
}

#[derive(Deserialize)]
struct Category {
    id: i64,
    #[serde(default)]
    name: String,
}

impl Coco {
    /// Reads the text of a file. The classes are its categories in the order of their ids.
    ///
    /// # Errors
    /// If it is not such a file, or names a category or a picture that it does not have.
    pub fn parse(text: &[u8]) -> Result<Self> {
        let document: Document = serde_json::from_slice(text)
            .map_err(|error| Error::new(format!("it is not a file of COCO ({error})")))?;
        let Document { images, annotations, mut categories } = document;
        categories.sort_by_key(|category| category.id);
        let mut by_picture: BTreeMap<String, Vec<Labelled>> =
            images.iter().map(|image| (image.file_name.clone(), Vec::new())).collect();
        let names: BTreeMap<i64, &String> = images.iter().map(|image| (image.id, &image.file_name)).collect();
        for Annotation { image_id, category_id, bbox, iscrowd, area } in annotations {
            let missing = |what: &str, id: i64| {
                Error::new(format!("an annotation names the {what} {id}, which does not exist"))
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
        Ok(Self { classes: categories.into_iter().map(|category| category.name).collect(), by_picture })
    }

    /// The objects in a picture, by its name or its name without folders.
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
    fn a_file_of_coco_has_its_categories_in_order() {
        let coco = json!({
            "images": [{"id": 7, "file_name": "a.png"}, {"id": 9, "file_name": "b.png"}],
            "categories": [{"id": 3, "name": "car"}, {"id": 1, "name": "person"}],
            "annotations": [{"image_id": 7, "category_id": 3, "bbox": [1, 2, 3, 4], "area": 9.5, "iscrowd": 1}],
        });
        let read = Coco::parse(coco.to_string().as_bytes()).unwrap();
        assert_eq!(read.classes, ["person", "car"]);
        let expected = Labelled { bounds: [1.0, 2.0, 3.0, 4.0], class: 1, crowd: true, area: 9.5 };
        assert_eq!(read.of("val/a.png").unwrap(), [expected]);
        assert!(read.of("b.png").unwrap().is_empty());
        assert!(read.of("c.png").unwrap_err().message().contains("do not have the picture `c.png`"));
        let mut wrong = coco;
        wrong["annotations"][0]["category_id"] = json!(2);
        let error = Coco::parse(wrong.to_string().as_bytes()).unwrap_err();
        assert!(error.message().contains("the category 2"), "{error}");
        assert!(Coco::parse(b"[]").unwrap_err().message().starts_with("it is not a file of COCO"));
    }
}
