//! Settles what a scenario leaves to the machine, before it gets its id.
//!
//! An option may stand for something that differs from machine to machine, such as the engine that runs a network
//! ([`Parameter::stands_for`](pdk_sdk::describe::Parameter)). The scenario says what it stood for, so that its id is a hash of
//! everything that decides the outcome, and a machine that has something else refuses it.

use std::collections::BTreeMap;

use pdk_model::component::ComponentSpec;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_model::scenario::Scenario;
use pdk_sdk::config::Config;
use pdk_sdk::describe::{Description, Kind};
use pdk_sdk::error::{Error, ErrorKind, Result};
use serde_json::{Map, Value};

use crate::manifest::components_of;
use pdk_components::catalog::Catalog;

/// Puts what options stand for into scenarios and evaluations, and notes what it was.
pub struct Settler<'a> {
    /// The components of this machine.
    pub catalog: &'a Catalog,
    /// Options that the user wants in the place of defaults, by parameter, such as `engine`.
    pub wanted: BTreeMap<&'static str, &'a str>,
    /// What was settled so far: each parameter with each of its values.
    pub settled: &'a mut Vec<(String, String)>,
}

impl Settler<'_> {
    /// Settles all components of a scenario.
    pub fn scenario(&mut self, scenario: &mut Scenario) {
        self.component(Kind::Simulator, &mut scenario.simulator);
        self.component(Kind::Driver, &mut scenario.driver);
        self.perturbations(&mut scenario.perturbations);
    }

    /// Settles perturbations with their masks and the methods that choose their pixels.
    pub fn perturbations(&mut self, applied: &mut [AppliedPerturbation]) {
        for perturbation in applied {
            self.parameters(Kind::Perturbation, &perturbation.name, &mut perturbation.parameters);
            if let Some(selection) = &mut perturbation.selection {
                selection.mask.iter_mut().for_each(|mask| self.component(Kind::Mask, mask));
                selection.by.iter_mut().for_each(|by| self.component(Kind::Saliency, by));
            }
            if let Some(attention) = &mut perturbation.attention {
                self.component(Kind::Saliency, &mut attention.by);
            }
        }
    }

    /// Settles a component.
    pub fn component(&mut self, kind: Kind, component: &mut ComponentSpec) {
        self.parameters(kind, &component.name, &mut component.parameters);
    }

    // What there is not, or has no such option, is refused when the component is made.
    fn parameters(&mut self, kind: Kind, name: &str, parameters: &mut Map<String, Value>) {
        let Ok(entry) = self.catalog.get(kind, name) else { return };
        let settled =
            entry.description.parameters.iter().filter(|parameter| !parameter.stands_for.is_empty());
        for parameter in settled {
            let given = parameters.shift_remove(&parameter.name);
            let wanted = || self.wanted.get(parameter.name.as_str()).map(|option| Value::from(*option));
            let option = given.or_else(wanted).unwrap_or_else(|| parameter.default.clone());
            let meaning = option.as_str().and_then(|option| parameter.stands_for.get(option));
            let value = meaning.map_or(option.clone(), |meaning| Value::from(meaning.as_str()));
            if let Some(text) = value.as_str() {
                let found = (parameter.name.clone(), text.to_owned());
                if !self.settled.contains(&found) {
                    self.settled.push(found);
                }
            }
            // Always at the end, so that equal scenarios are written alike.
            parameters.insert(parameter.name.clone(), value);
        }
    }
}

/// Makes sure that this machine has what a recorded scenario was settled to.
///
/// # Errors
/// If it has something else, or the scenario was never settled.
pub fn check(catalog: &Catalog, scenario: &Scenario) -> Result<()> {
    for (kind, component) in components_of(scenario) {
        // A component that there is not is for others to report.
        let Ok(entry) = catalog.get(kind, &component.name) else { continue };
        for parameter in
            entry.description.parameters.iter().filter(|parameter| !parameter.stands_for.is_empty())
        {
            let value = component.parameters.get(&parameter.name).and_then(Value::as_str).unwrap_or_default();
            if value.is_empty() || parameter.stands_for.contains_key(value) {
                return Err(Error::of(
                    ErrorKind::Configuration,
                    format!(
                        "the scenario does not say which `{}` the {kind} `{}` had, so it cannot be driven again as it was; run its pipeline \
                         instead",
                        parameter.name, component.name
                    ),
                ));
            }
            let value = Map::from_iter([(parameter.name.clone(), Value::from(value))]);
            let only = Description { parameters: vec![parameter.clone()], ..entry.description.clone() };
            Config::check(&only, &value)?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_components::catalog::Entry;
    use pdk_sdk::describe::Parameter;
    use serde_json::json;

    fn catalog() -> Catalog {
        let engine = Parameter::choice("engine", &["slow", "fast"], "who computes").stands_for([
            ("slow".to_owned(), "slow 1/any".to_owned()),
            ("fast".to_owned(), "fast 2/v3".to_owned()),
        ]);
        let mut catalog = Catalog::default();
        for description in [
            Description::driver("net", "A network").parameter(engine.clone()),
            Description::saliency("map", "A map").parameter(engine),
            Description::simulator("road", "A road"),
        ] {
            catalog.add(Entry::new(description, "somewhere".into()));
        }
        catalog
    }

    fn settle(scenario: &mut Scenario, wanted: &[(&'static str, &str)]) -> Vec<(String, String)> {
        let wanted = wanted.iter().copied().collect();
        let mut settled = Vec::new();
        Settler { catalog: &catalog(), wanted, settled: &mut settled }.scenario(scenario);
        settled
    }

    #[test]
    fn the_default_the_wish_and_the_full_name_become_one_value_and_one_id() {
        let scenario = |engine: Option<&str>| {
            let mut driver = ComponentSpec::new("net");
            driver.parameters.extend(engine.map(|engine| ("engine".to_owned(), engine.into())));
            Scenario::new(ComponentSpec::new("road"), driver)
        };
        let mut by_default = scenario(None);
        let before = by_default.id();
        assert_eq!(settle(&mut by_default, &[]), [("engine".to_owned(), "slow 1/any".to_owned())]);
        assert!(by_default.id() != before, "the engine is part of the id");
        assert_eq!(by_default.driver.parameters["engine"], "slow 1/any");
        for mut same in [scenario(Some("slow")), scenario(Some("slow 1/any")), by_default.clone()] {
            settle(&mut same, &[("engine", "fast")]);
            assert_eq!(same, by_default);
        }
        let mut wanted = scenario(None);
        settle(&mut wanted, &[("engine", "fast")]);
        assert_eq!(wanted.driver.parameters["engine"], "fast 2/v3");
        // Of another machine: it stays, and is refused when it is made.
        let mut foreign = scenario(Some("fast 2/v4"));
        settle(&mut foreign, &[]);
        assert_eq!(foreign.driver.parameters["engine"], "fast 2/v4");
        let refused = check(&catalog(), &foreign).unwrap_err();
        assert!(
            refused.message().contains("`engine` is \"fast 2/v4\", which this machine does not have"),
            "{refused}"
        );
        assert!(check(&catalog(), &by_default).is_ok());
        let never = check(&catalog(), &scenario(Some("fast"))).unwrap_err();
        assert!(
            never.message().starts_with("the scenario does not say which `engine` the driver `net` had"),
            "{never}"
        );
    }

    #[test]
    fn methods_that_choose_pixels_are_settled_too() {
        let mut scenario = Scenario::new(ComponentSpec::new("road"), ComponentSpec::new("net"));
        let selection = json!({"name": "fog", "level": 1, "where": {"top": 20, "by": {"name": "map"}}});
        scenario.perturbations.push(serde_json::from_value(selection).unwrap());
        settle(&mut scenario, &[]);
        let selection = scenario.perturbations[0].selection.as_ref().unwrap();
        assert_eq!(selection.by.as_ref().unwrap().parameters["engine"], "slow 1/any");
        assert!(scenario.simulator.parameters.is_empty());
    }
}
