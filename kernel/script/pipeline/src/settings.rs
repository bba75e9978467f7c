//! The settings of a pipeline: the defaults that it declares, and what `--set KEY=VALUE` puts in their place.

use std::collections::BTreeSet;
use std::ffi::OsStr;

use pdk_model::text::{parse_json, parse_value};
use pdk_sdk::error::{Error, Result};
use pdk_sdk::suggest;
use serde_json::{Map, Value};

use crate::run_settings::{RUN_SETTINGS, RunSettings, Setting};

/// One `--set KEY=VALUE`.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Override {
    /// The setting; dots lead into tables.
    pub key: String,
    /// The value as it was written.
    pub value: String,
}

impl std::str::FromStr for Override {
    type Err = Error;

    fn from_str(text: &str) -> Result<Self> {
        match text.split_once('=') {
            Some((key, value)) if !key.trim().is_empty() => {
                Ok(Self { key: key.trim().to_owned(), value: value.to_owned() })
            }
            _ => Err(Error::new(format!("`{text}` sets nothing; write KEY=VALUE"))),
        }
    }
}

/// Refuses what sets the same twice, or a table after something in it: one of the values would be dropped without a word.
///
/// # Errors
/// Names the first that is there twice, or that comes too late.
pub fn refuse_repeated(overrides: &[Override]) -> Result<()> {
    let mut seen = BTreeSet::new();
    for Override { key, .. } in overrides {
        let is_within =
            |earlier: &&&str| earlier.strip_prefix(key.as_str()).is_some_and(|rest| rest.starts_with('.'));
        if let Some(earlier) = seen.iter().find(is_within) {
            return Err(Error::new(format!(
                "--set {key} would undo --set {earlier}, which comes before it; give --set {key} first"
            )));
        }
        if !seen.insert(key.as_str()) {
            return Err(Error::new(format!("--set {key} is given more than once; give it once")));
        }
    }
    Ok(())
}

/// Parts what `--set` says about the settings that every run has from what it says about the pipeline's own.
///
/// # Errors
/// If a setting of every run cannot have its value, or a setting is set twice.
pub fn split(overrides: Vec<Override>) -> Result<(RunSettings, PipelineSettings)> {
    refuse_repeated(&overrides)?;
    let (mut common, mut own) = (RunSettings::default(), PipelineSettings::default());
    for Override { key, value } in overrides {
        match RUN_SETTINGS.iter().find(|setting| setting.name == key) {
            Some(setting) => common
                .set(setting, OsStr::new(&value))
                .map_err(|error| error.at(format_args!("--set {key}")))?,
            None => own.overrides.push(Override { key, value }),
        }
    }
    Ok((common, own))
}

/// The settings of a pipeline.
#[derive(Debug, Clone, Default)]
pub struct PipelineSettings {
    /// What the command line sets, in order.
    overrides: Vec<Override>,
    /// All of them, once the pipeline has declared them.
    declared: Option<Value>,
}

impl PipelineSettings {
    /// What `pdk.settings` returns: the defaults with the overrides in their place. `recorded` says whether the record has begun, which
    /// holds them.
    ///
    /// # Errors
    /// If settings were declared before, or too late, or one is the name of a setting that every run has, or an override does not fit.
    pub(crate) fn declare(&mut self, defaults: Value, recorded: bool) -> Result<Value> {
        if self.declared.is_some() {
            return Err(Error::new("pdk.settings may be called once; put all settings into one table"));
        }
        let set = RUN_SETTINGS.iter().find(|setting| defaults.get(setting.name).is_some());
        if let Some(Setting { name, meaning, .. }) = set {
            return Err(Error::new(format!(
                "`{name}` is a setting that every pipeline has ({meaning}); leave it out of pdk.settings"
            )));
        }
        if recorded {
            return Err(Error::new(
                "pdk.settings has to come before the first pdk.drive or pdk.evaluate, because the record begins there",
            ));
        }
        Ok(self.declared.insert(apply(defaults, &self.overrides)?).clone())
    }

    /// All of them, once the pipeline has declared them.
    pub(crate) fn declared(&self) -> Option<&Value> {
        self.declared.as_ref()
    }

    /// Refuses overrides of a pipeline that has declared no settings.
    ///
    /// # Errors
    /// Says that the setting does not exist.
    pub(crate) fn check(&self) -> Result<()> {
        match self.declared {
            Some(_) => Ok(()),
            None => apply(Value::Object(Map::new()), &self.overrides).map(drop),
        }
    }
}

/// Puts the overrides in the place of the defaults.
///
/// # Errors
/// If a setting does not exist, or the value has another type than the default.
pub fn apply(defaults: Value, overrides: &[Override]) -> Result<Value> {
    let mut settings = match defaults {
        Value::Object(settings) => settings,
        // An empty Lua table.
        Value::Array(list) if list.is_empty() => Map::new(),
        other => return Err(Error::new(format!("pdk.settings takes a table of defaults, not {other}"))),
    };
    // An empty Lua table takes any names: who gets it knows them.
    let is_open = |value: &Value| value.as_array().is_some_and(Vec::is_empty);
    let open: BTreeSet<String> =
        settings.iter().filter(|(_, value)| is_open(value)).map(|(name, _)| name.clone()).collect();
    for Override { key, value } in overrides {
        if let Some((name, field)) =
            key.split_once('.').filter(|(name, field)| open.contains(*name) && !field.contains('.'))
        {
            if is_open(&settings[name]) {
                settings[name] = Value::Object(Map::new());
            }
            // Set to a list meanwhile, it has no fields.
            if let Some(table) = settings[name].as_object_mut() {
                let value = parse_value(value).map_err(|error| error.at(format_args!("--set {key}")))?;
                table.insert(field.to_owned(), value);
                continue;
            }
        }
        set(&mut settings, key, key, value)?;
    }
    Ok(Value::Object(settings))
}

fn set(table: &mut Map<String, Value>, key: &str, rest: &str, text: &str) -> Result<()> {
    let (name, deeper) = match rest.split_once('.') {
        Some((name, deeper)) => (name, Some(deeper)),
        None => (rest, None),
    };
    let known: Vec<String> = table.keys().cloned().collect();
    let value = |text| parse_value(text).map_err(|error| error.at(format_args!("--set {key}")));
    // A table with a name is a component; it knows itself which parameters it has.
    if key != rest && deeper.is_none() && table.contains_key("name") && !table.contains_key(name) {
        table.insert(name.to_owned(), value(text)?);
        return Ok(());
    }
    let Some(current) = table.get_mut(name) else {
        let known = known.iter().map(String::as_str).chain(RUN_SETTINGS.iter().map(|setting| setting.name));
        return Err(Error::new(format!(
            "--set {key}: the pipeline has no setting `{name}`; {}",
            suggest::hint(name, known)
        )));
    };
    match (deeper, &mut *current) {
        (Some(deeper), Value::Object(table)) => set(table, key, deeper, text),
        // A component that is given by name gets its first parameter.
        (Some(deeper), Value::String(component)) if !deeper.contains('.') => {
            let parameter = (deeper.to_owned(), value(text)?);
            let component = Value::String(std::mem::take(component));
            *current = Value::Object(Map::from_iter([("name".to_owned(), component), parameter]));
            Ok(())
        }
        (Some(deeper), _) => {
            Err(Error::new(format!("--set {key}: `{name}` is not a table, so it has no `{deeper}`")))
        }
        (None, _) => {
            *current = parse(current, text).map_err(|error| error.at(format_args!("--set {key}")))?;
            Ok(())
        }
    }
}

/// Reads a value of the type that the default has.
fn parse(default: &Value, text: &str) -> Result<Value> {
    let wrong = |expected: &str| Err(Error::new(format!("`{text}` is not {expected}")));
    let json = parse_json(text)?;
    match (default, json) {
        (Value::Number(_), Some(Value::Number(number))) => Ok(Value::Number(number)),
        (Value::Number(_), _) => wrong("a number"),
        (Value::Bool(_), Some(Value::Bool(set))) => Ok(Value::Bool(set)),
        (Value::Bool(_), _) => wrong("true or false"),
        // A component that is given by name can be replaced by one with parameters.
        (Value::String(_), Some(Value::Object(table))) if table.contains_key("name") => {
            Ok(Value::Object(table))
        }
        (Value::String(_), _) => Ok(Value::String(text.to_owned())),
        (Value::Array(_), Some(Value::Array(list))) => Ok(Value::Array(list)),
        // An empty Lua table, which may be meant as either.
        (Value::Array(list), Some(Value::Object(table))) if list.is_empty() => Ok(Value::Object(table)),
        (Value::Array(_), _) if text.trim_start().starts_with(['{', '[']) => {
            wrong("a list; write it as JSON, or its entries with commas between them")
        }
        (Value::Array(list), _) => {
            let like = list.first().cloned().unwrap_or(Value::Null);
            let parts = text.split(',').map(str::trim).filter(|part| !part.is_empty());
            parts.map(|part| parse(&like, part)).collect::<Result<Vec<_>>>().map(Value::Array)
        }
        (Value::Object(_), Some(Value::Object(table))) => Ok(Value::Object(table)),
        // A table with a name, such as a driver with parameters, can be replaced by the name alone.
        (Value::Object(table), None) if table.contains_key("name") => Ok(Value::String(text.to_owned())),
        (Value::Object(_), _) => wrong("a table; write it as JSON, or set its fields one by one with a dot"),
        (Value::Null, json) => Ok(json.unwrap_or_else(|| Value::String(text.to_owned()))),
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::*;
    use serde_json::json;

    fn defaults() -> Value {
        json!({
            "model": "pilot.onnx", "frames": 10, "loud": false, "levels": [0, 1], "names": ["a"],
            "simulator": { "name": "lane", "width": 320 }, "extra": [],
        })
    }

    fn with(text: &str) -> Result<Value> {
        apply(defaults(), &[text.parse()?])
    }

    #[test]
    fn values_take_the_type_of_their_default() {
        assert_eq!(with("model=7").unwrap()["model"], "7");
        assert_eq!(with("frames=7").unwrap()["frames"], 7);
        assert_eq!(with("frames=.5").unwrap()["frames"], 0.5);
        assert_eq!(with("model=.5").unwrap()["model"], ".5");
        assert_eq!(with("loud=true").unwrap()["loud"], true);
        assert_eq!(with("levels=2,3.5").unwrap()["levels"], json!([2, 3.5]));
        assert_eq!(with("names=x,y").unwrap()["names"], json!(["x", "y"]));
        assert_eq!(with("simulator.width=64").unwrap()["simulator"]["width"], 64);
        assert_eq!(with(r#"model={"name":"x","y":1}"#).unwrap()["model"], json!({"name": "x", "y": 1}));
        assert_eq!(with(r#"model={"y":1}"#).unwrap()["model"], r#"{"y":1}"#);
        assert_eq!(
            with("simulator.rate=20").unwrap()["simulator"],
            json!({"name": "lane", "width": 320, "rate": 20})
        );
        assert_eq!(with(r#"extra={"a":1,"b":2}"#).unwrap()["extra"], json!({"a": 1, "b": 2}));
        assert_eq!(with(r#"extra=["a",2]"#).unwrap()["extra"], json!(["a", 2]));
        assert_eq!(with("extra=a,2").unwrap()["extra"], json!(["a", 2]));
        assert_eq!(with("simulator=donkey").unwrap()["simulator"], "donkey");
        let both = ["simulator=donkey", "simulator.port=9091"].map(|text| text.parse().unwrap());
        assert_eq!(apply(defaults(), &both).unwrap()["simulator"], json!({"name": "donkey", "port": 9091}));
    }

    #[test]
    fn what_a_value_sets_twice_is_refused() {
        for text in
            [r#"simulator={"name":"x","name":"y"}"#, r#"model={"a":1,"a":2}"#, r#"simulator.x={"a":1,"a":2}"#]
        {
            let error = with(text).unwrap_err().to_string();
            assert!(
                error.starts_with("--set ") && error.contains("` occurs twice; write it once"),
                "{error}"
            );
        }
    }

    #[test]
    fn an_empty_table_takes_fields_one_by_one() {
        let set = |texts: &[&str]| {
            let overrides: Vec<Override> = texts.iter().map(|text| text.parse().unwrap()).collect();
            apply(json!({"failure": [], "levels": [1]}), &overrides)
        };
        let both = set(&["failure.lane_departure=4", "failure.comparison=more_than"]).unwrap();
        assert_eq!(both["failure"], json!({"lane_departure": 4, "comparison": "more_than"}));
        assert_eq!(
            set(&[r#"failure={"over_line":1}"#, "failure.lane_departure=3"]).unwrap()["failure"]["over_line"],
            1
        );
        assert!(set(&["failure=1,2", "failure.x=3"]).unwrap_err().to_string().contains("is not a table"));
        assert!(set(&["levels.x=3"]).unwrap_err().to_string().contains("is not a table"));
    }

    #[test]
    fn mistakes_are_named() {
        let error = |text: &str| with(text).unwrap_err().to_string();
        assert_eq!(
            error("modle=x"),
            "--set modle: the pipeline has no setting `modle`; did you mean `model`?"
        );
        assert_eq!(error("frames=many"), "--set frames: `many` is not a number");
        assert_eq!(error("frames.x=1"), "--set frames.x: `frames` is not a table, so it has no `x`");
        assert_eq!(error("nothing"), "`nothing` sets nothing; write KEY=VALUE");
        for text in [r#"extra={"a":1,"b""#, "extra=[1,2", r#"names={"a":1}"#, "levels=[1,"] {
            assert!(error(text).contains(" is not a list; write it as JSON"), "{}", error(text));
        }
        assert!(error("levels=a").contains("`a` is not a number"));
    }

    fn read(texts: &[&str]) -> Result<(RunSettings, PipelineSettings)> {
        split(texts.iter().map(|text| text.parse().unwrap()).collect())
    }

    #[test]
    fn settings_of_every_run_are_taken_out() {
        let (settings, others) =
            read(&["seed=9007199254740991", "a=1", "workers=3", "memory=100", "pool=", "engine=x"]).unwrap();
        assert_eq!(
            (settings.seed, settings.workers, settings.limits().memory, &settings.pool),
            ((1 << 53) - 1, Some(3), 100, &None)
        );
        assert_eq!(settings.wanted(), BTreeMap::from([("engine", "x")]));
        assert_eq!(others.overrides, ["a=1".parse().unwrap()]);
        for (text, said) in [
            ("workers=10000", "--set workers: `10000` is not a whole number from 1 to 1024"),
            ("workers=0", "is not a whole number from 1"),
            ("seed=-1", "--set seed: `-1` is not a seed: seeds are whole numbers from 0 to 9007199254740991"),
            ("seed=9007199254740992", "--set seed: `9007199254740992` is not a seed"),
            ("patience=nan", "is not a positive number of seconds"),
            ("memory=0", "is not a positive number of MiB"),
            ("keep_errors=1", "--set keep_errors: `1` is not true or false"),
        ] {
            let error = read(&[text]).unwrap_err().to_string();
            assert!(error.contains(said), "{error}");
        }
    }

    #[test]
    fn what_is_set_twice_is_refused() {
        let error = read(&["frames=7", "model=x", "frames=8"]).unwrap_err().to_string();
        assert_eq!(error, "--set frames is given more than once; give it once");
        assert!(read(&["seed=1", "seed=1"]).is_err());
        assert!(read(&["simulator=donkey", "simulator.port=9091"]).is_ok());
        let error =
            read(&["simulator.port=9091", "simulators=x", "simulator=donkey"]).unwrap_err().to_string();
        assert_eq!(
            error,
            "--set simulator would undo --set simulator.port, which comes before it; give --set simulator first"
        );
    }
}
