//! Perturbations as the user names them, and the chain of them that a frame goes through.

use std::collections::BTreeMap;
use std::fmt;

use pdk_sdk::config::{self, Config};
use pdk_sdk::describe::{Description, Kind, LEVELS};
use pdk_sdk::error::{Error, Result};
use pdk_sdk::prelude::{Context, Frame, FrameBuf, FrameMut, Key, Perturbation};
use pdk_sdk::seed;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::registry::Registry;

/// The highest intensity.
pub const MAX_INTENSITY: f64 = (LEVELS - 1) as f64;

/// A perturbation at an intensity, as the user names it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Spec {
    /// The component's name.
    pub name: String,
    /// The intensity, 0 to 4, any real number in between.
    pub level: f64,
    /// Parameters that the user sets.
    #[serde(default, skip_serializing_if = "Map::is_empty")]
    pub parameters: Map<String, Value>,
}

impl Spec {
    /// A perturbation at a level, with its own parameters.
    pub fn new(name: &str, level: f64) -> Self {
        Self { name: name.to_owned(), level, parameters: Map::new() }
    }

    /// Reads `NAME` or `NAME@LEVEL`, with parameters behind it: `NAME@LEVEL,key=value,...`. Without a level it is
    /// `default_level`.
    ///
    /// # Errors
    /// Where the level is no number from 0 to 4, or a parameter has no value.
    pub fn parse(text: &str, default_level: f64) -> Result<Self> {
        let mut parts = text.split(',');
        let head = parts.next().unwrap_or_default();
        let (name, level) = match head.split_once('@') {
            Some((name, level)) => (name, parse_level(head, level)?),
            None => (head, default_level),
        };
        let mut parameters = Map::new();
        for part in parts {
            let (key, value) = part.split_once('=').ok_or_else(|| {
                Error::new(format!("`{part}` in `{text}` sets nothing; write parameters as name=value"))
            })?;
            parameters.insert(key.to_owned(), parse_value(value));
        }
        Ok(Self { name: name.to_owned(), level, parameters })
    }

    /// Reads a perturbation from a script: a text as for [`Spec::parse`], or a table with `name`, `level` and parameters.
    ///
    /// # Errors
    /// Where it is neither, or the level is no number from 0 to 4.
    pub fn from_json(value: &Value, default_level: f64) -> Result<Self> {
        match value {
            Value::String(text) => Self::parse(text, default_level),
            Value::Object(table) => {
                let mut parameters = table.clone();
                let name = match parameters.shift_remove("name") {
                    Some(Value::String(name)) => name,
                    _ => return Err(Error::new(format!("the perturbation {value} has no `name`"))),
                };
                let level = match parameters.shift_remove("level") {
                    None => default_level,
                    Some(level) => {
                        let text = level.to_string();
                        parse_level(&name, &text)?
                    }
                };
                Ok(Self { name, level, parameters })
            }
            other => Err(Error::new(format!(
                "{other} is no perturbation; write \"name@level\" or {{ name = ..., level = ... }}"
            ))),
        }
    }
}

impl fmt::Display for Spec {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}@{}", self.name, self.level)?;
        self.parameters.iter().try_for_each(|(key, value)| write!(f, ",{key}={value}"))
    }
}

fn parse_level(what: &str, text: &str) -> Result<f64> {
    match text.parse::<f64>() {
        Ok(level) if (0.0..=MAX_INTENSITY).contains(&level) => Ok(level),
        _ => Err(Error::new(format!(
            "the level in `{what}` is {text}, but has to be a number from 0 to {MAX_INTENSITY}"
        ))),
    }
}

/// A value from the command line: JSON where it is JSON, else a text.
pub fn parse_value(text: &str) -> Value {
    serde_json::from_str(text).unwrap_or_else(|_| Value::String(text.to_owned()))
}

/// Perturbations applied one after the other.
pub struct Chain {
    stages: Vec<Stage>,
    /// What lies between two stages.
    between: [FrameBuf; 2],
}

struct Stage {
    label: String,
    instance: Box<dyn Perturbation>,
    description: Description,
    config: Config,
    names: Vec<String>,
    values: Vec<f64>,
    level: f64,
    key: Key,
}

impl Chain {
    /// Makes the instances. Each draws from a key of its own: the run's seed, its name, how many of the same name come
    /// before it, and the scenario; so neither other perturbations nor their order change what it draws.
    ///
    /// # Errors
    /// Where a perturbation does not exist or refuses its parameters.
    pub fn new(registry: &Registry, specs: &[Spec], run_seed: u64, scenario: u64) -> Result<Self> {
        let mut seen = BTreeMap::new();
        let mut stages = Vec::with_capacity(specs.len());
        for spec in specs {
            let (instance, config) = registry.perturbation(&spec.name, &spec.parameters)?;
            let description = registry.get(Kind::Perturbation, &spec.name)?.description.clone();
            let instance_number = seen.entry(spec.name.as_str()).or_insert(0u64);
            let key = seed::key(run_seed, &format!("perturbation/{}", spec.name), *instance_number, scenario);
            *instance_number += 1;
            let names = description.parameters.iter().map(|p| p.name.clone()).collect();
            let (label, level) = (spec.to_string(), spec.level);
            stages.push(Stage { label, instance, description, config, names, values: Vec::new(), level, key });
        }
        Ok(Self { stages, between: [FrameBuf::default(), FrameBuf::default()] })
    }

    /// Writes the perturbed `src` to `dst`; without perturbations it is a copy.
    ///
    /// # Errors
    /// Where a perturbation fails, with its name.
    pub fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, frame_index: u64, time: f64) -> Result<()> {
        let Some((last, earlier)) = self.stages.split_last_mut() else {
            dst.copy_from(src);
            return Ok(());
        };
        if !earlier.is_empty() {
            self.between.iter_mut().for_each(|frame| frame.resize(src.width(), src.height()));
        }
        let [from, to] = &mut self.between;
        for (position, stage) in earlier.iter_mut().enumerate() {
            let input = if position == 0 { src } else { from.as_ref() };
            stage.apply(input, to.as_mut(), frame_index, time)?;
            std::mem::swap(from, to);
        }
        let input = if earlier.is_empty() { src } else { from.as_ref() };
        last.apply(input, dst, frame_index, time)
    }
}

impl Stage {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, frame_index: u64, time: f64) -> Result<()> {
        config::frame_values(&self.description, &self.config, self.level, &mut self.values);
        let cx = Context::new(self.level, frame_index, time, &self.key).with_values(&self.names, &self.values);
        self.instance.apply(src, dst, &cx).map_err(|error| error.at(format!("perturbation `{}`", self.label)))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn reads_what_users_write() {
        assert_eq!(Spec::parse("fog@2.5", 0.0).unwrap(), Spec::new("fog", 2.5));
        assert_eq!(Spec::parse("fog", 2.0).unwrap().level, 2.0);
        let spec = Spec::parse("fog@1,mode=soft,size=3", 0.0).unwrap();
        assert_eq!(spec.parameters, *json!({"mode": "soft", "size": 3}).as_object().unwrap());
        assert_eq!(Spec::from_json(&json!({"name": "fog", "level": 1, "size": 3}), 0.0).unwrap().level, 1.0);
        assert_eq!(spec.to_string(), "fog@1,mode=\"soft\",size=3");
    }

    #[test]
    fn refuses_levels_outside_the_scale() {
        for text in ["fog@9", "fog@-1", "fog@nan", "fog@x"] {
            let error = Spec::parse(text, 0.0).unwrap_err().to_string();
            assert!(error.ends_with("has to be a number from 0 to 4"), "{error}");
        }
        assert!(Spec::from_json(&json!({"name": "fog", "level": "high"}), 0.0).is_err());
        assert!(Spec::from_json(&json!(3), 0.0).is_err());
    }
}
