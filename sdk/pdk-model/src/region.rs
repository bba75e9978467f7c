//! The part of a frame that a perturbation changes: a box, a polygon, or what an image says.

use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::error::{Error, Result};

/// A part of a frame. Coordinates are shares of the width and height, so that a region fits every frame size.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Region {
    /// `[left, top, right, bottom]`.
    Box([f64; 4]),
    /// The inside of a polygon of `[x, y]` corners, by the even-odd rule.
    Polygon(Vec<[f64; 2]>),
    /// An image file, stretched over the frame: white is changed, black or transparent is not, what lies between is blended.
    Mask(String),
}

impl Region {
    /// Reads a region from a script or the command line.
    ///
    /// # Errors
    /// If it is none, or lies outside the frame.
    pub fn from_json(value: &Value) -> Result<Self> {
        let region: Self = serde_json::from_value(value.clone()).map_err(|_| {
            Error::new(format!(
                "the region {value} is none; write {{ box = {{ left, top, right, bottom }} }}, \
                 {{ polygon = {{ {{ x, y }}, ... }} }} with shares of the frame from 0 to 1, or {{ mask = \"file.png\" }}"
            ))
        })?;
        let numbers: Vec<f64> = match &region {
            Region::Box(sides) => sides.to_vec(),
            Region::Polygon(corners) => corners.iter().flatten().copied().collect(),
            Region::Mask(_) => Vec::new(),
        };
        let mistake = match &region {
            _ if !numbers.iter().all(|number| (0.0..=1.0).contains(number)) => {
                "its coordinates have to be shares of the frame from 0 to 1"
            }
            Region::Box([left, top, right, bottom]) if left >= right || top >= bottom => {
                "its box is empty; the order is left, top, right, bottom"
            }
            Region::Polygon(corners) if corners.len() < 3 => "its polygon needs at least three corners",
            _ => return Ok(region),
        };
        Err(Error::new(format!("the region {value}: {mistake}")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn mistakes_are_named() {
        let error = |value: Value| Region::from_json(&value).unwrap_err().to_string();
        assert!(error(json!({"circle": 1})).contains("is none; write"));
        assert!(error(json!({"box": [0, 0, 2, 1]})).contains("shares of the frame"));
        assert!(error(json!({"box": [0.5, 0, 0.5, 1]})).contains("its box is empty"));
        assert!(error(json!({"polygon": [[0, 0], [1, 1]]})).contains("three corners"));
        let not_finite = error(json!({"box": [0, 0, f64::NAN, 1]}));
        assert!(not_finite.starts_with(r#"the region {"box":[0,0,null,1]} is none"#), "{not_finite}");
    }
}
