//! A suite: which scenarios there are, and what is required of a driver in them. It is a file in TOML with a name and a version.

use pdk_model::component::ComponentSpec;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_model::scenario::{DEFAULT_DURATION, Scenario};
use pdk_sdk::error::{Error, Result};
use pdk_sdk::suggest;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::requirement::{Kind, Requirement};
use crate::stretch::{Recording, Stretch};

/// The largest number of scenarios.
pub const MOST: usize = 1_000_000;
/// The ending of a suite's file.
pub const ENDING: &str = "toml";

/// A suite as its file says it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Suite {
    /// What it is called.
    pub name: String,
    /// Raised with each change.
    pub version: u32,
    /// What it is for, in a sentence.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub about: String,
    /// The perturbations of which each drawn scenario has one; one with a level keeps it.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub perturbations: Vec<String>,
    /// The levels of perturbations that have none of their own.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub levels: Vec<f64>,
    /// The share of drawn scenarios without any perturbation.
    #[serde(default, skip_serializing_if = "is_zero")]
    pub nominal: f64,
    /// The simulators of which each drawn scenario has one, with the roads that are drawn there.
    #[serde(default, rename = "place", skip_serializing_if = "Vec::is_empty")]
    pub places: Vec<Place>,
    /// The recordings whose blocks are drawn, in the place of roads.
    #[serde(default, rename = "recording", skip_serializing_if = "Vec::is_empty")]
    pub recordings: Vec<Recording>,
    /// How the decision is made.
    #[serde(default)]
    pub test: Test,
    /// What is required.
    #[serde(default, rename = "require", skip_serializing_if = "Vec::is_empty")]
    pub requirements: Vec<Requirement>,
    /// Fixed scenarios, as records have them, without a driver.
    #[serde(default, rename = "scenario", skip_serializing_if = "Vec::is_empty")]
    pub scenarios: Vec<Map<String, Value>>,
}

fn is_zero(number: &f64) -> bool {
    *number == 0.0
}

/// A simulator with the roads that are drawn for it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Place {
    /// What the scenarios that are drawn for it have besides, as records have it; the simulator may also be a name.
    #[serde(flatten)]
    pub fields: Map<String, Value>,
    /// Its roads.
    #[serde(default)]
    pub road: Roads,
}

/// Fields of a scenario that are drawn for it or follow from others, so that a place cannot have them.
const DRAWN: [&str; 6] = ["driver", "road", "perturbations", "seed", "repeat", "files"];

impl Place {
    /// The fields that a place can have besides `road`.
    pub fn known() -> impl Iterator<Item = &'static str> + Clone {
        Scenario::FIELDS.iter().map(|field| field.name).filter(|name| !DRAWN.contains(name))
    }

    /// A scenario for it, without a road, perturbations and a driver.
    ///
    /// # Errors
    /// If its fields are not those of a scenario.
    pub fn scenario(&self) -> Result<Scenario> {
        if let Some(unknown) = self.fields.keys().find(|name| !Self::known().any(|known| known == *name)) {
            return Err(Error::new(format!(
                "there is no field `{unknown}`; {}",
                suggest::hint(unknown, Self::known().chain(["road"]))
            )));
        }
        let mut table = self.fields.clone();
        let simulator =
            table.get("simulator").ok_or_else(|| Error::new("it has no `simulator`; name one"))?;
        let simulator = ComponentSpec::from_json("simulator", simulator)?;
        table.insert("simulator".to_owned(), serde_json::to_value(simulator)?);
        table.entry("duration").or_insert_with(|| DEFAULT_DURATION.into());
        table.insert("seed".to_owned(), 0.into());
        of_table(table)
    }
}

/// A scenario in a table of a suite, which names no driver.
fn of_table(mut table: Map<String, Value>) -> Result<Scenario> {
    table.insert("driver".to_owned(), serde_json::json!({"name": ""}));
    serde_json::from_value(Value::Object(table)).map_err(|error| Error::new(error.to_string()))
}

/// How roads are drawn.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Roads {
    /// The number of segments.
    pub segments: usize,
    /// The length of a segment in metres.
    pub segment: f64,
    /// The largest angle from one segment to the next in degrees.
    pub limit: u32,
}

impl Default for Roads {
    fn default() -> Self {
        Self { segments: pdk_road::NODES, segment: pdk_road::SEGMENT, limit: 35 }
    }
}

/// How the decision is made.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Test {
    /// By how much the failure rate of the new driver may be higher.
    pub tolerated: f64,
    /// The probability of a wrong verdict, of all tests together.
    pub alpha: f64,
    /// The largest number of drawn scenarios that are given to both drivers; recordings may have fewer blocks.
    pub pairs: usize,
    /// How many scenarios are under way before the first of them has been looked at.
    pub ahead: usize,
    /// How often a driver drives a scenario at most, until its verdict is stable. If it is left out, once if the simulator repeats itself,
    /// else up to five times.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub repeats: Option<u64>,
    /// What it means if a requirement is neither shown to be met nor shown not to be met.
    pub undecided: Undecided,
}

impl Default for Test {
    fn default() -> Self {
        Self {
            tolerated: 0.1,
            alpha: 0.05,
            pairs: 400,
            ahead: 8,
            repeats: None,
            undecided: Undecided::Failed,
        }
    }
}

/// What it means if nothing is shown.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Undecided {
    /// The gate fails.
    Failed,
    /// The gate passes.
    Passed,
}

impl Suite {
    /// The perturbation at each of its levels.
    ///
    /// # Errors
    /// If it is not a perturbation.
    pub fn levels_of(&self, perturbation: &str) -> Result<Vec<AppliedPerturbation>> {
        let text = Value::from(perturbation);
        match AppliedPerturbation::from_json_without_level(&text) {
            Ok(applied) => Ok(self.levels.iter().map(|level| applied.clone().at_level(*level)).collect()),
            Err(_) => Ok(vec![AppliedPerturbation::from_json(&text)?]),
        }
    }

    /// A fixed scenario by its number, without a driver.
    ///
    /// # Errors
    /// If it is not one.
    pub fn fixed(&self, number: usize) -> Result<Scenario> {
        let place = || format!("[[scenario]] {}", number + 1);
        let table = self.scenarios.get(number).cloned().unwrap_or_default();
        let known = Scenario::FIELDS.iter().map(|field| field.name);
        if let Some(unknown) =
            table.keys().find(|key| *key == "driver" || !known.clone().any(|known| known == **key))
        {
            return Err(Error::new(format!(
                "{} has a field `{unknown}`; scenarios of a suite have the fields of a record's except `driver`",
                place()
            )));
        }
        of_table(table).map_err(|error| error.at(place()))
    }

    /// Whether scenarios are drawn.
    pub fn draws(&self) -> bool {
        !self.places.is_empty() || !self.recordings.is_empty()
    }

    /// Whether its scenarios are blocks of recordings.
    pub fn is_recorded(&self) -> bool {
        !self.recordings.is_empty()
            || (0..self.scenarios.len())
                .any(|number| self.fixed(number).is_ok_and(|scenario| Stretch::of(&scenario).is_some()))
    }

    /// What is drawn for a measure.
    pub fn drawn(&self) -> &'static str {
        if self.is_recorded() { "blocks" } else { "roads" }
    }

    /// What is required: what the file says, or what goes without saying.
    pub fn required(&self) -> Vec<Requirement> {
        if !self.requirements.is_empty() {
            return self.requirements.clone();
        }
        let fixed = (!self.scenarios.is_empty()).then_some(Kind::Passes { allowed: 0 });
        let drawn = self.draws().then_some(Kind::NotWorse { by: Default::default(), tolerated: None });
        fixed.into_iter().chain(drawn).map(Requirement::of).collect()
    }
}
