//! The road of a scenario, as it is written there.
//!
//! A road is `{"angles": [0, 10, -20], "segment": 25}`, in which `segment` may also be a list with a length for each angle and `heights`
//! a list with a height for each; or `{"waypoints": [[x, height, z], ...]}`; or null, where the simulator chooses. All of them
//! describe the centre line of the driven lane, the right one of two; the vehicle starts on it.

use serde_json::{Map, Value};

use crate::{POINTS_PER_SEGMENT, Point, Road, SEGMENT, curve, lay_out};

/// Most waypoints of a road.
const MOST_WAYPOINTS: usize = 10_000;

/// The waypoints `[x, height, z]` in metres of a scenario's road; none if the simulator chooses.
///
/// # Errors
/// If the road is not one of the forms above.
pub fn read(road: &Value) -> Result<Option<Vec<[f64; 3]>>, String> {
    read_with_end(road, 0.0)
}

/// As [`read`], but a road of angles goes straight on for this many metres behind its last node, at the height of that: so its last
/// segment is driven too. 0 adds nothing.
///
/// # Errors
/// As [`read`]: the road itself has to be of one of the forms.
pub fn read_with_end(road: &Value, end: f64) -> Result<Option<Vec<[f64; 3]>>, String> {
    let fields = match road {
        Value::Null => return Ok(None),
        Value::Object(fields) => fields,
        other => {
            return Err(format!(
                "the road is {}, but has to be null or an object with `angles` or `waypoints`",
                shortened(other)
            ));
        }
    };
    if let Some(name) =
        fields.keys().find(|k| !["angles", "segment", "heights", "waypoints"].contains(&k.as_str()))
    {
        return Err(format!(
            "the road has an unknown key `{name}`; it takes `angles`, `segment` and `heights`, or `waypoints`"
        ));
    }
    match (fields.get("angles"), fields.get("waypoints")) {
        (Some(angles), None) => {
            let mut angles = read_angles(angles)?;
            let mut heights = read_heights(fields, angles.len())?;
            let mut lengths = read_lengths(fields, angles.len())?;
            let given = with_heights(&angles, &lengths, &heights)?;
            if end <= 0.0 {
                return Ok(Some(given));
            }
            angles.push(0.0);
            lengths.push(end);
            heights.extend(heights.last().copied());
            let longer = curve::catmull_rom(&lay_out(&angles, &lengths), POINTS_PER_SEGMENT);
            Ok(Some(raised(longer, &heights)))
        }
        (None, Some(_)) if fields.contains_key("segment") => {
            Err("the road has `segment` beside `waypoints`; it belongs to `angles`: remove it".to_owned())
        }
        (None, Some(_)) if fields.contains_key("heights") => Err(
            "the road has `heights` beside `waypoints`; the second number of each waypoint is its height: remove `heights`"
                .to_owned(),
        ),
        (None, Some(waypoints)) => read_waypoints(waypoints).map(Some),
        (Some(_), Some(_)) => Err("the road has both `angles` and `waypoints`; give one of them".to_owned()),
        (None, None) => Err("the road has neither `angles` nor `waypoints`; give one of them".to_owned()),
    }
}

/// The waypoints of the road whose node `i + 1` lies `lengths[i]` metres from the one before, turned by angle `i` in degrees, clockwise. The
/// first node is 0 m high, the others have `heights` in metres; if there are none, the road is flat.
///
/// # Errors
/// As [`Road::from_angles`].
pub fn with_heights(angles: &[f64], lengths: &[f64], heights: &[f64]) -> Result<Vec<[f64; 3]>, String> {
    let road = Road::from_angles(angles, lengths).map_err(|error| format!("the road: {error}"))?;
    Ok(raised(road.waypoints, heights))
}

/// Waypoints with heights: 0 m at the first node, and these at the others.
fn raised(waypoints: Vec<Point>, heights: &[f64]) -> Vec<[f64; 3]> {
    let height = |i: usize| {
        let node = i / (POINTS_PER_SEGMENT - 1);
        let share = (i % (POINTS_PER_SEGMENT - 1)) as f64 / (POINTS_PER_SEGMENT - 1) as f64;
        let of = |node: usize| match node {
            0 => 0.0,
            _ => heights.get(node - 1).copied().unwrap_or_default(),
        };
        of(node) + (of(node + 1) - of(node)) * share
    };
    waypoints.into_iter().enumerate().map(|(i, [x, z])| [x, height(i), z]).collect()
}

fn read_angles(value: &Value) -> Result<Vec<f64>, String> {
    read_numbers(value).ok_or_else(|| {
        format!(
            "`angles` of the road is {}, but has to be a list of degrees, as in [0, 10, -20]",
            shortened(value)
        )
    })
}

fn read_lengths(fields: &Map<String, Value>, angles: usize) -> Result<Vec<f64>, String> {
    let Some(value) = fields.get("segment") else { return Ok(vec![SEGMENT; angles]) };
    let lengths = match value.as_f64() {
        Some(length) => Some(vec![length; angles]),
        None => read_numbers(value),
    };
    lengths.ok_or_else(|| {
        format!(
            "`segment` of the road is {}, but has to be a length in metres, or a list with one for each angle",
            shortened(value)
        )
    })
}

fn read_numbers(value: &Value) -> Option<Vec<f64>> {
    value.as_array()?.iter().map(Value::as_f64).collect()
}

fn read_heights(fields: &Map<String, Value>, nodes: usize) -> Result<Vec<f64>, String> {
    let Some(value) = fields.get("heights") else { return Ok(Vec::new()) };
    match read_numbers(value) {
        Some(heights) if heights.len() == nodes && heights.iter().all(|h| h.abs() <= 1000.0) => Ok(heights),
        _ => Err(format!(
            "`heights` of the road is {}, but has to be a list of {nodes} heights in metres from -1000 to 1000, one for each angle",
            shortened(value)
        )),
    }
}

fn read_waypoints(value: &Value) -> Result<Vec<[f64; 3]>, String> {
    let expected = "`waypoints` of the road has to be a list of points [x, height, z] in metres";
    let Value::Array(items) = value else {
        return Err(format!("{expected}, and is {}", shortened(value)));
    };
    if items.len() > MOST_WAYPOINTS {
        return Err(format!("the road has {} waypoints, but may have at most {MOST_WAYPOINTS}", items.len()));
    }
    items
        .iter()
        .enumerate()
        .map(|(i, item)| {
            match read_numbers(item).as_deref() {
                // Beyond 100 km positions lose the precision that the renderer needs.
                Some(&[x, height, z]) if [x, height, z].iter().all(|v| v.abs() <= 100_000.0) => {
                    Ok([x, height, z])
                }
                Some(&[_, _, _]) => {
                    Err(format!("waypoint {i} of the road is more than 100 km from the origin"))
                }
                _ => Err(format!("{expected}, and waypoint {i} is {}", shortened(item))),
            }
        })
        .collect()
}

/// A value as it is quoted in an error.
fn shortened(value: &Value) -> String {
    let text = value.to_string();
    match text.char_indices().nth(40) {
        Some((end, _)) => format!("{}...", &text[..end]),
        None => text,
    }
}
