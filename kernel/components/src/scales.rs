//! Scales of levels in the catalog, beside the perturbations that were measured for them.

use pdk_model::level_scale::MeasuredScale;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_model::scale_file::Scale;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::Result;
use pdk_sdk::level_scales::{self, Measured};

use crate::catalog::Catalog;

impl Catalog {
    /// Adds a scale to the perturbations that it was measured for and that there are.
    pub fn add_scale(&mut self, name: &str, scale: &Scale) {
        for of in &scale.perturbations {
            if let Some(entry) = self.get_mut(Kind::Perturbation, &of.name) {
                entry.scales.push(Measured { parameters: of.parameters.clone(), scale: of.measured(name) });
            }
        }
    }

    /// Whether any perturbation was measured for a scale.
    pub fn has_scale(&self, name: &str) -> bool {
        self.entries().iter().any(|entry| entry.scales.iter().any(|measured| measured.scale.name == name))
    }

    /// The scale that the level of a perturbation is on, as [`level_scales::reached`].
    ///
    /// # Errors
    /// If it was not measured for it as it is used here, or does not reach the level.
    pub fn level_scale(&self, applied: &AppliedPerturbation) -> Result<Option<MeasuredScale>> {
        let entry = self.get(Kind::Perturbation, &applied.name)?;
        level_scales::reached(&entry.description, &entry.scales, applied)
    }

    /// The same, whether it reaches the level or not.
    ///
    /// # Errors
    /// If it was not measured for it as it is used here.
    pub fn measured_scale(&self, applied: &AppliedPerturbation) -> Result<Option<MeasuredScale>> {
        let entry = self.get(Kind::Perturbation, &applied.name)?;
        level_scales::of(&entry.description, &entry.scales, applied)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::catalog::Entry;
    use pdk_sdk::describe::{Description, Parameter};
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
