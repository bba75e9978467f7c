//! Settles what a scenario leaves to the machine, before it gets its id.
//!
//! An option may stand for something that differs from machine to machine, such as the engine that runs a network
//! ([`Parameter::stands_for`](pdk_sdk::describe::Parameter)). The scenario says what it stood for, so that its id is a hash of
//! everything that decides the outcome, and a machine that has something else refuses it.

use std::collections::BTreeMap;
use std::path::Path;

use pdk_model::component::ComponentSpec;
use pdk_model::level_scale::LevelScale;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_model::region::Region;
use pdk_model::scenario::Scenario;
use pdk_sdk::config::Config;
use pdk_sdk::describe::{Description, Kind, ParameterType};
use pdk_sdk::error::{Error, ErrorKind, Result};
use serde_json::{Map, Value};

use crate::files::recorded;
use crate::inputs;
use crate::manifest::components_of;
use pdk_components::catalog::Catalog;
use pdk_components::hash;
use pdk_components::registry::is_mask_script;

/// Puts what options stand for into scenarios and evaluations, and notes what it was.
pub struct Settler<'a> {
    /// The components of this machine.
    pub catalog: &'a Catalog,
    /// Options that the user wants in the place of defaults, by parameter, such as `engine`.
    pub wanted: BTreeMap<&'static str, &'a str>,
    /// What was settled so far: each parameter with each of its values.
    pub settled: &'a mut Vec<(String, String)>,
    /// The contents of files and folders that were named so far, by their paths.
    pub contents: &'a mut BTreeMap<String, String>,
}

impl Settler<'_> {
    /// Settles all components of a scenario, and notes the contents of the files that they name.
    pub fn scenario(&mut self, scenario: &mut Scenario) {
        self.component(Kind::Simulator, &mut scenario.simulator);
        self.component(Kind::Driver, &mut scenario.driver);
        self.perturbations(&mut scenario.perturbations);
        scenario.files = self.files(&components_of(scenario), &scenario.perturbations);
    }

    /// The contents of the files and folders that components and perturbations name.
    pub fn files(
        &mut self,
        components: &[(Kind, ComponentSpec)],
        perturbations: &[AppliedPerturbation],
    ) -> BTreeMap<String, String> {
        let mut files = BTreeMap::new();
        for (kind, component) in components {
            let kind = *kind;
            let parameters = self.paths(kind, &component.name);
            let named = parameters.iter().filter_map(|name| component.parameters.get(name)?.as_str());
            // What stands for a file of the user's is what that file holds.
            let made_of = self.catalog.get(kind, &component.name).ok().filter(|entry| entry.base.is_some());
            if let Some(path) = made_of.map(|entry| entry.file.to_string_lossy().into_owned()) {
                let mut content = BTreeMap::new();
                self.note(&path, &mut content);
                files.extend(content.into_values().map(|content| (component.name.clone(), content)));
            }
            // A mask may be a script of the user's, by its path.
            let script = is_mask_script(kind, &component.name).then_some(component.name.as_str());
            named.chain(script).for_each(|path| self.note(path, &mut files));
        }
        for perturbation in perturbations {
            if let Some(Region::Mask(path)) = &perturbation.region {
                self.note(path, &mut files);
            }
        }
        files
    }

    /// The contents of the files that a component names in lists, such as a program with its arguments.
    pub fn listed_files(&mut self, component: &ComponentSpec) -> BTreeMap<String, String> {
        let mut files = BTreeMap::new();
        let lists = component.parameters.values().filter_map(Value::as_array).flatten();
        for path in lists.filter_map(Value::as_str).filter(|path| Path::new(path).is_file()) {
            self.note(path, &mut files);
        }
        files
    }

    /// The parameters of a component that name files or folders.
    fn paths(&self, kind: Kind, name: &str) -> Vec<String> {
        let Ok(entry) = self.catalog.get(kind, name) else { return Vec::new() };
        let parameters = entry.description.parameters.iter();
        parameters.filter(|parameter| parameter.kind == ParameterType::Path).map(|p| p.name.clone()).collect()
    }

    /// Notes the content of a file or a folder. What cannot be read is for its component to report.
    fn note(&mut self, path: &str, files: &mut BTreeMap<String, String>) {
        if !self.contents.contains_key(path) {
            let place = Path::new(path);
            let content = if place.is_dir() { inputs::of_folder(place) } else { hash::of(place) };
            self.contents.extend(content.ok().map(|content| (path.to_owned(), content)));
        }
        files.extend(self.contents.get(path).map(|content| (path.to_owned(), content.clone())));
    }

    /// Settles perturbations with their masks and the methods that choose their pixels.
    pub fn perturbations(&mut self, applied: &mut [AppliedPerturbation]) {
        for perturbation in applied {
            if let Some(Region::Mask(path)) = &mut perturbation.region {
                *path = as_recorded(path);
            }
            // A scale that there is not is refused when the perturbation is made.
            if let Ok(Some(measured)) = self.catalog.measured_scale(perturbation) {
                perturbation.level_scale = Some(LevelScale::Measured(measured));
            }
            self.parameters(Kind::Perturbation, &perturbation.name, &mut perturbation.parameters);
            if let Some(selection) = &mut perturbation.selection {
                if let Some(mask) = &mut selection.mask {
                    if is_mask_script(Kind::Mask, &mask.name) {
                        mask.name = as_recorded(&mask.name);
                    }
                    self.component(Kind::Mask, mask);
                }
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
        for name in self.paths(kind, name) {
            if let Some(Value::String(path)) = parameters.get_mut(&name) {
                *path = as_recorded(path);
            }
        }
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

/// A path as records have it.
fn as_recorded(path: &str) -> String {
    recorded(Path::new(path)).to_string_lossy().into_owned()
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
            Description::simulator("road", "A road").parameter(Parameter::path("map", "Its map")),
        ] {
            catalog.add(Entry::new(description, "somewhere".into()));
        }
        catalog
    }

    fn settle(scenario: &mut Scenario, wanted: &[(&'static str, &str)]) -> Vec<(String, String)> {
        let wanted = wanted.iter().copied().collect();
        let mut settled = Vec::new();
        let contents = &mut BTreeMap::new();
        Settler { catalog: &catalog(), wanted, settled: &mut settled, contents }.scenario(scenario);
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
    fn the_id_follows_from_what_is_in_a_file_and_not_from_where_it_is() {
        let folder = tempfile::tempdir().unwrap();
        let named = |path: &Path| {
            let mut scenario = Scenario::new(ComponentSpec::new("road"), ComponentSpec::new("net"));
            scenario.simulator.parameters.insert("map".to_owned(), path.to_string_lossy().into());
            settle(&mut scenario, &[]);
            scenario
        };
        let path = |name: &str| folder.path().join(name);
        for (name, text) in [("a", "1"), ("b", "1"), ("c", "2")] {
            std::fs::write(path(name), text).unwrap();
            std::fs::create_dir(path(&format!("in-{name}"))).unwrap();
            std::fs::write(path(&format!("in-{name}/x")), text).unwrap();
        }
        let ids = |names: [&str; 4]| names.map(|name| named(&path(name)).id());
        let [a, b, c, gone] = ids(["a", "b", "c", "d"]);
        assert!(a == b && a != c && a != gone);
        let [a, b, c, _] = ids(["in-a", "in-b", "in-c", "a"]);
        assert!(a == b && a != c);
        // A path below the working directory counts from there.
        let here = std::env::current_dir().unwrap().canonicalize().unwrap().join("Cargo.toml");
        let scenario = named(&here);
        assert_eq!(scenario.simulator.parameters["map"], "Cargo.toml");
        assert_eq!(scenario.files.keys().collect::<Vec<_>>(), ["Cargo.toml"]);
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
