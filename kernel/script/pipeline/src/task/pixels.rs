//! Outputs that have something for each pixel: classes, distances.

use std::path::Path;

use pdk_metrics::segmentation::Pixels;
use pdk_sdk::error::{Error, Result};
use pdk_sdk::input_files::InputFiles;
use pdk_truth::beside::Beside;
use pdk_truth::distances::Distances;
use pdk_truth::segments::{Ignored, Segments};
use serde_json::Value;

use super::total::Total;
use crate::fields::Fields;

/// The value that does not count if a pipeline says nothing, as in most published masks.
const IGNORED: u16 = 255;
/// Smaller predicted distances count as this, in metres.
const NEAREST: f64 = 1e-3;

/// The files with labels that the fields of a task name, and what the record has to say of them.
fn beside(fields: &mut Fields, endings: &[&str]) -> Result<(Beside, InputFiles)> {
    let folder = fields.text("labels")?.ok_or_else(|| {
        Error::new(format!(
            "task: `labels` is missing; name a folder with a file for each picture ({})",
            endings.join(", ")
        ))
    })?;
    let replace = match fields.list("replace")?.as_deref() {
        None => None,
        Some([Value::String(from), Value::String(to)]) => Some((from.clone(), to.clone())),
        Some(_) => {
            return Err(Error::new(
                "task: `replace` has to be two texts: what the name of a picture ends with, and what that of its label ends with instead",
            ));
        }
    };
    let endings = endings.iter().map(|ending| (*ending).to_owned()).collect();
    let beside = Beside { folder: Path::new(&folder).to_owned(), endings, replace };
    let files = InputFiles::new("labels", &beside.folder, beside.names()?);
    Ok((beside, files))
}

/// Reads the fields of a segmentation, with the names of the classes.
///
/// # Errors
/// If one is missing or of the wrong type, or the folder has no masks.
pub fn segments(fields: &mut Fields) -> Result<(Segments, Vec<String>, InputFiles)> {
    let (labels, files) = beside(fields, &["png"])?;
    let name = |name: Value| match name {
        Value::String(name) => Ok(name),
        other => {
            Err(Error::new(format!("task: {other} in `classes` is not the name of a class; write texts")))
        }
    };
    let classes: Vec<String> = fields.filled_list("classes")?.into_iter().map(name).collect::<Result<_>>()?;
    let values: Vec<u16> = match fields.list("values")? {
        Some(values) => values.iter().map(|value| in_mask("values", value)).collect::<Result<_>>()?,
        None => (0..=u16::MAX).take(classes.len()).collect(),
    };
    if values.len() != classes.len() {
        return Err(Error::new(format!(
            "task: `values` has {} entries, but has to have the value of each of the {} classes",
            values.len(),
            classes.len()
        )));
    }
    let ignored = match fields.any("ignore") {
        Value::Null if values.contains(&IGNORED) => Ignored::Values(Vec::new()),
        Value::Null => Ignored::Values(vec![IGNORED]),
        Value::String(word) if word == "others" => Ignored::Others,
        Value::Array(list) => {
            Ignored::Values(list.iter().map(|value| in_mask("ignore", value)).collect::<Result<_>>()?)
        }
        value => Ignored::Values(vec![in_mask("ignore", &value)?]),
    };
    Ok((Segments { labels, values, ignored }, classes, files))
}

fn in_mask(field: &str, value: &Value) -> Result<u16> {
    value.as_u64().and_then(|value| u16::try_from(value).ok()).ok_or_else(|| {
        let or = if field == "ignore" { ", a list of them or \"others\"" } else { "" };
        Error::new(format!(
            "task: {value} in `{field}` is not a value of a mask, which is a whole number from 0 to {}{or}",
            u16::MAX
        ))
    })
}

/// Reads the fields of a depth estimation.
///
/// # Errors
/// As [`segments`].
pub fn distances(fields: &mut Fields) -> Result<(Distances, InputFiles)> {
    let (labels, files) = beside(fields, &["png", "npy"])?;
    let mut positive = |field: &str| match fields.number(field)? {
        Some(number) if number.is_nan() || number <= 0.0 => {
            Err(Error::new(format!("task: `{field}` is {number}, but has to be more than 0")))
        }
        number => Ok(number),
    };
    let unit = positive("unit")?;
    let (nearest, farthest) =
        (positive("nearest")?.unwrap_or(NEAREST), positive("farthest")?.unwrap_or(f64::MAX));
    if nearest >= farthest {
        return Err(Error::new(format!(
            "task: `nearest` is {nearest}, but has to be less than `farthest`, {farthest}"
        )));
    }
    let median = fields.truth("median")?.unwrap_or_default();
    Ok((Distances { labels, unit, nearest, farthest, median }, files))
}

/// The mean intersection over union of pictures, the share of pixels that are right, and the intersection over union of each class.
pub fn over_union(classes: &[String], pictures: &[(&str, &Value)]) -> Vec<Total> {
    let mut all = Pixels::new(classes.len());
    for (_, kept) in pictures {
        let counts = |of: &str| kept[of].as_array().into_iter().flatten().filter_map(Value::as_u64).collect();
        all.add_all(&Pixels {
            right: counts("right"),
            predicted: counts("predicted"),
            labelled: counts("labelled"),
        });
    }
    let by_class = classes.iter().zip(all.over_union());
    [Total::plain("miou", all.mean_over_union()), Total::plain("pixel_accuracy", all.accuracy())]
        .into_iter()
        .chain(by_class.map(|(class, value)| Total::plain(format!("iou_{class}"), value)))
        .collect()
}
