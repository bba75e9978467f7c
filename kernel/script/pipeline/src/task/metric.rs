//! How good what a predictor says of pictures is: a metric that is built in, or a function of the pipeline.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use pdk_loop::taken::{Take, Taken, TakenOutput};
use pdk_metrics::detection::{Areas, Detection, Picture, average_precision};
use pdk_metrics::trajectory::{average_displacement, final_displacement};
use pdk_sdk::error::{Error, ErrorKind, Result};
use pdk_statistics::{CONFIDENCE, Estimate, blocks};
use serde::Serialize;
use serde_json::{Map, Value, json};

use super::baseline::Baseline;
use super::labels::{Classes, Objects};
use crate::evaluation::Interval;
use crate::fields::Fields;

/// Classes that are kept of each picture: the first five count.
const TOP: usize = 5;

/// A metric.
pub enum Metric {
    /// Whether the class of a picture is the first, or among the first five.
    Classification {
        /// The output with the scores of the classes; none for the first.
        output: Option<String>,
        /// The class of each picture.
        classes: Classes,
        /// What corruption errors are relative to.
        baseline: Option<Baseline>,
    },
    /// COCO's average precision.
    Detection {
        /// The objects in each picture.
        objects: Objects,
        /// The outputs with boxes, scores and classes.
        outputs: [String; 3],
        /// Whether a box is its corners, rather than a corner and its size.
        corners: bool,
        /// In which units boxes are given.
        units: Units,
    },
    /// How far predicted points lie from those that were driven.
    Trajectory {
        /// The output with the points; none for the first.
        output: Option<String>,
        /// The points that were driven, by the name of the picture.
        driven: BTreeMap<String, Vec<[f64; 2]>>,
    },
    /// A function of the pipeline.
    Function {
        /// The outputs that it gets; none for all.
        outputs: Vec<String>,
        /// What it gets with those of a picture, by its name.
        labels: Map<String, Value>,
    },
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

/// A number about pictures.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Total {
    /// What it is.
    pub name: String,
    /// The number; none if the pictures do not have it, such as the precision of objects of a size that none has.
    pub value: Option<f64>,
    /// The range in which it may lie, for means over pictures.
    pub interval: Option<Interval>,
}

impl Metric {
    /// Reads the table `task` of a request, with the paths of the files that it names. `folder` is that of the dataset, if it has one.
    ///
    /// # Errors
    /// If a field is unknown, missing or of the wrong type, or a file cannot be read.
    pub fn read(task: Value, folder: Option<&Path>) -> Result<(Self, Vec<PathBuf>)> {
        let kind = task["kind"].as_str().unwrap_or_default().to_owned();
        match kind.as_str() {
            "classification" => {
                let mut fields =
                    Fields::new("task", task, &["kind", "labels", "classes", "output", "baseline"])?;
                let baseline = fields.any("baseline");
                let folders = folder.map(folders).transpose()?.unwrap_or_default();
                let labels = fields.any("labels");
                let classes = Classes::new(&labels, fields.list("classes")?, &folders)?;
                let baseline = (!baseline.is_null()).then(|| Baseline::read(&baseline)).transpose()?;
                Ok((Self::Classification { output: fields.text("output")?, classes, baseline }, Vec::new()))
            }
            "detection" => {
                let known = ["kind", "labels", "boxes", "scores", "classes", "corners", "units"];
                let mut fields = Fields::new("task", task, &known)?;
                let Some(path) = fields.text("labels")?.map(PathBuf::from) else {
                    return Err(Error::new("task: `labels` is missing; name a JSON file of COCO"));
                };
                let mut output =
                    |field: &str| Ok::<_, Error>(fields.text(field)?.unwrap_or(field.to_owned()));
                let outputs = [output("boxes")?, output("scores")?, output("classes")?];
                let corners = fields.truth("corners")?.unwrap_or(true);
                let units = units(&fields.any("units"))?;
                let objects = Objects::read_coco(&path)?;
                Ok((Self::Detection { objects, outputs, corners, units }, vec![path]))
            }
            "trajectory" => {
                let mut fields = Fields::new("task", task, &["kind", "labels", "output"])?;
                let labels = fields.needed("labels")?;
                let driven = labels.as_object().into_iter().flatten().map(points).collect::<Result<_>>()?;
                Ok((Self::Trajectory { output: fields.text("output")?, driven }, Vec::new()))
            }
            "function" => {
                let mut fields = Fields::new("task", task, &["kind", "outputs", "labels", "score"])?;
                let name = |name: Value| {
                    name.as_str().map(str::to_owned).ok_or_else(|| {
                        Error::new(format!(
                            "task: {name} in `outputs` is not the name of an output; write texts"
                        ))
                    })
                };
                let outputs = fields
                    .list("outputs")?
                    .unwrap_or_default()
                    .into_iter()
                    .map(name)
                    .collect::<Result<_>>()?;
                let labels = match fields.any("labels") {
                    Value::Object(labels) => labels,
                    Value::Null => Map::new(),
                    Value::Array(list) if list.is_empty() => Map::new(),
                    other => {
                        return Err(Error::new(format!(
                            "task: `labels` is {other}, but has to be a table with what the function gets for each picture"
                        )));
                    }
                };
                Ok((Self::Function { outputs, labels }, Vec::new()))
            }
            other => Err(Error::new(format!(
                "task: `kind` is `{other}`, but has to be classification, detection, trajectory or function"
            ))),
        }
    }

    /// What it is called.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Classification { .. } => "classification",
            Self::Detection { .. } => "detection",
            Self::Trajectory { .. } => "trajectory",
            Self::Function { .. } => "function",
        }
    }

    /// What it needs of the outputs.
    pub fn take(&self) -> Take {
        match self {
            Self::Classification { output, .. } => Take::Top { output: output.clone(), count: TOP },
            Self::Detection { outputs, .. } => Take::Outputs { names: outputs.to_vec() },
            Self::Trajectory { output, .. } => Take::Outputs { names: output.iter().cloned().collect() },
            Self::Function { outputs, .. } => Take::Outputs { names: outputs.clone() },
        }
    }

    /// What is kept of a picture, for the record and for the totals. For a function of the pipeline it is what the function gets.
    ///
    /// # Errors
    /// If the picture has no label, or the outputs are not of the metric's form.
    pub fn measure(&self, picture: &str, taken: &Taken) -> Result<Value> {
        match (self, taken) {
            (Self::Classification { classes, .. }, Taken::Top(top)) => {
                Ok(json!({"class": classes.of(picture)?, "top": top}))
            }
            (
                Self::Detection { outputs, corners, units, objects },
                Taken::Outputs { width, height, outputs: given },
            ) => {
                // A picture without labels is noticed here.
                objects.of(picture)?;
                let detections = detections(given, outputs, *corners, units.scale(*width, *height))?;
                Ok(json!({"detections": detections}))
            }
            (Self::Trajectory { driven, .. }, Taken::Outputs { outputs, .. }) => {
                displacements(driven, picture, outputs)
            }
            (Self::Function { labels, .. }, Taken::Outputs { outputs, width, height }) => {
                let outputs: Map<String, Value> = outputs
                    .iter()
                    .map(|TakenOutput { name, shape, values }| {
                        (name.clone(), json!({"shape": shape, "values": values}))
                    })
                    .collect();
                let label = labels.get(picture).cloned().unwrap_or_default();
                Ok(
                    json!({"outputs": outputs, "label": label, "name": picture, "width": width, "height": height}),
                )
            }
            _ => Err(Error::new("a worker took something else from the outputs, which is a defect in pdk")),
        }
    }

    /// The totals over pictures, each by its name with what was kept of it.
    pub fn totals(&self, pictures: &[(&str, &Value)]) -> Vec<Total> {
        match self {
            Self::Classification { .. } => [("top1_error", 1), ("top5_error", TOP)]
                .map(|(name, among)| {
                    let wrong = |(_, kept): &(&str, &Value)| {
                        let top = kept["top"].as_array().map_or(&[][..], Vec::as_slice);
                        f64::from(!top.iter().take(among).any(|class| *class == kept["class"]))
                    };
                    mean(name, &pictures.iter().map(wrong).collect::<Vec<_>>())
                })
                .to_vec(),
            Self::Detection { objects, .. } => precisions(objects, pictures),
            Self::Trajectory { .. } | Self::Function { .. } => {
                let mut names: Vec<&String> = Vec::new();
                for name in pictures.iter().flat_map(|(_, kept)| kept.as_object()).flat_map(Map::keys) {
                    if !names.contains(&name) {
                        names.push(name);
                    }
                }
                let values = |name: &String| -> Vec<f64> {
                    pictures.iter().filter_map(|(_, kept)| kept[name].as_f64()).collect()
                };
                names.iter().map(|name| mean(name, &values(name))).collect()
            }
        }
    }
}

/// The points that were driven from a picture on, as a pipeline has them.
fn points((picture, points): (&String, &Value)) -> Result<(String, Vec<[f64; 2]>)> {
    let point = |point: &Value| Some([point[0].as_f64()?, point[1].as_f64()?]);
    let read = points.as_array().and_then(|points| points.iter().map(point).collect::<Option<Vec<_>>>());
    match read.filter(|points| !points.is_empty()) {
        Some(points) => Ok((picture.clone(), points)),
        None => Err(Error::new(format!(
            "task: the points of `{picture}` in `labels` are {points}, but have to be a list of {{ x, y }}"
        ))),
    }
}

/// The displacement errors of a picture.
fn displacements(
    driven: &BTreeMap<String, Vec<[f64; 2]>>,
    picture: &str,
    outputs: &[TakenOutput],
) -> Result<Value> {
    let driven = driven
        .get(picture)
        .ok_or_else(|| Error::new(format!("`labels` has no points for the picture `{picture}`")))?;
    let values = outputs.first().map_or(&[][..], |output| &output.values);
    let predicted: Vec<[f64; 2]> = values
        .chunks_exact(2)
        .filter_map(|point| Some([f64::from(point[0]?), f64::from(point[1]?)]))
        .collect();
    match (average_displacement(&predicted, driven), final_displacement(&predicted, driven)) {
        (Some(average), Some(last)) if values.len() == 2 * driven.len() => {
            Ok(json!({"ade": average, "fde": last}))
        }
        _ => Err(Error::of(
            ErrorKind::Nonsense,
            format!("it gave {} points, but has to give {}, as `labels` has", predicted.len(), driven.len()),
        )),
    }
}

/// The folders in a folder: the classes of the pictures in them.
fn folders(root: &Path) -> Result<Vec<String>> {
    let unlisted = |error: std::io::Error| Error::new(format!("cannot list {}: {error}", root.display()));
    let mut names = Vec::new();
    for entry in std::fs::read_dir(root).map_err(unlisted)? {
        let entry = entry.map_err(unlisted)?;
        if entry.file_type().map_err(unlisted)?.is_dir() {
            names.push(entry.file_name().to_string_lossy().into_owned());
        }
    }
    names.sort();
    Ok(names)
}

/// A mean over pictures, with its interval.
fn mean(name: &str, values: &[f64]) -> Total {
    let found = blocks::mean(values, blocks::length(values), CONFIDENCE);
    let interval = found.filter(|found| found.low.is_finite() && found.high.is_finite());
    Total {
        name: name.to_owned(),
        value: found.map(|found| found.value),
        interval: interval.map(|Estimate { low, high, .. }| Interval { low, high }),
    }
}

fn units(value: &Value) -> Result<Units> {
    let size = || Some((value["width"].as_f64()?, value["height"].as_f64()?));
    match (value.as_str(), size()) {
        (Some("pixels"), _) => Ok(Units::Pixels),
        (Some("shares"), _) => Ok(Units::Shares),
        (_, Some((width, height))) if width > 0.0 && height > 0.0 => Ok(Units::Input(width, height)),
        _ if value.is_null() => Ok(Units::Pixels),
        _ => Err(Error::new(format!(
            "task: `units` is {value}, but has to be \"pixels\" of the picture, \"shares\" of its size, or {{ width = ..., height = ... }}, \
             the size of the network's input"
        ))),
    }
}

impl Units {
    /// By what boxes are multiplied, for a picture of this size.
    fn scale(self, width: usize, height: usize) -> [f64; 2] {
        let (width, height) = (width as f64, height as f64);
        match self {
            Self::Shares => [width, height],
            Self::Pixels => [1.0, 1.0],
            Self::Input(across, down) => [width / across, height / down],
        }
    }
}

/// The detections among outputs: `[x, y, width, height, score, class]` each.
fn detections(
    given: &[TakenOutput],
    names: &[String; 3],
    corners: bool,
    scale: [f64; 2],
) -> Result<Vec<[f64; 6]>> {
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
        let [width, height] = if corners { [a - x, b - y] } else { [a, b] };
        [x, y, width, height, *score, *class]
    };
    Ok(boxes.chunks_exact(4).zip(&scores).zip(&classes).map(one).collect())
}

fn precisions(objects: &Objects, pictures: &[(&str, &Value)]) -> Vec<Total> {
    let picture = |(name, kept): &(&str, &Value)| {
        let found = kept["detections"].as_array().into_iter().flatten();
        let detection = |found: &Value| {
            let at = |place: usize| found[place].as_f64().unwrap_or_default();
            Detection { bounds: [at(0), at(1), at(2), at(3)], score: at(4), class: at(5).max(0.0) as usize }
        };
        Picture {
            detections: found.map(detection).collect(),
            labelled: objects.of(name).map(<[_]>::to_vec).unwrap_or_default(),
        }
    };
    let pictures: Vec<Picture> = pictures.iter().map(picture).collect();
    let of = |areas| average_precision(&pictures, objects.names.len(), areas);
    let all = of(Areas::ALL);
    let total = |name: &str, value| Total { name: name.to_owned(), value, interval: None };
    vec![
        total("ap", all.mean),
        total("ap50", all.by_threshold[0]),
        total("ap75", all.by_threshold[5]),
        total("ap_small", of(Areas::SMALL).mean),
        total("ap_medium", of(Areas::MEDIUM).mean),
        total("ap_large", of(Areas::LARGE).mean),
    ]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn errors_count_the_class_among_the_first() {
        let task =
            json!({"kind": "classification", "labels": {"a": "x", "b": "y"}, "classes": ["x", "y", "z"]});
        let (metric, files) = Metric::read(task, None).unwrap();
        assert!(files.is_empty());
        let kept: Vec<Value> = [("a", vec![0, 1]), ("b", vec![2, 1])]
            .map(|(name, top)| metric.measure(name, &Taken::Top(top)).unwrap())
            .to_vec();
        let totals = metric.totals(&[("a", &kept[0]), ("b", &kept[1])]);
        assert_eq!((totals[0].value, totals[1].value), (Some(0.5), Some(0.0)));
        assert!(metric.measure("c", &Taken::Top(vec![0])).unwrap_err().message().contains("no class for"));
    }

    #[test]
    fn boxes_are_put_into_pixels_of_the_picture() {
        let output = |name: &str, values: &[f32]| TakenOutput {
            name: name.into(),
            shape: vec![values.len()],
            values: values.iter().map(|value| Some(*value)).collect(),
        };
        let names = ["boxes", "scores", "classes"].map(str::to_owned);
        let given =
            [output("boxes", &[0.5, 0.25, 0.75, 1.0]), output("scores", &[0.5]), output("classes", &[2.0])];
        let scale = Units::Shares.scale(80, 40);
        assert_eq!(detections(&given, &names, true, scale).unwrap(), [[40.0, 10.0, 20.0, 30.0, 0.5, 2.0]]);
        assert_eq!(detections(&given, &names, false, scale).unwrap(), [[40.0, 10.0, 60.0, 40.0, 0.5, 2.0]]);
        assert_eq!(Units::Input(160.0, 80.0).scale(80, 40), [0.5, 0.5]);
        let error = detections(&given[..2], &names, true, scale).unwrap_err();
        assert_eq!(error.message(), "it gave no output `classes`");
    }

    #[test]
    fn displacements_are_those_of_the_points_that_were_driven() {
        let task = json!({"kind": "trajectory", "labels": {"a": [[0, 1], [0, 0]]}});
        let (metric, _) = Metric::read(task, None).unwrap();
        let taken = |values: &[f32]| Taken::Outputs {
            width: 8,
            height: 6,
            outputs: vec![TakenOutput {
                name: "points".into(),
                shape: vec![1, values.len()],
                values: values.iter().map(|value| Some(*value)).collect(),
            }],
        };
        let kept = metric.measure("a", &taken(&[0.0, 0.0, 3.0, 4.0])).unwrap();
        let totals = metric.totals(&[("a", &kept)]);
        let found: Vec<(&str, Option<f64>)> =
            totals.iter().map(|total| (total.name.as_str(), total.value)).collect();
        assert_eq!(found, [("ade", Some(3.0)), ("fde", Some(5.0))]);
        let error = metric.measure("a", &taken(&[0.0, 0.0])).unwrap_err();
        assert_eq!(error.message(), "it gave 1 points, but has to give 2, as `labels` has");
        assert!(metric.measure("b", &taken(&[])).unwrap_err().message().contains("no points for"));
    }

    #[test]
    fn mistakes_in_a_task_are_named() {
        let error = |task: Value| Metric::read(task, None).err().unwrap().to_string();
        assert!(
            error(json!({"kind": "colour"})).contains("`kind` is `colour`, but has to be classification")
        );
        assert!(error(json!({"kind": "detection"})).contains("`labels` is missing"));
        assert!(error(json!({"kind": "function", "lables": 1})).contains("did you mean `labels`?"));
        assert!(error(json!({"kind": "classification", "baseline": 3})).contains("`baseline` is 3"));
    }
}
