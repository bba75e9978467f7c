//! A suite: which scenarios there are, and what is required of a driver in them. It is a file in TOML with a name and a version.

use std::path::{Path, PathBuf};

use pdk_components::product;
use pdk_components::suggest;
use pdk_model::canonical::canonical;
use pdk_model::component::ComponentSpec;
use pdk_model::failure::FailureCriteria;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_model::scenario::{DEFAULT_DURATION, Mode, Scenario};
use pdk_pipeline::program::Text;
use pdk_record::files::recorded;
use pdk_sdk::error::{Error, Result};
use pdk_sdk::file;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::requirement::{Kind, Requirement};

/// Bytes of a file that may be a suite.
const LARGEST: u64 = 64 << 20;
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
#[serde(deny_unknown_fields)]
pub struct Place {
    /// The simulator, by its name or as a table.
    pub simulator: Value,
    /// Its roads.
    #[serde(default)]
    pub road: Roads,
    /// The time limit in seconds of simulation time.
    #[serde(default = "default_duration")]
    pub duration: f64,
    /// What counts as a failure.
    #[serde(default)]
    pub failure: FailureCriteria,
    /// Whether the simulator waits for the driver; it does if it can.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub mode: Option<Mode>,
}

fn default_duration() -> f64 {
    DEFAULT_DURATION
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
    /// The largest number of drawn scenarios that are driven by both drivers.
    pub pairs: usize,
    /// How many scenarios are under way before the first of them has been looked at.
    pub ahead: usize,
    /// What it means if a requirement is neither shown to be met nor shown not to be met.
    pub undecided: Undecided,
}

impl Default for Test {
    fn default() -> Self {
        Self { tolerated: 0.1, alpha: 0.05, pairs: 400, ahead: 8, undecided: Undecided::Failed }
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

/// A suite with where it comes from.
#[derive(Debug, Clone)]
pub struct Loaded {
    /// What it says.
    pub suite: Suite,
    /// Its text, as the record has it.
    pub text: Text,
    /// BLAKE3 of its contents, in hexadecimal: comments, order and spelling make no difference, everything else does.
    pub hash: String,
}

impl Loaded {
    /// A suite that is part of pdk by its name, or a file.
    ///
    /// # Errors
    /// If there is none, or it is not right.
    pub fn find(named: &str) -> Result<Self> {
        let path = Path::new(named);
        if path.components().count() == 1 && !named.contains('.') {
            let suites = product::get().suites;
            let known = suites.iter().map(|suite| suite.name);
            let suite = suites.iter().find(|suite| suite.name == named).ok_or_else(|| {
                Error::new(format!(
                    "pdk comes with no suite `{named}`, and a file is named with its ending, as in {named}.{ENDING}; {}",
                    suggest::hint(named, known)
                ))
            })?;
            let path = PathBuf::from(format!("{}.{ENDING}", suite.name));
            return Self::new(Text { path, source: suite.source.to_owned(), folder: None });
        }
        let source = file::read_text(path, LARGEST).map_err(|error| {
            Error::new(format!("cannot read the suite {named} ({error}); check the path"))
        })?;
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."));
        Self::new(Text { path: path.to_owned(), source, folder: Some(folder.to_owned()) })
    }

    /// The suite in a text.
    ///
    /// # Errors
    /// If it is not right.
    pub fn new(text: Text) -> Result<Self> {
        let shown = text.path.display().to_string();
        let wrong = |error: toml::de::Error| {
            Error::new(format!("the suite {shown} is not right: {}", one_line(&error, &text.source)))
        };
        let suite: Suite = toml::from_str(&text.source).map_err(wrong)?;
        let contents: Value = toml::from_str(&text.source).map_err(wrong)?;
        suite.check().map_err(|error| error.at(format_args!("the suite {shown}")))?;
        let hash = blake3::derive_key("pdk suite, version 1", canonical(&contents).as_bytes());
        Ok(Self { suite, hash: blake3::Hash::from_bytes(hash).to_hex().to_string(), text })
    }

    /// How the command line names it.
    pub fn named(&self) -> String {
        match self.text.folder {
            Some(_) => recorded(&self.text.path).display().to_string(),
            None => self.text.path.file_stem().unwrap_or_default().to_string_lossy().into_owned(),
        }
    }
}

/// An error of TOML in one line, with the line of the file that it means.
fn one_line(error: &toml::de::Error, source: &str) -> String {
    let message = error.message().replace('\n', " ");
    match error.span() {
        Some(span) => {
            let line = source.get(..span.start).unwrap_or_default().matches('\n').count() + 1;
            format!("line {line}: {message}")
        }
        None => message,
    }
}

impl Suite {
    fn check(&self) -> Result<()> {
        let Self { name, perturbations, levels, nominal, places, test, .. } = self;
        let wrong = |sentence: String| Err(Error::new(sentence));
        if name.is_empty() || !name.chars().all(|c| c.is_ascii_alphanumeric() || "_-".contains(c)) {
            return wrong(format!("`name` is `{name}`, but has to be of letters, digits, `_` and `-`"));
        }
        for (field, number) in [("nominal", *nominal), ("tolerated", test.tolerated), ("alpha", test.alpha)] {
            if !(0.0..=1.0).contains(&number) {
                return wrong(format!("`{field}` is {number}, but has to be from 0 to 1"));
            }
        }
        if test.tolerated == 0.0 || test.alpha == 0.0 || test.tolerated == 1.0 || test.alpha == 1.0 {
            return wrong(
                "`tolerated` and `alpha` have to lie between 0 and 1, such as 0.1 and 0.05".to_owned(),
            );
        }
        if test.pairs == 0 || test.ahead == 0 {
            return wrong("`pairs` and `ahead` have to be at least 1".to_owned());
        }
        if places.is_empty() && self.scenarios.is_empty() {
            return wrong(
                "it has neither a [[place]] to draw scenarios for nor a [[scenario]]; write one".to_owned(),
            );
        }
        if !places.is_empty() && perturbations.is_empty() && *nominal < 1.0 {
            return wrong("`perturbations` is empty; name at least one, or set `nominal` to 1".to_owned());
        }
        for perturbation in perturbations {
            if self.levels_of(perturbation)?.is_empty() {
                return wrong(format!(
                    "`levels` is empty, but `{perturbation}` has no level; write levels such as [1, 2]"
                ));
            }
        }
        for level in levels {
            pdk_model::level::Level::from_json("levels", &Value::from(*level))?;
        }
        for place in places {
            ComponentSpec::from_json("simulator", &place.simulator)?;
            place.failure.check()?;
            if place.duration.is_nan() || place.duration <= 0.0 {
                return wrong(format!("`duration` is {} s, but has to be more than 0", place.duration));
            }
            let Roads { segments, segment, limit } = place.road;
            if !(2..=200).contains(&segments) || !(1.0..=1000.0).contains(&segment) || limit > 90 {
                return wrong(format!(
                    "a road has {segments} segments of {segment} m and angles up to {limit} degrees, but has to have 2 to 200 of 1 to 1000 m \
                     and angles up to 90 degrees"
                ));
            }
        }
        for number in 0..self.scenarios.len() {
            self.fixed(number)?;
        }
        self.required().iter().try_for_each(|requirement| requirement.check(self))
    }

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
        let mut table = self.scenarios.get(number).cloned().unwrap_or_default();
        let known = Scenario::FIELDS.iter().map(|field| field.name);
        if let Some(unknown) =
            table.keys().find(|key| *key == "driver" || !known.clone().any(|known| known == **key))
        {
            return Err(Error::new(format!(
                "{} has a field `{unknown}`; scenarios of a suite have the fields of a record's except `driver`",
                place()
            )));
        }
        table.insert("driver".to_owned(), serde_json::json!({"name": ""}));
        serde_json::from_value(Value::Object(table))
            .map_err(|error| Error::new(format!("{}: {error}", place())))
    }

    /// What is required: what the file says, or what goes without saying.
    pub fn required(&self) -> Vec<Requirement> {
        if !self.requirements.is_empty() {
            return self.requirements.clone();
        }
        let fixed = (!self.scenarios.is_empty()).then_some(Kind::Passes { allowed: 0 });
        let drawn =
            (!self.places.is_empty()).then_some(Kind::NotWorse { by: Default::default(), tolerated: None });
        fixed.into_iter().chain(drawn).map(Requirement::of).collect()
    }
}

#[cfg(test)]
pub mod tests {
    use super::*;

    /// A suite in a text.
    pub fn suite(source: &str) -> Result<Loaded> {
        Loaded::new(Text { path: "a.toml".into(), source: source.to_owned(), folder: None })
    }

    /// One that is right.
    pub const SMALL: &str = r#"
        name = "small"
        version = 1
        perturbations = ["fog", "rain@3"]
        levels = [1, 2]
        nominal = 0.25
        [test]
        tolerated = 0.2
        pairs = 50
        [[place]]
        simulator = { name = "flat", light = "dusk" }
        road = { segments = 4, limit = 20 }
        duration = 12
    "#;

    #[test]
    fn a_suite_is_read_and_its_hash_is_of_what_it_says() {
        let one = suite(SMALL).unwrap();
        assert_eq!(one.suite.places[0].road, Roads { segments: 4, segment: 25.0, limit: 20 });
        assert_eq!((one.suite.test.alpha, one.suite.test.pairs), (0.05, 50));
        assert_eq!(one.suite.levels_of("rain@3").unwrap().len(), 1);
        assert_eq!(one.suite.levels_of("fog").unwrap().len(), 2);
        let spelled = SMALL.replace("levels = [1, 2]", "levels = [ 1.0, 2 ] # two").replace("0.25", "2.5e-1");
        assert_eq!(suite(&spelled).unwrap().hash, one.hash);
        assert_ne!(suite(&SMALL.replace("version = 1", "version = 2")).unwrap().hash, one.hash);
    }

    #[test]
    fn mistakes_are_named_with_their_place() {
        for (what, with, said) in [
            ("version = 1", "versoin = 1", "the suite a.toml is not right: line 3: unknown field `versoin`"),
            ("levels = [1, 2]", "levels = []", "`levels` is empty, but `fog` has no level"),
            ("levels = [1, 2]", "levels = [9]", "the level in `levels` is 9"),
            ("nominal = 0.25", "nominal = 2", "`nominal` is 2, but has to be from 0 to 1"),
            ("tolerated = 0.2", "tolerated = 0", "have to lie between 0 and 1"),
            ("segments = 4", "segments = 1", "a road has 1 segments"),
            ("duration = 12", "duration = 0", "`duration` is 0 s"),
            ("name = \"small\"", "name = \"a b\"", "`name` is `a b`"),
            ("pairs = 50", "pairs = 0", "have to be at least 1"),
        ] {
            let error = suite(&SMALL.replace(what, with)).unwrap_err().to_string();
            assert!(error.contains(said), "{error}");
        }
        let error = suite("name = \"x\"\nversion = 1").unwrap_err().to_string();
        assert!(error.contains("neither a [[place]]"), "{error}");
    }

    #[test]
    fn fixed_scenarios_are_those_of_records() {
        let fixed = r#"
            name = "never_again"
            version = 1
            [[scenario]]
            simulator = { name = "flat" }
            road = { angles = [0, 1.5], segment = 25 }
            duration = 9
            seed = 9007199254740991
        "#;
        let loaded = suite(fixed).unwrap();
        let scenario = loaded.suite.fixed(0).unwrap();
        assert_eq!((scenario.seed, scenario.duration), ((1 << 53) - 1, 9.0));
        assert_eq!(loaded.suite.required()[0].kind, Kind::Passes { allowed: 0 });
        let error = suite(&fixed.replace("seed", "sed")).unwrap_err().to_string();
        assert!(error.contains("[[scenario]] 1 has a field `sed`"), "{error}");
        assert!(suite(&fixed.replace("duration = 9", "")).unwrap_err().to_string().contains("duration"));
    }
}
