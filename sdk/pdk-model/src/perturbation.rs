//! Perturbations as the user names them.

use std::fmt;

use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

use crate::attention::Attention;
use crate::component::{check_values, unfold, without_value};
use crate::error::{Error, Result};
use crate::level::{DEFAULT_LEVEL, Level};
use crate::region::Region;
use crate::selection::Selection;
use crate::text::{parse_value, split_outside_brackets};

/// A perturbation as the user names it: at an intensity, with parameters, and with what limits it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AppliedPerturbation {
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
    /// The pixels that are perturbed, by a saliency map; all of them where it is not set.
    #[serde(default, rename = "where", skip_serializing_if = "Option::is_none")]
    pub selection: Option<Selection>,
    /// The saliency maps that the perturbation itself follows; none where it is not set.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub attention: Option<Attention>,
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

impl AppliedPerturbation {
    /// A perturbation at a level.
    pub fn new(name: &str, level: f64) -> Self {
        let level = Level::Constant(level);
        Self {
            name: name.to_owned(),
            level,
            probability: None,
            region: None,
            selection: None,
            attention: None,
            draws: None,
            parameters: Map::new(),
        }
    }

    /// The same perturbation at another level.
    pub fn at_level(self, level: f64) -> Self {
        Self { level: Level::Constant(level), ..self }
    }

    /// Reads `NAME` or `NAME@LEVEL`, with parameters behind it: `NAME@LEVEL,key=value,...`. Without a level it is
    /// [`DEFAULT_LEVEL`].
    ///
    /// # Errors
    /// Where the level is not a number from 0 to 4, or a parameter has no value.
    pub fn parse(text: &str) -> Result<Self> {
        Self::from_table(&read_text(text)?)
    }

    /// Reads a perturbation from a script: a text as for [`AppliedPerturbation::parse`], or a table with `name`, `level`,
    /// `probability`, `region`, `where`, `attention`, `draws` and parameters, which may stand in a table `parameters` as they
    /// do in records.
    ///
    /// # Errors
    /// Where it is neither, or one of them is out of range or null.
    pub fn from_json(value: &Value) -> Result<Self> {
        Self::from_table(&read(value)?)
    }

    /// Reads a perturbation to which somebody else gives the levels, by [`AppliedPerturbation::at_level`].
    ///
    /// # Errors
    /// As [`AppliedPerturbation::from_json`], and where it has a level of its own.
    pub fn from_json_without_level(value: &Value) -> Result<Self> {
        let table = read(value)?;
        if table.contains_key("level") {
            return Err(Error::new(format!(
                "the perturbation {value} has a level of its own; leave it out, because each is evaluated at all `levels`"
            )));
        }
        Self::from_table(&table)
    }

    fn from_table(table: &Map<String, Value>) -> Result<Self> {
        let mut parameters = table.clone();
        let name = match parameters.shift_remove("name") {
            Some(Value::String(name)) if !name.is_empty() => name,
            _ => {
                let table = Value::Object(table.clone());
                return Err(Error::new(format!("the perturbation {table} has no `name`")));
            }
        };
        let mut take = |key: &str| match parameters.shift_remove(key) {
            Some(Value::Null) => Err(without_value(&name, key)),
            value => Ok(value),
        };
        let level = match take("level")? {
            None => Level::Constant(DEFAULT_LEVEL),
            Some(level) => Level::from_json(&name, &level)?,
        };
        let probability = match take("probability")? {
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
        let region = take("region")?
            .map(|region| Region::from_json(&region))
            .transpose()
            .map_err(|error| error.at(format_args!("perturbation `{name}`")))?;
        let selection = take("where")?
            .map(|selection| Selection::from_json(&selection))
            .transpose()
            .map_err(|error| error.at(format_args!("perturbation `{name}`")))?;
        let attention = take("attention")?
            .map(|attention| Attention::from_json(&attention))
            .transpose()
            .map_err(|error| error.at(format_args!("perturbation `{name}`")))?;
        let draws = take("draws")?
            .map(|value| {
                serde_json::from_value(value.clone()).map_err(|_| {
                    Error::new(format!(
                        "`draws` of `{name}` is {value}, but has to be \"per_frame\" or \"per_sequence\""
                    ))
                })
            })
            .transpose()?;
        unfold(&name, &mut parameters)?;
        check_values(&name, &parameters)?;
        Ok(Self { name, level, probability, region, selection, attention, draws, parameters })
    }

    /// What it is without its level, as it is written on the command line: `NAME,key=value,...`. It tells two of the same
    /// name with other parameters apart.
    pub fn label(&self) -> String {
        format!("{}{}", self.name, self.conditions())
    }

    /// What it is in the name of a scenario, for which a course of intensities has too many numbers.
    pub fn short_name(&self) -> String {
        match self.level.constant() {
            Some(_) => self.to_string(),
            None => format!("{} over time", self.label()),
        }
    }

    /// What stands behind the name and the level, each part with a comma before it.
    fn conditions(&self) -> String {
        let probability = self.probability.map(|probability| format!(",probability={probability}"));
        let region = self.region.as_ref().map(|region| format!(",region={}", json(region)));
        let selection = self.selection.as_ref().map(|selection| format!(",where={}", json(selection)));
        let attention = self.attention.as_ref().map(|attention| format!(",attention={}", json(attention)));
        let draws = self.draws.as_ref().map(|draws| format!(",draws={}", json(draws)));
        let parameters = self.parameters.iter().map(|(key, value)| format!(",{key}={value}"));
        [probability, region, selection, attention, draws].into_iter().flatten().chain(parameters).collect()
    }
}

impl fmt::Display for AppliedPerturbation {
    /// As it is written on the command line.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.level.constant() {
            Some(level) => write!(f, "{}@{level}", self.name)?,
            None => write!(f, "{},level={}", self.name, json(&self.level))?,
        }
        f.write_str(&self.conditions())
    }
}

/// The table that a text or a table stands for.
fn read(value: &Value) -> Result<Map<String, Value>> {
    match value {
        Value::String(text) => read_text(text),
        Value::Object(table) => Ok(table.clone()),
        other => Err(Error::new(format!(
            "{other} is not a perturbation; write \"name@level\" or {{ name = ..., level = ... }}"
        ))),
    }
}

/// The table that a text stands for.
fn read_text(text: &str) -> Result<Map<String, Value>> {
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
        let level = Level::from_json(head, &parse_value(level)?)?;
        table.insert("level".to_owned(), serde_json::to_value(level)?);
    }
    for part in parts {
        let (key, value) = part.split_once('=').ok_or_else(|| {
            Error::new(format!("`{part}` in `{text}` sets nothing; write parameters as name=value"))
        })?;
        if table.insert(key.to_owned(), parse_value(value)?).is_some() {
            return Err(Error::new(format!("`{text}` sets `{key}` twice; leave one out")));
        }
    }
    Ok(table)
}

/// A value as a user writes it in JSON; what cannot be written is empty.
fn json(value: &impl Serialize) -> String {
    serde_json::to_value(value).map(|value| as_written(value).to_string()).unwrap_or_default()
}

/// The same without what users leave out: the fraction of a whole number, and the tables around a component's parameters, and around its
/// name where it has none.
fn as_written(value: Value) -> Value {
    match value {
        Value::Number(number) => match number.as_f64() {
            // Every number up to 2^53 is whole exactly.
            Some(float) if number.is_f64() && float.fract() == 0.0 && float.abs() < 9e15 => {
                (float as i64).into()
            }
            _ => Value::Number(number),
        },
        Value::Array(values) => values.into_iter().map(as_written).collect(),
        Value::Object(mut table) => {
            if table.contains_key("name")
                && let Some(Value::Object(parameters)) = table.get("parameters").cloned()
            {
                table.shift_remove("parameters");
                table.extend(parameters);
            }
            match table.get("name") {
                Some(name @ Value::String(_)) if table.len() == 1 => name.clone(),
                _ => table.into_iter().map(|(key, value)| (key, as_written(value))).collect(),
            }
        }
        other => other,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    fn parse(text: &str) -> AppliedPerturbation {
        AppliedPerturbation::parse(text).unwrap()
    }

    fn error(text: &str) -> String {
        AppliedPerturbation::parse(text).unwrap_err().to_string()
    }

    #[test]
    fn reads_what_users_write() {
        assert_eq!(parse("fog@2.5"), AppliedPerturbation::new("fog", 2.5));
        let spec = parse("fog@1,mode=soft,size=3");
        assert_eq!(spec.parameters, *json!({"mode": "soft", "size": 3}).as_object().unwrap());
        let limited = r#"fog@1,probability=0.5,region={"box":[0,0.5,1,1]},draws="per_frame""#;
        assert_eq!(parse(limited).to_string(), limited);
        assert_eq!(spec.to_string(), "fog@1,mode=\"soft\",size=3");
        assert_eq!(spec.label(), "fog,mode=\"soft\",size=3");
        assert_eq!(parse("fog@.5,s=.1").to_string(), "fog@0.5,s=0.1");
    }

    #[test]
    fn a_level_left_out_is_the_middle_of_the_scale_wherever_it_is_left_out() {
        assert_eq!(DEFAULT_LEVEL, 2.0);
        let default = AppliedPerturbation::new("fog", DEFAULT_LEVEL);
        assert_eq!(parse("fog"), default);
        for value in [json!("fog"), json!({"name": "fog"})] {
            assert_eq!(AppliedPerturbation::from_json(&value).unwrap(), default);
            assert_eq!(AppliedPerturbation::from_json_without_level(&value).unwrap(), default);
        }
    }

    #[test]
    fn levels_may_be_given_by_somebody_else() {
        let without = AppliedPerturbation::from_json_without_level(&json!("fog,size=3")).unwrap();
        assert_eq!(without.at_level(4.0), parse("fog@4,size=3"));
        for value in [json!("fog@2"), json!("fog,level=2"), json!({"name": "fog", "level": 2})] {
            let error = AppliedPerturbation::from_json_without_level(&value).unwrap_err().to_string();
            assert!(
                error.starts_with(&format!("the perturbation {value} has a level of its own; leave it out")),
                "{error}"
            );
        }
    }

    #[test]
    fn what_a_record_holds_is_read_back() {
        for text in [
            "fog@2.5,size=3",
            r#"fog,level={"ramp":{"from":0,"to":4,"start":0,"end":2}},size=3,mode="soft""#,
            r#"fog@1,probability=0.5,region={"box":[0,0.5,1,1]},draws="per_frame""#,
            r#"fog@1,where={"mask":{"name":"road_mask","size":3}}"#,
            r#"fog@1,where={"top":20,"by":{"name":"hirescam","model":"a.onnx"},"every":5},size=3"#,
            r#"fog@1,attention={"by":{"name":"hirescam","model":"a.onnx"}}"#,
        ] {
            let applied = parse(text);
            let recorded = serde_json::to_value(&applied).unwrap();
            assert_eq!(AppliedPerturbation::from_json(&recorded).unwrap(), applied, "{recorded}");
        }
        let both = json!({"name": "fog", "size": 3, "parameters": {"size": 4}});
        let error = AppliedPerturbation::from_json(&both).unwrap_err().to_string();
        assert_eq!(error, "`size` of `fog` is set twice, beside the name and in `parameters`; leave one out");
    }

    #[test]
    fn what_is_shown_is_read_back() {
        for text in [
            "fog@2.5,size=3",
            r#"fog,level={"ramp":{"from":0,"to":4,"start":0,"end":2}},size=3"#,
            r#"fog,level={"frames":{"rate":20,"levels":[[0,3],1.5]}},probability=0.5"#,
            r#"fog@1,where={"mask":"road_mask"}"#,
            r#"fog@1,where={"mask":{"name":"road_mask","size":3}}"#,
            r#"fog@1,where={"farther":30}"#,
        ] {
            assert_eq!(parse(text).to_string(), text);
        }
        assert_eq!(parse("fog@1,s=2").short_name(), "fog@1,s=2");
        assert_eq!(parse(r#"fog,level={"points":[[0,1]]},s=2"#).short_name(), "fog,s=2 over time");
    }

    #[test]
    fn what_names_nothing_is_said_to() {
        for text in ["", "@2", ",size=3"] {
            let error = error(text);
            assert!(error.starts_with(&format!("`{text}` names no perturbation; write NAME")), "{error}");
        }
        let nameless = AppliedPerturbation::from_json(&json!({"name": ""})).unwrap_err().to_string();
        assert!(nameless.contains("has no `name`"), "{nameless}");
    }

    #[test]
    fn refuses_levels_outside_the_scale() {
        for text in ["fog@9", "fog@-1", "fog@nan", "fog@x", "fog@null"] {
            let error = error(text);
            assert!(error.ends_with("has to be a number from 0 to 4"), "{error}");
        }
        assert!(AppliedPerturbation::from_json(&json!({"name": "fog", "level": "high"})).is_err());
        assert!(AppliedPerturbation::from_json(&json!(3)).is_err());
        assert_eq!(
            error("fog@1,probability=2"),
            "the probability of `fog` is 2, but has to be a number from 0 to 1"
        );
        for (text, twice) in
            [("fog@1,size=1,size=2", "size"), ("fog@1,level=2", "level"), ("fog,name=rain", "name")]
        {
            assert_eq!(error(text), format!("`{text}` sets `{twice}` twice; leave one out"));
        }
        assert!(error("fog@1,draws=often").contains("per_sequence"));
    }

    #[test]
    fn null_is_refused_by_name_whatever_it_is_set_for() {
        for key in ["level", "probability", "region", "draws", "size"] {
            let mut value = json!({"name": "fog"});
            value[key] = json!(f64::NAN);
            let error = AppliedPerturbation::from_json(&value).unwrap_err().to_string();
            assert!(error.starts_with(&format!("`{key}` of `fog` is null")), "{error}");
        }
    }
}
