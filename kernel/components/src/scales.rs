//! The scales on which a level means the same for every perturbation, beside what they were measured for.

use pdk_model::level_scale::{LevelScale, MeasuredScale};
use pdk_model::perturbation::AppliedPerturbation;
use pdk_model::scale_file::Scale;
use pdk_sdk::config::Config;
use pdk_sdk::describe::{Description, Kind};
use pdk_sdk::error::{Error, ErrorKind, Result};
use pdk_sdk::suggest;
use serde_json::{Map, Value};

use crate::catalog::{Catalog, Entry, Measured};

impl Catalog {
    /// Adds a scale to the perturbations that it was measured for and that there are.
    pub fn add_scale(&mut self, name: &str, scale: &Scale) {
        for of in &scale.perturbations {
            if let Some(entry) = self.get_mut(Kind::Perturbation, &of.name) {
                entry.scales.push(Measured { parameters: of.parameters.clone(), scale: of.measured(name) });
            }
        }
    }

    /// Whether a scale was measured for any perturbation.
    pub fn has_scale(&self, name: &str) -> bool {
        self.entries().iter().any(|entry| entry.scales.iter().any(|measured| measured.scale.name == name))
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
    let wanted = complete(&entry.description, parameters);
    let found = of_name.find(|measured| complete(&entry.description, &measured.parameters) == wanted);
    found.map(|measured| measured.scale.clone()).ok_or_else(|| {
        let sentence = format!(
            "it was not measured for scale `{name}` with these parameters; leave them out, or measure a scale of your own with `pdk calibrate`"
        );
        Error::of(ErrorKind::Configuration, sentence)
    })
}

/// Parameters with the defaults of those that are not set, and numbers however they are written. What the description does not allow is refused
/// elsewhere.
fn complete(description: &Description, given: &Map<String, Value>) -> Vec<(String, Value)> {
    let values =
        Config::check(description, given).map_or_else(|_| given.clone(), |config| config.values().clone());
    let plain = |value: Value| value.as_f64().map_or(value, Value::from);
    let mut all: Vec<_> = values.into_iter().map(|(name, value)| (name, plain(value))).collect();
    all.sort_by(|a, b| a.0.cmp(&b.0));
    all
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_sdk::describe::Parameter;
    use serde_json::json;

    fn catalog() -> Catalog {
        let mut catalog = Catalog::default();
        let fog =
            Description::perturbation("fog", "Fog").parameter(Parameter::number("depth", 5.0, "how deep"));
        catalog.add(Entry::new(fog, "fog.so".into()));
        let scale = json!({
            "measure": "m", "costs": [1, 2, 3, 4, 5], "frames": [],
            "perturbations": [
                {"name": "fog", "version": 1, "points": [[0, 1], [3, 6]]},
                {"name": "fog", "parameters": {"depth": 7.0}, "version": 2, "points": [[0, 0], [4, 4]]},
                {"name": "elsewhere", "version": 1, "points": []},
            ],
        });
        catalog.add_scale("own", &Scale::read(scale.to_string().as_bytes()).unwrap());
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
        // What is set to its default is as it was measured.
        assert_eq!(scale("fog@1.5,level_scale=own,depth=5").unwrap().unwrap(), found);
        let error = |text: &str| scale(text).unwrap_err().to_string();
        assert!(error("fog@4,level_scale=own").contains("reach levels 0 to 3 of it"));
        assert_eq!(
            error("fog,level_scale=owm"),
            "perturbation `fog`: it has no scale `owm`; did you mean `own`?"
        );
        assert!(
            error("fog,level_scale=own,depth=6")
                .contains("not measured for scale `own` with these parameters")
        );
        assert!(error("fog,level_scale=own,depth=7").contains("with its version 2, and this is version 1"));
        assert!(error("frost,level_scale=own").contains("there is no perturbation `frost`"));
    }

    #[test]
    fn what_was_measured_is_used_as_it_is() {
        let recorded = r#"fog@1,level_scale={"name":"gone","version":1,"points":[[0,2],[2,4]]}"#;
        assert_eq!(scale(recorded).unwrap().unwrap().published(1.0), Some(3.0));
    }
}
