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

pub mod modifiers;
mod region;
mod schedule;

use region::Mask;
pub use region::Region;
pub use schedule::Level;

/// The highest intensity.
pub const MAX_INTENSITY: f64 = (LEVELS - 1) as f64;

/// A perturbation as the user names it: at an intensity, with parameters, and with what limits it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Spec {
    /// The component's name.
    pub name: String,
    /// The intensity.
    pub level: Level,
    /// The chance that a frame is perturbed, drawn for each frame; every frame is where it is not set.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub probability: Option<f64>,
    /// The part of the frame that is perturbed; all of it where it is not set.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub region: Option<Region>,
    /// What is drawn when; as the perturbation says where it is not set.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub draws: Option<Draws>,
    /// Parameters that the user sets.
    #[serde(default, skip_serializing_if = "Map::is_empty")]
    pub parameters: Map<String, Value>,
}

/// When random numbers are drawn, against what the perturbation itself would do.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Draws {
    /// Everything anew for every frame.
    PerFrame,
    /// Everything once: all frames have the same noise.
    PerSequence,
}

impl Spec {
    /// A perturbation at a level.
    pub fn new(name: &str, level: f64) -> Self {
        let level = Level::Constant(level);
        Self {
            name: name.to_owned(),
            level,
            probability: None,
            region: None,
            draws: None,
            parameters: Map::new(),
        }
    }

    /// Reads `NAME` or `NAME@LEVEL`, with parameters behind it: `NAME@LEVEL,key=value,...`. Without a level it is
    /// `default_level`.
    ///
    /// # Errors
    /// Where the level is no number from 0 to 4, or a parameter has no value.
    pub fn parse(text: &str, default_level: f64) -> Result<Self> {
        let mut parts = split_outside_brackets(text).into_iter();
        let head = parts.next().unwrap_or_default();
        let (name, level) = head.split_once('@').map_or((head, None), |(name, level)| (name, Some(level)));
        if name.is_empty() {
            return Err(Error::new(format!(
                "`{text}` names no perturbation; write NAME, NAME@LEVEL or NAME@LEVEL,PARAMETER=VALUE"
            )));
        }
        let mut table = Map::from_iter([("name".to_owned(), Value::from(name))]);
        if let Some(level) = level {
            let level = Level::from_json(head, &parse_value(level))?;
            table.insert("level".to_owned(), serde_json::to_value(level)?);
        }
        for part in parts {
            let (key, value) = part.split_once('=').ok_or_else(|| {
                Error::new(format!("`{part}` in `{text}` sets nothing; write parameters as name=value"))
            })?;
            if table.insert(key.to_owned(), parse_value(value)).is_some() {
                return Err(Error::new(format!("`{text}` sets `{key}` twice; leave one out")));
            }
        }
        Self::from_json(&Value::Object(table), default_level)
    }

    /// Reads a perturbation from a script: a text as for [`Spec::parse`], or a table with `name`, `level`, `probability`,
    /// `region`, `draws` and parameters.
    ///
    /// # Errors
    /// Where it is neither, or one of them is out of range.
    pub fn from_json(value: &Value, default_level: f64) -> Result<Self> {
        let table = match value {
            Value::String(text) => return Self::parse(text, default_level),
            Value::Object(table) => table,
            other => {
                return Err(Error::new(format!(
                    "{other} is no perturbation; write \"name@level\" or {{ name = ..., level = ... }}"
                )));
            }
        };
        let mut parameters = table.clone();
        let name = match parameters.shift_remove("name") {
            Some(Value::String(name)) if !name.is_empty() => name,
            _ => return Err(Error::new(format!("the perturbation {value} has no `name`"))),
        };
        let mut take = |key: &str| parameters.shift_remove(key).filter(|value| !value.is_null());
        let level = match take("level") {
            None => Level::Constant(default_level),
            Some(level) => Level::from_json(&name, &level)?,
        };
        let probability = match take("probability") {
            None => None,
            Some(value) => match value.as_f64() {
                Some(chance) if (0.0..=1.0).contains(&chance) => Some(chance),
                _ => {
                    return Err(Error::new(format!(
                        "the probability of `{name}` is {value}, but has to be a number from 0 to 1"
                    )));
                }
            },
        };
        let region = take("region")
            .map(|region| Region::from_json(&region))
            .transpose()
            .map_err(|error| error.at(format_args!("perturbation `{name}`")))?;
        let draws = take("draws")
            .map(|value| {
                serde_json::from_value(value.clone()).map_err(|_| {
                    Error::new(format!(
                        "`draws` of `{name}` is {value}, but has to be \"per_frame\" or \"per_sequence\""
                    ))
                })
            })
            .transpose()?;
        Ok(Self { name, level, probability, region, draws, parameters })
    }

    /// What it is without its level, as it is written on the command line: `NAME,key=value,...`. It tells two of the same
    /// name with other parameters apart.
    pub fn label(&self) -> String {
        format!("{}{}", self.name, self.conditions())
    }

    /// What stands behind the name and the level, each part with a comma before it.
    fn conditions(&self) -> String {
        let probability = self.probability.map(|probability| format!(",probability={probability}"));
        let region = self.region.as_ref().map(|region| format!(",region={}", json(region)));
        let draws = self.draws.as_ref().map(|draws| format!(",draws={}", json(draws)));
        let parameters = self.parameters.iter().map(|(key, value)| format!(",{key}={value}"));
        [probability, region, draws].into_iter().flatten().chain(parameters).collect()
    }
}

/// Splits at commas, except within brackets, braces and quotes, so that values may be JSON.
fn split_outside_brackets(text: &str) -> Vec<&str> {
    let (mut parts, mut start, mut depth, mut quoted) = (Vec::new(), 0, 0u32, false);
    for (position, c) in text.char_indices() {
        match c {
            '"' => quoted = !quoted,
            '[' | '{' if !quoted => depth += 1,
            ']' | '}' if !quoted => depth = depth.saturating_sub(1),
            ',' if depth == 0 && !quoted => {
                parts.push(&text[start..position]);
                start = position + 1;
            }
            _ => {}
        }
    }
    parts.push(&text[start..]);
    parts
}

impl fmt::Display for Spec {
    /// As it is written on the command line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}@", self.name)?;
        match self.level.constant() {
            Some(level) => write!(f, "{level}")?,
            None => f.write_str(&json(&self.level))?,
        }
        f.write_str(&self.conditions())
    }
}

/// A value as it is written in JSON; what cannot be written is empty.
fn json(value: &impl Serialize) -> String {
    serde_json::to_string(value).unwrap_or_default()
}

/// A value from the command line: JSON where it is JSON, a number also as people write it, else a text.
pub fn parse_value(text: &str) -> Value {
    parse_json(text).unwrap_or_else(|| Value::String(text.to_owned()))
}

/// A value from the command line that is no plain text: JSON, or a number as people write it.
pub fn parse_json(text: &str) -> Option<Value> {
    serde_json::from_str(text).ok().or_else(|| number(text))
}

/// A number that JSON does not know as one: `.5`, `-.5`, `+2`, `3.`.
fn number(text: &str) -> Option<Value> {
    let unsigned = text.strip_prefix(['-', '+']).unwrap_or(text);
    let sign = if text.starts_with('-') { "-" } else { "" };
    let before = if unsigned.starts_with('.') { "0" } else { "" };
    let behind = if unsigned.ends_with('.') { "0" } else { "" };
    let digit = unsigned.starts_with(|c: char| c.is_ascii_digit() || c == '.') && unsigned != ".";
    let json = || serde_json::from_str(&format!("{sign}{before}{unsigned}{behind}")).ok();
    digit.then(json).flatten()
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
    level: Level,
    key: Key,
    probability: Option<f64>,
    /// What the probability is drawn from: not what the perturbation itself draws from.
    chance_key: Key,
    draws: Option<Draws>,
    mask: Option<Mask>,
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
            let key = |what: &str| {
                seed::key(run_seed, &format!("{what}/{}", spec.name), *instance_number, scenario)
            };
            stages.push(Stage {
                label: spec.to_string(),
                instance,
                names: description.parameters.iter().map(|p| p.name.clone()).collect(),
                description,
                config,
                values: Vec::new(),
                level: spec.level.clone(),
                key: key("perturbation"),
                probability: spec.probability,
                chance_key: key("probability"),
                draws: spec.draws,
                mask: spec.region.as_ref().map(Mask::new).transpose()?,
            });
            *instance_number += 1;
        }
        Ok(Self { stages, between: [FrameBuf::default(), FrameBuf::default()] })
    }

    /// Writes the perturbed `src` to `dst`; without perturbations it is a copy.
    ///
    /// # Errors
    /// Where a perturbation fails, with its name.
    pub fn apply(
        &mut self,
        src: Frame<'_>,
        mut dst: FrameMut<'_>,
        frame_index: u64,
        time: f64,
    ) -> Result<()> {
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
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, frame_index: u64, time: f64) -> Result<()> {
        let spared =
            self.probability.is_some_and(|chance| self.chance_key.frame(frame_index).unit() >= chance);
        let level = match self.level.at(time) {
            Some(level) if !spared => level,
            _ => {
                dst.copy_from(src);
                return Ok(());
            }
        };
        config::frame_values(&self.description, &self.config, level, &mut self.values);
        let key = match self.draws {
            Some(Draws::PerFrame) => seed::of_frame(&self.key, frame_index),
            _ => self.key,
        };
        let cx = Context::new(level, frame_index, time, &key).with_values(&self.names, &self.values);
        let cx = match self.draws {
            Some(Draws::PerSequence) => cx.with_stream(0),
            _ => cx,
        };
        // A plugin that leaves pixels out must not show what happened to lie there: that depends on the threads.
        dst.rows_mut().for_each(|row| row.fill(0));
        self.instance
            .apply(src, dst.reborrow(), &cx)
            .map_err(|error| error.at(format!("perturbation `{}`", self.label)))?;
        if let Some(mask) = &mut self.mask {
            mask.restore(src, dst);
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn reads_what_users_write() {
        assert_eq!(Spec::parse("fog@2.5", 0.0).unwrap(), Spec::new("fog", 2.5));
        assert_eq!(Spec::parse("fog", 2.0).unwrap().level, Level::Constant(2.0));
        let spec = Spec::parse("fog@1,mode=soft,size=3", 0.0).unwrap();
        assert_eq!(spec.parameters, *json!({"mode": "soft", "size": 3}).as_object().unwrap());
        let limited = r#"fog@1,probability=0.5,region={"box":[0.0,0.5,1.0,1.0]},draws="per_frame""#;
        assert_eq!(Spec::parse(limited, 0.0).unwrap().to_string(), limited);
        assert_eq!(spec.to_string(), "fog@1,mode=\"soft\",size=3");
        assert_eq!(spec.label(), "fog,mode=\"soft\",size=3");
    }

    #[test]
    fn numbers_are_read_as_people_write_them() {
        for (text, number) in [
            (".5", 0.5),
            ("-.5", -0.5),
            ("+2", 2.0),
            ("3.", 3.0),
            ("+.25", 0.25),
            ("1e-3", 0.001),
            ("-4", -4.0),
        ] {
            assert_eq!(parse_value(text).as_f64(), Some(number), "{text}");
        }
        for text in
            ["", ".", "-", "+", "-.", "..5", "5..", "+-1", "1.2.3", "007", "nan", "inf", "a.", ".a", "1,5"]
        {
            assert_eq!(parse_value(text), json!(text));
        }
        assert_eq!(Spec::parse("fog@.5,s=.1", 0.0).unwrap().to_string(), "fog@0.5,s=0.1");
    }

    #[test]
    fn what_names_nothing_is_said_to() {
        for text in ["", "@2", ",size=3"] {
            let error = Spec::parse(text, 0.0).unwrap_err().to_string();
            assert!(error.starts_with(&format!("`{text}` names no perturbation; write NAME")), "{error}");
        }
        assert!(
            Spec::from_json(&json!({"name": ""}), 0.0).unwrap_err().to_string().contains("has no `name`")
        );
    }

    #[test]
    fn refuses_levels_outside_the_scale() {
        for text in ["fog@9", "fog@-1", "fog@nan", "fog@x"] {
            let error = Spec::parse(text, 0.0).unwrap_err().to_string();
            assert!(error.ends_with("has to be a number from 0 to 4"), "{error}");
        }
        assert!(Spec::from_json(&json!({"name": "fog", "level": "high"}), 0.0).is_err());
        assert!(Spec::from_json(&json!(3), 0.0).is_err());
        let error = Spec::parse("fog@1,probability=2", 0.0).unwrap_err().to_string();
        assert_eq!(error, "the probability of `fog` is 2, but has to be a number from 0 to 1");
        for (text, twice) in
            [("fog@1,size=1,size=2", "size"), ("fog@1,level=2", "level"), ("fog,name=rain", "name")]
        {
            let error = Spec::parse(text, 0.0).unwrap_err().to_string();
            assert_eq!(error, format!("`{text}` sets `{twice}` twice; leave one out"));
        }
        assert!(Spec::parse("fog@1,draws=often", 0.0).unwrap_err().to_string().contains("per_sequence"));
    }
}
