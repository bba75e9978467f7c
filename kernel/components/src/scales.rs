//! Scales on which a level means the same for every perturbation, as files that were measured.

use std::path::Path;

use pdk_model::level_scale::{LevelScale, MeasuredScale};
use pdk_model::perturbation::AppliedPerturbation;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, ErrorKind, Place, Result};
use pdk_sdk::suggest;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::catalog::{Catalog, Entry};
use crate::product::BuiltInScript;

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
    /// What a perturbation costs by this measure at the levels 0, 1, 2, 3 and 4 of the scale.
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

/// A scale that a perturbation was measured for.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Measured {
    /// The parameters with which it was measured.
    #[serde(default, skip_serializing_if = "Map::is_empty")]
    pub parameters: Map<String, Value>,
    /// Where the levels lie.
    pub scale: MeasuredScale,
}

impl Scale {
    /// Reads the text of a file.
    ///
    /// # Errors
    /// If it is not a scale.
    pub fn read(text: &str) -> Result<Self> {
        let scale: Self =
            serde_json::from_str(text).place("it is not a scale; `pdk calibrate` writes them")?;
        for of in &scale.perturbations {
            of.measured("")
                .scale
                .check_points()
                .map_err(|error| error.at(format_args!("perturbation `{}`", of.name)))?;
        }
        Ok(scale)
    }

    /// The text of its file: a line for each frame and each perturbation.
    ///
    /// # Errors
    /// If a number is not finite.
    pub fn text(&self) -> Result<String> {
        let lines = |list: Vec<serde_json::Result<String>>| {
            let list = list.into_iter().collect::<serde_json::Result<Vec<_>>>()?;
            Ok::<_, serde_json::Error>(list.join(",\n  "))
        };
        let frames = lines(self.frames.iter().map(serde_json::to_string).collect())?;
        let perturbations = lines(self.perturbations.iter().map(serde_json::to_string).collect())?;
        let (measure, costs) = (serde_json::to_string(&self.measure)?, serde_json::to_string(&self.costs)?);
        Ok(format!(
            "{{\n\"measure\": {measure},\n\"costs\": {costs},\n\"frames\": [\n  {frames}\n],\n\"perturbations\": [\n  {perturbations}\n]\n}}\n"
        ))
    }
}

impl OfPerturbation {
    fn measured(&self, name: &str) -> Measured {
        let scale =
            MeasuredScale { name: name.to_owned(), version: self.version, points: self.points.clone() };
        Measured { parameters: self.parameters.clone(), scale }
    }
}

/// The name of the scale in a file; none if it is another file.
pub fn name_of(file: &Path) -> Option<&str> {
    file.file_name()?.to_str()?.strip_suffix(ENDING).filter(|name| !name.is_empty())
}

/// The scales of a product by name.
///
/// # Errors
/// If one is not a scale.
pub fn built_in(scripts: &[BuiltInScript]) -> Result<Vec<(String, Scale)>> {
    let read = |script: &BuiltInScript| {
        let scale = Scale::read(script.source).map_err(|error| error.at(script.file))?;
        Ok((script.name.to_owned(), scale))
    };
    scripts.iter().map(read).collect()
}

impl Catalog {
    /// Adds a scale to the perturbations that it was measured for and that there are.
    pub fn add_scale(&mut self, name: &str, scale: &Scale) {
        for of in &scale.perturbations {
            if let Some(entry) = self.get_mut(Kind::Perturbation, &of.name) {
                entry.scales.push(of.measured(name));
            }
        }
    }

    /// The scale that the level of a perturbation is on, with what was measured for it; none if it is on the published one.
    ///
    /// # Errors
    /// If the perturbation was not measured for it as it is used here, or does not reach the level.
    pub fn level_scale(&self, applied: &AppliedPerturbation) -> Result<Option<MeasuredScale>> {
        let measured = self.measured_scale(applied)?;
        let checked = measured.as_ref().map_or(Ok(()), |measured| measured.check(&applied.level));
        checked.map_err(|error| error.at(format_args!("perturbation `{}`", applied.name)))?;
        Ok(measured)
    }

    /// The same, whether the perturbation reaches the level or not.
    ///
    /// # Errors
    /// If the perturbation was not measured for it as it is used here.
    pub fn measured_scale(&self, applied: &AppliedPerturbation) -> Result<Option<MeasuredScale>> {
        let Some(scale) = &applied.level_scale else { return Ok(None) };
        let place = |error: Error| error.at(format_args!("perturbation `{}`", applied.name));
        let entry = self.get(Kind::Perturbation, &applied.name)?;
        let measured = match scale {
            LevelScale::Measured(measured) => measured.clone(),
            LevelScale::Named(name) => named(entry, name, &applied.parameters).map_err(place)?,
        };
        if measured.version != entry.description.version {
            let sentence = format!(
                "scale `{}` was measured with its version {}, and this is version {}; measure it again with `pdk calibrate`",
                measured.name, measured.version, entry.description.version
            );
            return Err(place(Error::of(ErrorKind::Configuration, sentence)));
        }
        Ok(Some(measured))
    }
}

/// What was measured for a perturbation with these parameters.
fn named(entry: &Entry, name: &str, parameters: &Map<String, Value>) -> Result<MeasuredScale> {
    let mut of_name = entry.scales.iter().filter(|measured| measured.scale.name == name).peekable();
    if of_name.peek().is_none() {
        let hint = match entry.scales.is_empty() {
            true => "it was measured for none; `pdk calibrate` measures one".to_owned(),
            false => suggest::hint(name, entry.scales.iter().map(|measured| measured.scale.name.as_str())),
        };
        return Err(Error::of(ErrorKind::Configuration, format!("it has no scale `{name}`; {hint}")));
    }
    of_name.find(|measured| measured.parameters == *parameters).map(|measured| measured.scale.clone()).ok_or_else(|| {
        let sentence = format!(
            "it was not measured for scale `{name}` with these parameters; leave them out, or measure a scale of your own with `pdk calibrate`"
        );
        Error::of(ErrorKind::Configuration, sentence)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_sdk::describe::Description;
    use serde_json::json;

    fn catalog() -> Catalog {
        let mut catalog = Catalog::default();
        catalog.add(Entry::new(Description::perturbation("fog", "Fog"), "fog.so".into()));
        let scale = json!({
            "measure": "m", "costs": [1, 2, 3, 4, 5], "frames": [],
            "perturbations": [
                {"name": "fog", "version": 1, "points": [[0, 1], [3, 6]]},
                {"name": "fog", "parameters": {"soft": true}, "version": 2, "points": [[0, 0], [4, 4]]},
                {"name": "elsewhere", "version": 1, "points": []},
            ],
        });
        catalog.add_scale("own", &Scale::read(&scale.to_string()).unwrap());
        catalog
    }

    fn scale(text: &str) -> Result<Option<MeasuredScale>> {
        catalog().level_scale(&AppliedPerturbation::parse(text).unwrap())
    }

    #[test]
    fn a_scale_is_found_by_name_and_parameters() {
        assert_eq!(scale("fog@2").unwrap(), None);
        let found = scale("fog@1.5,level_scale=own").unwrap().unwrap();
        assert_eq!((found.published(1.5), found.name.as_str()), (Some(3.5), "own"));
        let error = |text: &str| scale(text).unwrap_err().to_string();
        assert!(error("fog@4,level_scale=own").contains("reach levels 0 to 3 of it"));
        assert_eq!(
            error("fog,level_scale=owm"),
            "perturbation `fog`: it has no scale `owm`; did you mean `own`?"
        );
        assert!(
            error("fog,level_scale=own,soft=false")
                .contains("not measured for scale `own` with these parameters")
        );
        assert!(error("fog,level_scale=own,soft=true").contains("with its version 2, and this is version 1"));
        assert!(error("frost,level_scale=own").contains("there is no perturbation `frost`"));
    }

    #[test]
    fn what_was_measured_is_used_as_it_is() {
        let recorded = r#"fog@1,level_scale={"name":"gone","version":1,"points":[[0,2],[2,4]]}"#;
        assert_eq!(scale(recorded).unwrap().unwrap().published(1.0), Some(3.0));
    }

    #[test]
    fn files_that_are_not_scales_are_refused() {
        for wrong in ["", "{}", r#"{"measure": 3}"#] {
            let error = Scale::read(wrong).unwrap_err().to_string();
            assert!(error.starts_with("it is not a scale; `pdk calibrate` writes them"), "{error}");
        }
        assert_eq!(name_of(Path::new("a/own.scale.json")), Some("own"));
        assert_eq!(name_of(Path::new("a/.scale.json")), None);
        assert_eq!(name_of(Path::new("a/own.json")), None);
    }
}
