//! Files of scales on which a level means the same for every perturbation.

use std::collections::BTreeSet;
use std::path::Path;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::canonical::canonical;
use crate::error::{Error, Result};
use crate::level::LEVELS;
use crate::level_scale::MeasuredScale;

/// What the names of the files end in.
pub const ENDING: &str = ".scale.json";
/// The folder for them, beside plugins.
pub const FOLDER: &str = "scales";

/// A scale, as its file has it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Scale {
    /// What was measured, in words.
    pub measure: String,
    /// What a perturbation costs by this measure at the levels 0, 1, 2, 3 and 4 of the scale, in rising order.
    pub costs: Vec<f64>,
    /// The frames that it was measured on.
    pub frames: Vec<MeasuredFrame>,
    /// Where its levels lie for each perturbation.
    pub perturbations: Vec<OfPerturbation>,
}

/// A frame that a scale was measured on.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MeasuredFrame {
    /// Its name.
    pub name: String,
    /// Its width and height, in pixels.
    pub size: [usize; 2],
    /// BLAKE3 of its pixels.
    pub blake3: String,
}

/// Where the levels of a scale lie for a perturbation.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OfPerturbation {
    /// Its name.
    pub name: String,
    /// The parameters with which it was measured.
    #[serde(default, skip_serializing_if = "Map::is_empty")]
    pub parameters: Map<String, Value>,
    /// Its version.
    pub version: u32,
    /// As [`MeasuredScale::points`].
    pub points: Vec<[f64; 2]>,
}

impl Scale {
    /// Reads the text of a file.
    ///
    /// # Errors
    /// If it is not a scale.
    pub fn read(text: &[u8]) -> Result<Self> {
        let wrong =
            |why: String| Error::new(format!("it is not a scale ({why}); `pdk calibrate` writes them"));
        let scale: Self = serde_json::from_slice(text).map_err(|error| wrong(error.to_string()))?;
        if scale.costs.len() != LEVELS || !are_costs(&scale.costs) {
            return Err(wrong(format!("its costs are not {LEVELS} numbers above 0 in rising order")));
        }
        let mut seen = BTreeSet::new();
        for of in &scale.perturbations {
            if !of.measured("").are_points() {
                return Err(wrong(format!("the points of `{}` are out of order or out of range", of.name)));
            }
            if !seen.insert((of.name.as_str(), canonical(&Value::Object(of.parameters.clone())))) {
                return Err(wrong(format!("it has `{}` with the same parameters twice", of.name)));
            }
        }
        Ok(scale)
    }

    /// The text of its file: a line for each frame and each perturbation.
    ///
    /// # Errors
    /// If a number is not finite.
    pub fn text(&self) -> Result<String> {
        fn lines<T: Serialize>(list: &[T]) -> serde_json::Result<String> {
            Ok(list.iter().map(serde_json::to_string).collect::<serde_json::Result<Vec<_>>>()?.join(",\n  "))
        }
        let (frames, perturbations) = (lines(&self.frames)?, lines(&self.perturbations)?);
        let (measure, costs) = (serde_json::to_string(&self.measure)?, serde_json::to_string(&self.costs)?);
        Ok(format!(
            "{{\n\"measure\": {measure},\n\"costs\": {costs},\n\"frames\": [\n  {frames}\n],\n\"perturbations\": [\n  {perturbations}\n]\n}}\n"
        ))
    }
}

impl OfPerturbation {
    /// What was measured, as a part of the scale of this name.
    pub fn measured(&self, name: &str) -> MeasuredScale {
        MeasuredScale { name: name.to_owned(), version: self.version, points: self.points.clone() }
    }
}

/// Whether numbers can be the costs of levels.
pub fn are_costs(costs: &[f64]) -> bool {
    costs.iter().all(|cost| *cost > 0.0 && cost.is_finite()) && costs.is_sorted_by(|a, b| a < b)
}

/// The name of the scale in a file; none if it is another file, or the name could not be written after `level_scale=`.
pub fn name_of(file: &Path) -> Option<&str> {
    let fits = |c: char| c.is_ascii_alphanumeric() || "_-.".contains(c);
    let name = file.file_name()?.to_str()?.strip_suffix(ENDING)?;
    (name.starts_with(|c: char| c.is_ascii_alphabetic()) && name.chars().all(fits)).then_some(name)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn files_that_are_not_scales_are_refused() {
        let of = |costs: &str, perturbations: &str| {
            format!(r#"{{"measure":"m","costs":{costs},"frames":[],"perturbations":[{perturbations}]}}"#)
        };
        let fog = r#"{"name":"fog","version":1,"points":[[0,1],[4,2]]}"#;
        let good = of("[1,2,3,4,5]", fog);
        let scale = Scale::read(good.as_bytes()).unwrap();
        assert_eq!(Scale::read(scale.text().unwrap().as_bytes()).unwrap(), scale);
        for (wrong, why) in [
            (String::new(), "EOF"),
            ("{}".to_owned(), "missing field"),
            (of("[1,2,3,4]", fog), "its costs are not 5 numbers"),
            (of("[1,2,2,4,5]", fog), "its costs are not 5 numbers"),
            (of("[0,2,3,4,5]", fog), "its costs are not 5 numbers"),
            (of("[1,2,3,4,5]", &format!("{fog},{fog}")), "it has `fog` with the same parameters twice"),
            (of("[1,2,3,4,5]", &fog.replace("[4,2]", "[0,2]")), "the points of `fog` are out of order"),
        ] {
            let error = Scale::read(wrong.as_bytes()).unwrap_err().to_string();
            assert!(error.starts_with("it is not a scale (") && error.contains(why), "{error}");
        }
        assert!(Scale::read(&[255, 254]).is_err());
    }

    #[test]
    fn names_come_from_files() {
        let name = |file: &'static str| name_of(Path::new(file));
        assert_eq!(name("a/own.scale.json"), Some("own"));
        for other in ["a/.scale.json", "a/own.json", "a,b.scale.json", "3.scale.json"] {
            assert_eq!(name(other), None, "{other}");
        }
    }
}
