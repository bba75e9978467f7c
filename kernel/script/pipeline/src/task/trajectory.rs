//! Points that were driven, and those that a network predicts.

use std::collections::BTreeMap;

use pdk_metrics::trajectory::{average_displacement, final_displacement};
use pdk_sdk::error::{Error, ErrorKind, Result};
use pdk_truth::taken::TakenOutput;
use serde_json::{Value, json};

/// The points that were driven, by the name of the picture.
pub type Driven = BTreeMap<String, Vec<[f64; 2]>>;

/// Reads the points as a pipeline has them: a list for each picture.
///
/// # Errors
/// If they are something else.
pub fn driven(labels: &Value) -> Result<Driven> {
    labels.as_object().into_iter().flatten().map(points).collect()
}

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
///
/// # Errors
/// If it has no points, or the output another number of them.
pub fn displacements(driven: &Driven, picture: &str, outputs: &[TakenOutput]) -> Result<Value> {
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
