//! How good what a predictor says of pictures is: a metric that is built in, or a function of the pipeline.

use std::path::Path;

use pdk_sdk::error::{Error, Result};
use pdk_sdk::input_files::InputFiles;
use pdk_sdk::prelude::Control;
use pdk_truth::distances::Distances;
use pdk_truth::segments::Segments;
use pdk_truth::taken::{Take, Taken, TakenOutput};
use serde_json::{Map, Value, json};

use super::baseline::Baseline;
use super::classes::{Classes, folders};
use super::detection::{Detector, Objects, Units, precisions};
use super::pixels;
use super::total::Total;
use super::trajectory::{Driven, displacements, driven};
use crate::fields::Fields;

/// Classes that are kept of each picture: the first five count.
const TOP: usize = 5;
/// The kinds of tasks, for messages.
const KINDS: &str = "classification, detection, segmentation, depth, trajectory or function";

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
        /// How they are found.
        detector: Detector,
    },
    /// How much of each class is found.
    Segmentation {
        /// The output with the scores of the classes or the classes; none for the first.
        output: Option<String>,
        /// The mask of each picture.
        truth: Segments,
        /// The names of the classes.
        classes: Vec<String>,
    },
    /// How far predicted distances are from measured ones.
    Depth {
        /// The output with the distances; none for the first.
        output: Option<String>,
        /// The distances of each picture.
        truth: Distances,
    },
    /// How far predicted points lie from those that were driven.
    Trajectory {
        /// The output with the points; none for the first.
        output: Option<String>,
        /// The points that were driven.
        driven: Driven,
    },
    /// A function of the pipeline.
    Function {
        /// The outputs that it gets; none for all.
        outputs: Vec<String>,
        /// What it gets with those of a picture, by its name.
        labels: Map<String, Value>,
    },
}

impl Metric {
    /// Reads the table `task` of a request, with the files that it names. `folder` is that of the dataset, if it has one.
    ///
    /// # Errors
    /// If a field is unknown, missing or of the wrong type, or a file cannot be read.
    pub fn read(task: Value, folder: Option<&Path>) -> Result<(Self, Vec<InputFiles>)> {
        let kind = task["kind"].as_str().unwrap_or_default().to_owned();
        let known: &[&str] = match kind.as_str() {
            "classification" => &["labels", "classes", "output", "baseline"],
            "detection" => &["labels", "boxes", "scores", "classes", "corners", "units", "keep_labels"],
            "segmentation" => &["labels", "replace", "output", "classes", "values", "ignore", "keep_labels"],
            "depth" => {
                &["labels", "replace", "output", "unit", "nearest", "farthest", "median", "keep_labels"]
            }
            "trajectory" => &["labels", "output"],
            "function" => &["outputs", "labels", "score"],
            other => return Err(Error::new(format!("task: `kind` is `{other}`, but has to be {KINDS}"))),
        };
        let known: Vec<&str> = known.iter().copied().chain(["kind"]).collect();
        let mut fields = Fields::new("task", task, &known)?;
        match kind.as_str() {
            "classification" => {
                let baseline = fields.any("baseline");
                let folders = folder.map(folders).transpose()?.unwrap_or_default();
                let labels = fields.any("labels");
                let classes = Classes::new(&labels, fields.list("classes")?, &folders)?;
                let baseline = (!baseline.is_null()).then(|| Baseline::read(&baseline)).transpose()?;
                Ok((Self::Classification { output: fields.text("output")?, classes, baseline }, Vec::new()))
            }
            "detection" => {
                let path = fields.text("labels")?.ok_or_else(|| {
                    Error::new("task: `labels` is missing; name a JSON file of COCO, or a folder of text files of YOLO")
                })?;
                let mut output =
                    |field: &str| Ok::<_, Error>(fields.text(field)?.unwrap_or(field.to_owned()));
                let outputs = [output("boxes")?, output("scores")?, output("classes")?];
                let corners = fields.truth("corners")?.unwrap_or(true);
                let units = Units::read(&fields.any("units"))?;
                let (objects, files) = Objects::read(Path::new(&path))?;
                let detector = Detector { outputs, corners, units };
                Ok((Self::Detection { objects, detector }, vec![files]))
            }
            "segmentation" => {
                let (truth, classes, files) = pixels::segments(&mut fields)?;
                Ok((Self::Segmentation { output: fields.text("output")?, truth, classes }, vec![files]))
            }
            "depth" => {
                let (truth, files) = pixels::distances(&mut fields)?;
                Ok((Self::Depth { output: fields.text("output")?, truth }, vec![files]))
            }
            "trajectory" => {
                let driven = driven(&fields.needed("labels")?)?;
                Ok((Self::Trajectory { output: fields.text("output")?, driven }, Vec::new()))
            }
            _ => {
                let name = |name: Value| {
                    name.as_str().map(str::to_owned).ok_or_else(|| {
                        Error::new(format!(
                            "task: {name} in `outputs` is not the name of an output; write texts"
                        ))
                    })
                };
                let outputs = fields.list("outputs")?.unwrap_or_default();
                let outputs = outputs.into_iter().map(name).collect::<Result<_>>()?;
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
        }
    }

    /// What it is called.
    pub fn name(&self) -> &'static str {
        match self {
            Self::Classification { .. } => "classification",
            Self::Detection { .. } => "detection",
            Self::Segmentation { .. } => "segmentation",
            Self::Depth { .. } => "depth",
            Self::Trajectory { .. } => "trajectory",
            Self::Function { .. } => "function",
        }
    }

    /// Whether its labels say where something is in a picture, so that they are wrong where things are moved.
    pub fn is_placed(&self) -> bool {
        matches!(self, Self::Detection { .. } | Self::Segmentation { .. } | Self::Depth { .. })
    }

    /// What it needs of the outputs.
    pub fn take(&self) -> Take {
        match self {
            Self::Classification { output, .. } => Take::Top { output: output.clone(), count: TOP },
            Self::Detection { detector, .. } => Take::Outputs { names: detector.outputs.to_vec() },
            Self::Segmentation { output, truth, .. } => {
                Take::Segments { output: output.clone(), truth: truth.clone() }
            }
            Self::Depth { output, truth } => Take::Distances { output: output.clone(), truth: truth.clone() },
            Self::Trajectory { output, .. } => Take::Outputs { names: output.iter().cloned().collect() },
            Self::Function { outputs, .. } => Take::Outputs { names: outputs.clone() },
        }
    }

    /// What is kept of a picture with which this was recorded, for the record and for the totals. For a function of the pipeline it is
    /// what the function gets.
    ///
    /// # Errors
    /// If the picture has no label, or the outputs are not of the metric's form.
    pub fn measure(&self, picture: &str, recorded: &Control, taken: Taken) -> Result<Value> {
        match (self, taken) {
            (Self::Classification { classes, .. }, Taken::Top(top)) => {
                Ok(json!({"class": classes.of(picture)?, "top": top}))
            }
            (Self::Detection { detector, objects }, Taken::Outputs { width, height, outputs }) => {
                let size = [width as f64, height as f64];
                // A picture without labels is noticed here.
                objects.of(picture, size)?;
                detector.measure(&outputs, size)
            }
            (Self::Segmentation { .. } | Self::Depth { .. }, Taken::Measured(measured)) => Ok(measured),
            (Self::Trajectory { driven, .. }, Taken::Outputs { outputs, .. }) => {
                displacements(driven, picture, &outputs)
            }
            (Self::Function { labels, .. }, Taken::Outputs { outputs, width, height }) => {
                let outputs: Map<String, Value> = outputs
                    .into_iter()
                    .map(|TakenOutput { name, shape, values }| {
                        (name, json!({"shape": shape, "values": values}))
                    })
                    .collect();
                let mut seen = json!({"outputs": outputs, "name": picture, "width": width, "height": height});
                seen["label"] = labels.get(picture).cloned().unwrap_or_default();
                // What was not recorded is not there.
                for (name, number) in [("steering", recorded.steering), ("throttle", recorded.throttle)] {
                    if number.is_finite() {
                        seen["recorded"][name] = number.into();
                    }
                }
                Ok(seen)
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
                    Total::mean(name, &pictures.iter().map(wrong).collect::<Vec<_>>())
                })
                .to_vec(),
            Self::Detection { objects, .. } => precisions(objects, pictures),
            Self::Segmentation { classes, .. } => pixels::over_union(classes, pictures),
            Self::Depth { .. } | Self::Trajectory { .. } | Self::Function { .. } => {
                let mut names: Vec<&String> = Vec::new();
                for name in pictures.iter().flat_map(|(_, kept)| kept.as_object()).flat_map(Map::keys) {
                    if !names.contains(&name) {
                        names.push(name);
                    }
                }
                let values = |name: &String| -> Vec<f64> {
                    pictures.iter().filter_map(|(_, kept)| kept[name].as_f64()).collect()
                };
                names.iter().map(|name| Total::mean(name, &values(name))).collect()
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn measured(metric: &Metric, picture: &str, taken: Taken) -> Result<Value> {
        metric.measure(picture, &Control { steering: 0.25, throttle: f64::NAN }, taken)
    }

    #[test]
    fn errors_count_the_class_among_the_first() {
        let task =
            json!({"kind": "classification", "labels": {"a": "x", "b": "y"}, "classes": ["x", "y", "z"]});
        let (metric, files) = Metric::read(task, None).unwrap();
        assert!(files.is_empty());
        let kept: Vec<Value> = [("a", vec![0, 1]), ("b", vec![2, 1])]
            .map(|(name, top)| measured(&metric, name, Taken::Top(top)).unwrap())
            .to_vec();
        let totals = metric.totals(&[("a", &kept[0]), ("b", &kept[1])]);
        assert_eq!((totals[0].value, totals[1].value), (Some(0.5), Some(0.0)));
        assert!(measured(&metric, "c", Taken::Top(vec![0])).unwrap_err().message().contains("no class for"));
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
        let kept = measured(&metric, "a", taken(&[0.0, 0.0, 3.0, 4.0])).unwrap();
        let totals = metric.totals(&[("a", &kept)]);
        let found: Vec<(&str, Option<f64>)> =
            totals.iter().map(|total| (total.name.as_str(), total.value)).collect();
        assert_eq!(found, [("ade", Some(3.0)), ("fde", Some(5.0))]);
        let error = measured(&metric, "a", taken(&[0.0, 0.0])).unwrap_err();
        assert_eq!(error.message(), "it gave 1 points, but has to give 2, as `labels` has");
        assert!(measured(&metric, "b", taken(&[])).unwrap_err().message().contains("no points for"));
    }

    #[test]
    fn a_function_gets_what_was_recorded() {
        let (metric, _) = Metric::read(json!({"kind": "function", "labels": {"a": 3}}), None).unwrap();
        let taken = || Taken::Outputs { width: 8, height: 6, outputs: Vec::new() };
        let seen = measured(&metric, "a", taken()).unwrap();
        assert_eq!((&seen["label"], &seen["recorded"]), (&json!(3), &json!({"steering": 0.25})));
        assert_eq!(measured(&metric, "b", taken()).unwrap()["label"], Value::Null);
    }

    #[test]
    fn pixels_of_all_pictures_count_together() {
        let folder = tempfile::tempdir().unwrap();
        std::fs::write(folder.path().join("a.png"), "").unwrap();
        let task = |more: Value| {
            let mut task =
                json!({"kind": "segmentation", "labels": folder.path(), "classes": ["road", "sky"]});
            more.as_object().unwrap().iter().for_each(|(field, value)| task[field] = value.clone());
            Metric::read(task, None)
        };
        let (metric, files) = task(json!({})).unwrap();
        assert_eq!(files[0].names.len(), 1);
        let kept = [[[3, 0], [4, 0], [3, 1]], [[1, 2], [1, 2], [1, 2]]]
            .map(|[right, predicted, labelled]| json!({"right": right, "predicted": predicted, "labelled": labelled}));
        let totals = metric.totals(&[("a", &kept[0]), ("b", &kept[1])]);
        let found: Vec<(&str, Option<f64>)> =
            totals.iter().map(|total| (total.name.as_str(), total.value)).collect();
        let (road, sky) = (4.0 / 5.0, 2.0 / 3.0);
        assert_eq!(
            found,
            [
                ("miou", Some((road + sky) / 2.0)),
                ("pixel_accuracy", Some(6.0 / 7.0)),
                ("iou_road", Some(road)),
                ("iou_sky", Some(sky))
            ]
        );
        let error = |more: Value| task(more).err().unwrap().to_string();
        assert!(error(json!({"values": [1]})).contains("`values` has 1 entries"));
        assert!(error(json!({"ignore": "other"})).contains("in `ignore` is not a value of a mask"));
        assert!(error(json!({"ignore": 65536})).contains("in `ignore` is not a value of a mask"));
        assert!(error(json!({"classes": []})).contains("`classes` is empty"));
        assert!(error(json!({"labels": "/nowhere"})).contains("cannot list /nowhere"));
    }

    #[test]
    fn mistakes_in_a_task_are_named() {
        let error = |task: Value| Metric::read(task, None).err().unwrap().to_string();
        assert!(
            error(json!({"kind": "colour"})).contains("`kind` is `colour`, but has to be classification")
        );
        assert!(error(json!({"kind": "detection"})).contains("`labels` is missing"));
        assert!(error(json!({"kind": "depth"})).contains("`labels` is missing"));
        assert!(error(json!({"kind": "function", "lables": 1})).contains("did you mean `labels`?"));
        assert!(error(json!({"kind": "classification", "baseline": 3})).contains("`baseline` is 3"));
    }
}
