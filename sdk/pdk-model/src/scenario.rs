//! Everything that decides an outcome.

use std::collections::BTreeMap;
use std::fmt;
use std::str::FromStr;

use serde::{Deserialize, Deserializer, Serialize, Serializer};
use serde_json::Value;

use crate::canonical::canonical;
use crate::component::ComponentSpec;
use crate::described::described;
use crate::error::{Error, Result};
use crate::failure::FailureCriteria;
use crate::perturbation::AppliedPerturbation;

/// The default time limit of a scenario, in seconds of simulation time.
pub const DEFAULT_DURATION: f64 = 30.0;

/// What happens while perturbations and driver are at work on a frame.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Mode {
    /// The simulator waits, so that the outcome does not depend on how fast the machine is.
    #[default]
    Lockstep,
    /// The simulator goes on by the clock under the control before; when the driver is done, it gets the newest frame, and
    /// those in between are skipped.
    Realtime,
}

impl Mode {
    /// All modes.
    pub const ALL: [Self; 2] = [Self::Lockstep, Self::Realtime];

    /// The name as users write it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Lockstep => "lockstep",
            Self::Realtime => "realtime",
        }
    }

    /// Whether it is lockstep, which records leave unsaid.
    pub fn is_lockstep(&self) -> bool {
        *self == Self::Lockstep
    }
}

impl fmt::Display for Mode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Mode {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|mode| mode.name() == name).ok_or_else(|| {
            Error::new(format!("`mode` is `{name}`, but has to be {} or {}", Self::Lockstep, Self::Realtime))
        })
    }
}

described! {
    /// Everything that decides an outcome: the same scenario, driven in lockstep, comes out the same on every machine and beside
    /// whatever other scenarios.
    #[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
    pub struct Scenario {
        /// The simulator.
        simulator: ComponentSpec, Luau "(string | Component)?", JSON "component";
        /// The driver under test.
        driver: ComponentSpec, Luau "(string | Component)?", JSON "component";
        /// The road in the simulator's own terms; the simulator's default if it is left out.
        road: Value, Luau "any", JSON "any JSON", "if not null" unless "Value::is_null";
        /// The perturbations, in the order in which a frame goes through them.
        perturbations: Vec<AppliedPerturbation>, Luau "{ string | AppliedPerturbation }?", JSON "list",
            "if not empty" unless "Vec::is_empty";
        /// The time limit in seconds of simulation time; 30 if it is left out.
        duration: f64, Luau "number?", JSON "number, s";
        /// What counts as a failure. What it leaves out is the default.
        failure: FailureCriteria, Luau "FailureCriteria?", JSON "object", "if not the default" unless "FailureCriteria::is_default";
        /// Whether the simulator waits for the driver (`lockstep`), as it does if this is left out and it can, or goes on by the clock
        /// (`realtime`).
        mode: Mode, Luau "(\"lockstep\" | \"realtime\")?", JSON "text", "if not `lockstep`" unless "Mode::is_lockstep";
        /// The seed of all that is drawn, by the simulator and the perturbations. If it is left out, it follows from the run's seed, the road
        /// and `repeat`: so perturbations and levels are compared under the same luck.
        seed: u64, Luau "number?", JSON "whole number, to 2^53 - 1";
        /// Which drive of the same it is, if it is wanted several times: another one gets luck of its own. 0 if it is left out.
        repeat: u64, Luau "number?", JSON "whole number", "if not 0" unless "is_zero";
        /// The files and folders that parameters name, and the components that are made from a file of the user's, each with the hash of its
        /// content. The id follows from the hashes, not from the names.
        files: BTreeMap<String, String>, Luau "", JSON "object", "if not empty" unless "BTreeMap::is_empty";
    }
}

/// Puts the contents of files in the places of their names.
fn name_by_content(value: &mut Value, files: &BTreeMap<String, String>) {
    match value {
        Value::String(text) => {
            if let Some(hash) = files.get(text) {
                *text = format!("blake3:{hash}");
            }
        }
        Value::Array(items) => items.iter_mut().for_each(|item| name_by_content(item, files)),
        Value::Object(fields) => fields.values_mut().for_each(|value| name_by_content(value, files)),
        _ => {}
    }
}

fn is_zero(count: &u64) -> bool {
    *count == 0
}

impl Scenario {
    /// The default road, unperturbed, in lockstep, for [`DEFAULT_DURATION`], with seed 0.
    pub fn new(simulator: ComponentSpec, driver: ComponentSpec) -> Self {
        Self { simulator, driver, duration: DEFAULT_DURATION, ..Self::default() }
    }

    /// The one text that says this scenario: JSON with keys sorted, without spaces, without what is null or the default, with
    /// one spelling for each number, and with the hashes of files in the places of their names.
    pub fn canonical(&self) -> String {
        match serde_json::to_value(self) {
            Ok(mut value) => {
                self.name_by_content(&mut value);
                canonical(&value)
            }
            Err(error) => unreachable!("every key of a scenario is a text, so it is JSON: {error}"),
        }
    }

    /// Puts the contents of files in the places of their names.
    fn name_by_content(&self, scenario: &mut Value) {
        let Some(fields) = scenario.as_object_mut().filter(|_| !self.files.is_empty()) else { return };
        fields.remove("files");
        for part in ["simulator", "driver", "perturbations"] {
            fields.get_mut(part).into_iter().for_each(|part| name_by_content(part, &self.files));
        }
    }

    /// What tells it from every other scenario: a hash of its [canonical text](Scenario::canonical).
    pub fn id(&self) -> ScenarioId {
        let hash = blake3::derive_key("pdk scenario, version 1", self.canonical().as_bytes());
        let mut id = [0; 16];
        id.copy_from_slice(&hash[..16]);
        ScenarioId(id)
    }

    /// The name of each perturbation, for tables.
    pub fn perturbation_names(&self) -> Vec<String> {
        self.perturbations.iter().map(AppliedPerturbation::short_name).collect()
    }

    /// Its default name in tables, which is made of its perturbations.
    pub fn default_name(&self) -> String {
        match self.perturbations.is_empty() {
            true => "nominal".to_owned(),
            false => self.perturbation_names().join(" + "),
        }
    }
}

/// The largest seed. From the next number on, Lua and many readers of JSON round.
pub const LARGEST_SEED: u64 = (1 << 53) - 1;

/// A seed that a user gives.
///
/// # Errors
/// If it is too large.
pub fn checked_seed(seed: u64) -> Result<u64> {
    match seed <= LARGEST_SEED {
        true => Ok(seed),
        false => Err(not_a_seed(&seed)),
    }
}

/// A seed as it is written on the command line.
///
/// # Errors
/// If it is not a whole number, or too large.
pub fn parse_seed(text: &str) -> Result<u64> {
    text.parse().map_err(|_| not_a_seed(&text)).and_then(checked_seed)
}

fn not_a_seed(given: &dyn fmt::Display) -> Error {
    Error::new(format!(
        "`{given}` is not a seed: seeds are whole numbers from 0 to {LARGEST_SEED}, which every language keeps exactly"
    ))
}

/// What tells a scenario from every other: 32 hexadecimal digits.
#[derive(Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct ScenarioId([u8; 16]);

impl fmt::Display for ScenarioId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.0.iter().try_for_each(|byte| write!(f, "{byte:02x}"))
    }
}

impl fmt::Debug for ScenarioId {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl FromStr for ScenarioId {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        // One spelling only, so that equal ids are equal texts.
        let digits = text.len() == 32 && text.bytes().all(|c| matches!(c, b'0'..=b'9' | b'a'..=b'f'));
        match u128::from_str_radix(text, 16) {
            Ok(number) if digits => Ok(Self(number.to_be_bytes())),
            _ => Err(Error::new(format!(
                "`{text}` is not a scenario id; it has to be 32 hexadecimal digits with small letters"
            ))),
        }
    }
}

impl Serialize for ScenarioId {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_str(self)
    }
}

impl<'de> Deserialize<'de> for ScenarioId {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        String::deserialize(deserializer)?.parse().map_err(serde::de::Error::custom)
    }
}

#[cfg(test)]
mod tests;
