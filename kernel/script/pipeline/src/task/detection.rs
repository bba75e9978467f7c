//! Boxes around objects: those of labels, those that a network finds, and how precise these are.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use pdk_metrics::detection::{Areas, Detection, Labelled, Picture, average_precision};
use pdk_sdk::error::{Error, ErrorKind, Place, Result};
use pdk_sdk::file;
use pdk_sdk::input_files::InputFiles;
use pdk_truth::beside::Beside;
use pdk_truth::coco::Coco;
use pdk_truth::taken::TakenOutput;
use pdk_truth::yolo;
use serde_json::{Value, json};

use super::total::Total;
use crate::fields::Fields;

/// Bytes of a file with labels.
const LARGEST: u64 = 1 << 30;
/// Files that may lie beside those of YOLO, and hold something else.
const OTHERS: [&str; 2] = ["classes", "README"];

/// The objects in each picture.
pub enum Objects {
    /// Of a file of COCO.
    Coco(Coco),
    /// Of files of YOLO, one for each picture that shows something.
    Yolo {
        /// Where the file of a picture lies.
        beside: Beside,
        /// What is in each, or why it cannot be read, by its path.
        files: BTreeMap<PathBuf, Result<Vec<yolo::Object>>>,
        /// How many classes there are.
        classes: usize,
    },
}

impl Objects {
    /// Reads a file of COCO, or a folder of files of YOLO, with what the record has to say of the files.
    ///
    /// # Errors
    /// If the file cannot be read or is something else, or the folder has no such files.
    pub fn read(path: &Path) -> Result<(Self, InputFiles)> {
        if !path.is_dir() {
            let coco =
                Coco::parse(&file::read(path, LARGEST).place(path.display())?).place(path.display())?;
            let folder =
                path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
            let name = path.file_name().map(PathBuf::from).unwrap_or_default();
            return Ok((Self::Coco(coco), InputFiles::new("labels", folder, vec![name])));
        }
        let beside = Beside { folder: path.to_owned(), endings: vec!["txt".to_owned()], replace: None };
        let mut names = beside.names()?;
        names.retain(|name| !OTHERS.iter().any(|other| name.file_stem().is_some_and(|stem| stem == *other)));
        let read = |name: &PathBuf| {
            let path = beside.folder.join(name);
            let text = file::read_text(&path, LARGEST);
            let objects =
                text.and_then(|text| yolo::parse(&text)).place(format_args!("label {}", path.display()));
            (path, objects)
        };
        let files: BTreeMap<PathBuf, Result<Vec<yolo::Object>>> = names.iter().map(read).collect();
        let highest = files.values().flatten().flatten().map(|object| object.class).max();
        let input = InputFiles::new("labels", &beside.folder, names);
        Ok((Self::Yolo { beside, files, classes: highest.map_or(0, |highest| highest + 1) }, input))
    }

    /// How many classes there are.
    fn classes(&self) -> usize {
        match self {
            Self::Coco(coco) => coco.classes.len(),
            Self::Yolo { classes, .. } => *classes,
        }
    }

    /// The objects in a picture of this width and height.
    ///
    /// # Errors
    /// If the labels do not have the picture, or its file cannot be read.
    pub fn of(&self, picture: &str, size: [f64; 2]) -> Result<Vec<Labelled>> {
        match self {
            Self::Coco(coco) => coco.of(picture).map(<[_]>::to_vec),
            Self::Yolo { beside, files, .. } => {
                // If there is nothing in a picture, YOLO has no file for it.
                let Some(path) = beside.find(picture)? else { return Ok(Vec::new()) };
                let objects = files.get(&path).ok_or_else(|| {
                    Error::new(format!(
                        "label {} was not among those that were listed; put a copy in the place of a symbolic link, and give it no other name \
                         than that of its picture",
                        path.display()
                    ))
                })?;
                Ok(objects.clone()?.iter().map(|object| object.in_pixels(size)).collect())
            }
        }
    }
}

/// In which units boxes are given.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Units {
    /// Shares of the picture's width and height.
    Shares,
    /// Pixels of the picture.
    Pixels,
    /// Pixels of the network's input, which has this width and height.
    Input(f64, f64),
}

impl Units {
    /// Reads what a pipeline wrote.
    ///
    /// # Errors
    /// If it is something else.
    pub fn read(value: &Value) -> Result<Self> {
        if value.is_object() {
            Fields::new("task: units", value.clone(), &["width", "height"])?;
        }
        let size = || Some((value["width"].as_f64()?, value["height"].as_f64()?));
        match (value.as_str(), size()) {
            (Some("pixels"), _) => Ok(Self::Pixels),
            (Some("shares"), _) => Ok(Self::Shares),
            (_, Some((width, height))) if width > 0.0 && height > 0.0 => Ok(Self::Input(width, height)),
            _ if value.is_null() => Ok(Self::Pixels),
            _ => Err(Error::new(format!(
                "task: `units` is {value}, but has to be \"pixels\" of the picture, \"shares\" of its size, or {{ width = ..., height = ... }}, \
                 the size of the network's input"
            ))),
        }
    }

    /// By what boxes are multiplied, for a picture of this size.
    fn scale(self, [width, height]: [f64; 2]) -> [f64; 2] {
        match self {
            Self::Shares => [width, height],
            Self::Pixels => [1.0, 1.0],
            Self::Input(across, down) => [width / across, height / down],
        }
    }
}

/// What a network finds, and how it gives it.
pub struct Detector {
    /// The outputs with boxes, scores and classes.
    pub outputs: [String; 3],
    /// Whether a box is its corners, rather than a corner and its size.
    pub corners: bool,
    /// In which units boxes are given.
    pub units: Units,
}

impl Detector {
    /// What is kept of a picture of this size: `[x, y, width, height, score, class]` of each detection, and the size.
    ///
    /// # Errors
    /// If the outputs are of another form.
    pub fn measure(&self, given: &[TakenOutput], size: [f64; 2]) -> Result<Value> {
        let detections = self.detections(given, self.units.scale(size))?;
        Ok(json!({"detections": detections, "size": size}))
    }

    fn detections(&self, given: &[TakenOutput], scale: [f64; 2]) -> Result<Vec<[f64; 6]>> {
        let wrong = |sentence: String| Error::of(ErrorKind::Nonsense, sentence);
        let values = |name: &String| {
            let found = given.iter().find(|output| output.name == *name);
            let found = found.ok_or_else(|| wrong(format!("it gave no output `{name}`")))?;
            found
                .values
                .iter()
                .map(|value| value.map(f64::from))
                .collect::<Option<Vec<f64>>>()
                .ok_or_else(|| wrong(format!("its output `{name}` has a value that is not a finite number")))
        };
        let names = &self.outputs;
        let [boxes, scores, classes] = [values(&names[0])?, values(&names[1])?, values(&names[2])?];
        if boxes.len() != 4 * scores.len() || classes.len() != scores.len() {
            return Err(wrong(format!(
                "it gave {} values of boxes, {} scores and {} classes, but has to give 4, 1 and 1 for each detection",
                boxes.len(),
                scores.len(),
                classes.len()
            )));
        }
        let one = |((bounds, score), class): ((&[f64], &f64), &f64)| {
            let [x, y] = [bounds[0] * scale[0], bounds[1] * scale[1]];
            let [a, b] = [bounds[2] * scale[0], bounds[3] * scale[1]];
            let [width, height] = if self.corners { [a - x, b - y] } else { [a, b] };
            [x, y, width, height, *score, *class]
        };
        Ok(boxes.chunks_exact(4).zip(&scores).zip(&classes).map(one).collect())
    }
}

/// The average precisions over pictures, each by its name with what was kept of it.
pub fn precisions(objects: &Objects, pictures: &[(&str, &Value)]) -> Vec<Total> {
    let picture = |(name, kept): &(&str, &Value)| {
        let found = kept["detections"].as_array().into_iter().flatten();
        let detection = |found: &Value| {
            let at = |place: usize| found[place].as_f64().unwrap_or_default();
            Detection { bounds: [at(0), at(1), at(2), at(3)], score: at(4), class: at(5).max(0.0) as usize }
        };
        let size = [0, 1].map(|axis| kept["size"][axis].as_f64().unwrap_or_default());
        Picture {
            detections: found.map(detection).collect(),
            labelled: objects.of(name, size).unwrap_or_default(),
        }
    };
    let pictures: Vec<Picture> = pictures.iter().map(picture).collect();
    let of = |areas| average_precision(&pictures, objects.classes(), areas);
    let all = of(Areas::ALL);
    vec![
        Total::plain("ap", all.mean),
        Total::plain("ap50", all.by_threshold[0]),
        Total::plain("ap75", all.by_threshold[5]),
        Total::plain("ap_small", of(Areas::SMALL).mean),
        Total::plain("ap_medium", of(Areas::MEDIUM).mean),
        Total::plain("ap_large", of(Areas::LARGE).mean),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_are_put_into_pixels_of_the_picture() {
        let output = |name: &str, values: &[f32]| TakenOutput {
            name: name.into(),
            shape: vec![values.len()],
            values: values.iter().map(|value| Some(*value)).collect(),
        };
        let given =
            [output("boxes", &[0.5, 0.25, 0.75, 1.0]), output("scores", &[0.5]), output("classes", &[2.0])];
        let detector = |corners| Detector {
            outputs: ["boxes", "scores", "classes"].map(str::to_owned),
            corners,
            units: Units::Shares,
        };
        let found = |corners| detector(corners).measure(&given, [80.0, 40.0]).unwrap();
        assert_eq!(
            found(true),
            json!({"detections": [[40.0, 10.0, 20.0, 30.0, 0.5, 2.0]], "size": [80.0, 40.0]})
        );
        assert_eq!(found(false)["detections"], json!([[40.0, 10.0, 60.0, 40.0, 0.5, 2.0]]));
        assert_eq!(Units::Input(160.0, 80.0).scale([80.0, 40.0]), [0.5, 0.5]);
        let error = detector(true).measure(&given[..2], [80.0, 40.0]).unwrap_err();
        assert_eq!(error.message(), "it gave no output `classes`");
    }

    #[test]
    fn files_of_yolo_belong_to_pictures_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let write = |name: &str, text: &str| std::fs::write(folder.path().join(name), text).unwrap();
        write("a.txt", "2 0.5 0.5 0.5 0.5\n");
        write("b.txt", "0 1 2");
        write("classes.txt", "cat\ndog\ncar\n");
        let (objects, files) = Objects::read(folder.path()).unwrap();
        assert_eq!((objects.classes(), files.names.len()), (3, 2));
        let found = objects.of("images/a.jpg", [8.0, 4.0]).unwrap();
        assert_eq!((found[0].bounds, found[0].class), ([2.0, 1.0, 4.0, 2.0], 2));
        assert!(objects.of("c.jpg", [8.0, 4.0]).unwrap().is_empty());
        let error = objects.of("b.jpg", [8.0, 4.0]).unwrap_err();
        assert!(error.message().contains("b.txt: line 1: "), "{error}");
    }
}
