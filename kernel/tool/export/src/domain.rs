//! What perturbations and the parameters of simulators stand for in an operational design domain: the product's table.

use std::collections::{BTreeMap, BTreeSet};

use pdk_components::product;
use pdk_model::component::ComponentSpec;
use pdk_model::scenario::Scenario;
use pdk_sdk::error::{Error, Result};
use serde::{Deserialize, Serialize};
use serde_json::Value;

/// The table.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Domain {
    /// Attributes of an operational design domain.
    #[serde(rename = "attribute")]
    pub attributes: Vec<Item>,
    /// Conditions that may trigger an insufficiency.
    #[serde(rename = "trigger")]
    pub triggers: Vec<Item>,
    /// What perturbations stand for, by their names.
    #[serde(rename = "perturbation")]
    pub perturbations: BTreeMap<String, Stands>,
    /// What simulators show.
    #[serde(rename = "condition")]
    pub conditions: Vec<Condition>,
}

/// An attribute or a trigger.
#[derive(Debug, Clone, Deserialize, Serialize)]
#[serde(deny_unknown_fields)]
pub struct Item {
    /// By which the rest of the table names it.
    pub id: String,
    /// The group that it belongs to.
    pub group: String,
    /// What it is called.
    pub name: String,
}

/// What something stands for, by ids.
#[derive(Debug, Clone, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Stands {
    /// Attributes.
    pub attributes: Vec<String>,
    /// Triggers.
    pub triggers: Vec<String>,
}

/// What a simulator shows, always or with a parameter.
#[derive(Debug, Clone, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Condition {
    /// The simulator.
    pub simulator: String,
    /// The parameter; none if it always shows this.
    pub parameter: Option<String>,
    /// The value that the parameter has.
    pub value: Option<Value>,
    /// The number that it is above.
    pub above: Option<f64>,
    /// Whether the parameter may also be left out.
    #[serde(default)]
    pub default: bool,
    /// What it stands for.
    #[serde(default)]
    pub attributes: Vec<String>,
    /// What it may trigger.
    #[serde(default)]
    pub triggers: Vec<String>,
}

/// What a scenario stands for, by ids, with what stands for it.
#[derive(Debug, Default)]
pub struct Meaning {
    /// Attributes.
    pub attributes: BTreeMap<String, BTreeSet<String>>,
    /// Triggers.
    pub triggers: BTreeMap<String, BTreeSet<String>>,
    /// Perturbations that the table does not have.
    pub unlisted: BTreeSet<String>,
}

impl Domain {
    /// The table of the product.
    ///
    /// # Errors
    /// If it is not right.
    pub fn of_product() -> Result<Self> {
        Self::parse(product::get().domain)
    }

    /// The table in a text.
    ///
    /// # Errors
    /// If it is not right, or names something that it does not list.
    pub fn parse(text: &str) -> Result<Self> {
        let wrong = |error: &dyn std::fmt::Display| {
            Error::new(format!(
                "the table of the operational design domain is not right ({error}), which is a defect in pdk"
            ))
        };
        let domain: Self = toml::from_str(text).map_err(|error| wrong(&error))?;
        let ids = |items: &[Item]| items.iter().map(|item| item.id.clone()).collect::<BTreeSet<String>>();
        let (attributes, triggers) = (ids(&domain.attributes), ids(&domain.triggers));
        let named = domain.perturbations.values().map(|stands| (&stands.attributes, &stands.triggers));
        let named = named
            .chain(domain.conditions.iter().map(|condition| (&condition.attributes, &condition.triggers)));
        for (of_attributes, of_triggers) in named {
            let unknown = of_attributes
                .iter()
                .find(|id| !attributes.contains(*id))
                .or_else(|| of_triggers.iter().find(|id| !triggers.contains(*id)));
            if let Some(unknown) = unknown {
                return Err(wrong(&format!("`{unknown}` is not listed")));
            }
        }
        Ok(domain)
    }

    /// What the perturbations of a scenario stand for.
    pub fn of_perturbations(&self, scenario: &Scenario) -> Meaning {
        let mut meaning = Meaning::default();
        for perturbation in &scenario.perturbations {
            self.add_perturbation(&perturbation.name, &mut meaning);
        }
        meaning
    }

    /// What the simulator of a scenario shows.
    pub fn of_simulator(&self, scenario: &Scenario) -> Meaning {
        let mut meaning = Meaning::default();
        for condition in self.conditions.iter().filter(|condition| condition.holds(&scenario.simulator)) {
            meaning.add(&condition.attributes, &condition.triggers, &condition.text());
        }
        meaning
    }

    /// Adds what a perturbation stands for.
    pub fn add_perturbation(&self, name: &str, meaning: &mut Meaning) {
        match self.perturbations.get(name) {
            Some(stands) => meaning.add(&stands.attributes, &stands.triggers, name),
            None => _ = meaning.unlisted.insert(name.to_owned()),
        }
    }
}

impl Meaning {
    fn add(&mut self, attributes: &[String], triggers: &[String], by: &str) {
        for (known, ids) in [(&mut self.attributes, attributes), (&mut self.triggers, triggers)] {
            for id in ids {
                known.entry(id.clone()).or_default().insert(by.to_owned());
            }
        }
    }
}

impl Condition {
    /// Whether a simulator shows it.
    fn holds(&self, simulator: &ComponentSpec) -> bool {
        if simulator.name != self.simulator {
            return false;
        }
        let Some(parameter) = &self.parameter else { return true };
        match simulator.parameters.get(parameter) {
            None => self.default,
            Some(value) => {
                self.value.as_ref() == Some(value)
                    || self.above.is_some_and(|above| value.as_f64().is_some_and(|value| value > above))
            }
        }
    }

    /// As tables have it.
    fn text(&self) -> String {
        let Self { simulator, parameter, value, above, .. } = self;
        let Some(parameter) = parameter else { return simulator.clone() };
        match (value, above) {
            (Some(Value::String(text)), _) => format!("{simulator}: {parameter} {text}"),
            (Some(value), _) => format!("{simulator}: {parameter} {value}"),
            (None, Some(above)) => format!("{simulator}: {parameter} above {above}"),
            (None, None) => format!("{simulator}: {parameter}"),
        }
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;

    /// A small table.
    pub const SMALL: &str = r#"
        [[attribute]]
        id = "fog"
        group = "air"
        name = "fog & mist"
        [[attribute]]
        id = "dark"
        group = "light"
        name = "dark"
        [[attribute]]
        id = "works"
        group = "road"
        name = "road works"
        [[trigger]]
        id = "pale"
        group = "sensor"
        name = "pale scenes"
        [perturbation]
        mist = { attributes = ["fog"], triggers = ["pale"] }
        [[condition]]
        simulator = "flat"
        parameter = "light"
        value = "dark"
        attributes = ["dark"]
        [[condition]]
        simulator = "flat"
        parameter = "haze"
        above = 0
        default = true
        triggers = ["pale"]
    "#;

    fn scenario(light: &str, haze: Option<f64>, perturbation: &str) -> Scenario {
        let mut simulator = ComponentSpec::new("flat");
        simulator.parameters.insert("light".into(), light.into());
        simulator.parameters.extend(haze.map(|haze| ("haze".to_owned(), haze.into())));
        let mut scenario = Scenario::new(simulator, ComponentSpec::new("x"));
        let applied = pdk_model::perturbation::AppliedPerturbation::parse(perturbation).unwrap();
        scenario.perturbations = vec![applied];
        scenario
    }

    #[test]
    fn a_scenario_stands_for_what_it_shows() {
        let domain = Domain::parse(SMALL).unwrap();
        let dark = scenario("dark", Some(0.0), "mist@2");
        let (seen, shown) = (domain.of_perturbations(&dark), domain.of_simulator(&dark));
        assert_eq!(seen.attributes.keys().collect::<Vec<_>>(), ["fog"]);
        assert_eq!(seen.triggers["pale"].iter().collect::<Vec<_>>(), ["mist"]);
        assert_eq!(shown.attributes["dark"].iter().collect::<Vec<_>>(), ["flat: light dark"]);
        assert!(shown.triggers.is_empty());
        let day = scenario("day", None, "own@1");
        let shown = domain.of_simulator(&day);
        assert_eq!(shown.triggers["pale"].iter().collect::<Vec<_>>(), ["flat: haze above 0"]);
        assert!(shown.attributes.is_empty() && domain.of_perturbations(&day).unlisted.contains("own"));
    }

    #[test]
    fn what_is_not_listed_is_a_mistake() {
        let error = Domain::parse(&SMALL.replace("[\"fog\"]", "[\"fgo\"]")).unwrap_err().to_string();
        assert!(error.contains("`fgo` is not listed"), "{error}");
        assert!(Domain::parse("[[attribute]]").is_err());
    }
}
