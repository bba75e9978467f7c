//! Boxes, polygons, masks and keypoints of many pictures in one file, as COCO has them.

use std::collections::BTreeMap;

use pdk_labels::{Edges, Labels, area};
use pdk_sdk::error::{Error, Place, Result};
use serde_json::{Map, Value, json};

use super::rle;
use super::text::{pairs, rounded};

/// Whether a JSON value is such a file.
pub fn fits(value: &Value) -> bool {
    value["images"].is_array() && value["annotations"].is_array()
}

/// What is done with the labels of one picture.
pub type Work<'a> = &'a mut dyn FnMut(&mut Labels<'_>) -> Result<()>;

/// Called for each picture that has annotations, with its `file_name`, its size, and what to do with its labels.
pub type Pictures<'a> = &'a mut dyn FnMut(&str, [usize; 2], Work<'_>) -> Result<()>;

/// The annotations of perturbed pictures. `picture` is called for each picture that has any, with its `file_name` and its size, and calls
/// its last argument with the labels. What is visible to less than `least` is left out.
///
/// # Errors
/// If the file is not what it seems, or a perturbation cannot say where it moves things.
pub fn moved(document: &Value, least: f64, picture: Pictures<'_>) -> Result<Value> {
    if !fits(document) {
        return Err(Error::new("it is not a file of COCO: it has no lists `images` and `annotations`"));
    }
    let list = |name: &str| document[name].as_array().map(Vec::as_slice).unwrap_or_default();
    let annotations = list("annotations");
    let mut of_image: BTreeMap<String, Vec<usize>> = BTreeMap::new();
    for (place, annotation) in annotations.iter().enumerate() {
        of_image.entry(annotation["image_id"].to_string()).or_default().push(place);
    }
    let mut results: Vec<Option<Value>> = annotations.iter().map(|_| None).collect();
    for image in list("images") {
        let Some(places) = of_image.remove(&image["id"].to_string()) else { continue };
        let name = image["file_name"].as_str().ok_or_else(|| Error::new("an image has no `file_name`"))?;
        let length = |key: &str| {
            let found = image[key].as_u64().filter(|length| *length > 0);
            found.map(|length| length as usize).ok_or_else(|| {
                Error::new(format!("image `{name}` has no `{key}`; write its size in pixels beside its name"))
            })
        };
        let size = [length("width")?, length("height")?];
        picture(name, size, &mut |labels| {
            for &place in &places {
                results[place] = annotation(&annotations[place], size, labels, least)
                    .place(format_args!("annotation {} of `{name}`", annotations[place]["id"]))?;
            }
            Ok(())
        })?;
    }
    if let Some(id) = of_image.keys().next() {
        return Err(Error::new(format!("an annotation is of image {id}, which is not among the `images`")));
    }
    let mut document = document.clone();
    document["annotations"] = results.into_iter().flatten().collect();
    Ok(document)
}

/// An annotation, moved; none if too little of it is left.
fn annotation(found: &Value, size: [usize; 2], labels: &mut Labels<'_>, least: f64) -> Result<Option<Value>> {
    let mut moved: Map<String, Value> = found.as_object().cloned().unwrap_or_default();
    let mut whole = None;
    if let Some(numbers) = numbers(&found["bbox"]).filter(|numbers| numbers.len() == 4) {
        let edges: Edges = [numbers[0], numbers[1], numbers[0] + numbers[2], numbers[1] + numbers[3]];
        let of_box = labels.moved_box(edges)?;
        let [left, top, right, bottom] = of_box.edges;
        if of_box.visible < least || right <= left || bottom <= top {
            return Ok(None);
        }
        let written = [left, top, right - left, bottom - top].map(rounded);
        moved.insert("bbox".to_owned(), json!(written));
        whole = Some((right - left) * (bottom - top));
    }
    match &found["segmentation"] {
        Value::Array(polygons) if !polygons.is_empty() => {
            let (mut left, mut total) = (Vec::new(), 0.0);
            for polygon in polygons {
                let numbers = numbers(polygon)
                    .ok_or_else(|| Error::new("a polygon in `segmentation` is not a list of numbers"))?;
                let corners = labels.polygon(&pairs(&numbers))?;
                if corners.len() >= 3 && area(&corners) > 0.0 {
                    total += area(&corners);
                    left.push(corners.into_iter().flatten().map(rounded).collect::<Vec<_>>());
                }
            }
            if left.is_empty() {
                return Ok(None);
            }
            moved.insert("segmentation".to_owned(), json!(left));
            whole = Some(total);
        }
        packed @ Value::Object(_) => {
            let (mask, found) = rle::read(packed)?;
            if found != size {
                return Err(Error::new(format!(
                    "its mask has {}x{} pixels, but the image {}x{}",
                    found[0], found[1], size[0], size[1]
                )));
            }
            let mask: Vec<bool> =
                labels.sources()?.into_iter().map(|source| source.is_some_and(|at| mask[at])).collect();
            let count = mask.iter().filter(|value| **value).count();
            if count == 0 {
                return Ok(None);
            }
            moved.insert("segmentation".to_owned(), rle::write(&mask, size, packed));
            whole = Some(count as f64);
        }
        _ => {}
    }
    if let Some(numbers) = numbers(&found["keypoints"]) {
        let (keypoints, count) = keypoints(&numbers, labels)?;
        moved.insert("keypoints".to_owned(), json!(keypoints));
        if moved.contains_key("num_keypoints") {
            moved.insert("num_keypoints".to_owned(), json!(count));
        }
    }
    if let (Some(area), true) = (whole, moved.contains_key("area")) {
        moved.insert("area".to_owned(), json!(rounded(area)));
    }
    Ok(Some(Value::Object(moved)))
}

/// Keypoints, three numbers each, and how many are labelled. One that is moved out of the picture is labelled no longer.
fn keypoints(numbers: &[f64], labels: &mut Labels<'_>) -> Result<(Vec<Value>, usize)> {
    let mut points: Vec<[f64; 2]> = numbers.chunks_exact(3).map(|point| [point[0], point[1]]).collect();
    labels.points(&mut points)?;
    let mut count = 0;
    let mut written = Vec::with_capacity(numbers.len());
    for (point, before) in points.into_iter().zip(numbers.chunks_exact(3)) {
        let labelled = before[2] > 0.0 && labels.is_inside(point);
        count += usize::from(labelled);
        let [x, y] = if labelled { point.map(rounded) } else { [0.0; 2] };
        written.extend([json!(x), json!(y), json!(if labelled { before[2] as u64 } else { 0 })]);
    }
    Ok((written, count))
}

fn numbers(value: &Value) -> Option<Vec<f64>> {
    value.as_array()?.iter().map(Value::as_f64).collect()
}
