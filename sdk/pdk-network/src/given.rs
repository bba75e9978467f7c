//! The values of a description's fields as they were given, and the place that each comes from.
//!
//! What is given nearest to the user wins: a parameter before the file beside the model, and both before a preset.

use std::path::{Path, PathBuf};

use pdk_sdk::config::Config;
use pdk_sdk::error::{Error, ErrorKind, Result};
use pdk_sdk::file;
use pdk_sdk::serde_json::{self, Map, Value};
use toml_edit::{Document, Item, Table};

use crate::field::{AUTO, FIELDS, Kind};
use crate::preset;
use crate::suggest::hint;

/// The endings of a description's file, which has the name of the model's.
pub const ENDINGS: [&str; 2] = ["toml", "json"];

/// Bytes of a description: far more than one with constants for every input has.
const LARGEST: u64 = 1 << 20;

/// Values of fields with their places.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Given {
    /// Name, value and place of each field that was given.
    values: Vec<(String, Value, String)>,
    /// The file, if there is one.
    pub file: Option<PathBuf>,
}

impl Given {
    /// What a component was given: its parameters, and the file beside the model.
    ///
    /// # Errors
    /// If the file cannot be read, or has other fields.
    pub fn of(config: &Config, model: Option<&Path>) -> Result<Self> {
        let mut given = match model {
            Some(model) => Self::beside(model)?,
            None => Self::default(),
        };
        for field in FIELDS {
            let value = config.value(field.name);
            if !value.is_null() && value.as_str() != Some(AUTO) {
                given.set(field.name, value.clone(), "the parameters");
            }
        }
        Ok(given)
    }

    /// What the file beside a model says; nothing if there is none.
    ///
    /// # Errors
    /// If it cannot be read, has other fields, or if there are two such files.
    pub fn beside(model: &Path) -> Result<Self> {
        let candidates = ENDINGS.map(|ending| model.with_extension(ending));
        let there: Vec<&PathBuf> = candidates.iter().filter(|path| path.is_file()).collect();
        match there.as_slice() {
            [] => Ok(Self::default()),
            [path] => Self::read(path),
            [first, second, ..] => Err(Error::of(
                ErrorKind::Configuration,
                format!("{} and {} both describe it; remove one of them", first.display(), second.display()),
            )),
        }
    }

    /// What a file says, in TOML or, if its name ends so, in JSON.
    ///
    /// # Errors
    /// If it cannot be read, or has other fields.
    pub fn read(path: &Path) -> Result<Self> {
        let place = path.display().to_string();
        let text = file::read_text(path, LARGEST).map_err(|error| error.at(&place))?;
        let is_json = path.extension().is_some_and(|ending| ending == "json");
        let values = if is_json { from_json(&text, &place)? } else { from_toml(&text, &place)? };
        let mut given = Self { file: Some(path.to_owned()), ..Self::default() };
        for (name, value, place) in values {
            if !FIELDS.iter().any(|field| field.name == name) {
                let known = FIELDS.map(|field| field.name);
                return Err(mistake(format!("{place}: there is no field `{name}`; {}", hint(&name, known))));
            }
            given.set(&name, value, &place);
        }
        Ok(given)
    }

    /// Sets a field, over what it was.
    pub fn set(&mut self, name: &str, value: Value, place: &str) {
        self.values.retain(|(known, ..)| known != name);
        self.values.push((name.to_owned(), value, place.to_owned()));
    }

    /// Adds the fields of the preset that is named.
    ///
    /// # Errors
    /// If there is none of this name.
    pub fn with_preset(mut self) -> Result<Self> {
        let Some((value, place)) = self.get("preset").map(|(value, place)| (value.clone(), place.to_owned()))
        else {
            return Ok(self);
        };
        let name = value.as_str().unwrap_or_default();
        let Some(text) = preset::text(name) else {
            return Err(mistake(format!("{place}: `preset` is {value}; {}", hint(name, preset::NAMES))));
        };
        for (name, value, _) in from_toml(text, "a preset")? {
            if self.get(&name).is_none() {
                let place = format!("preset `{}`", self.text("preset"));
                self.values.push((name, value, place));
            }
        }
        Ok(self)
    }

    /// A field's value and place; none if it was not given.
    pub fn get(&self, name: &str) -> Option<(&Value, &str)> {
        self.values.iter().find(|(known, ..)| known == name).map(|(_, value, place)| (value, place.as_str()))
    }

    /// The text of a field; empty if it is not one.
    fn text(&self, name: &str) -> &str {
        self.get(name).and_then(|(value, _)| value.as_str()).unwrap_or_default()
    }

    /// One of a field's names; none if it was not given.
    ///
    /// # Errors
    /// If it is another one.
    pub fn choice(&self, name: &str) -> Result<Option<&'static str>> {
        let Some((value, _)) = self.get(name) else { return Ok(None) };
        let options = FIELDS.iter().find(|field| field.name == name).map(|field| field.kind);
        let Some(Kind::Choice(options)) = options else { return Ok(None) };
        let text = value.as_str().unwrap_or_default();
        match options.iter().find(|option| **option == text) {
            Some(option) => Ok(Some(option)),
            None => {
                Err(self.wrong(name, format_args!("is {value}; {}", hint(text, options.iter().copied()))))
            }
        }
    }

    /// The error about a field, with the place where it was given.
    pub fn wrong(&self, name: &str, what: impl std::fmt::Display) -> Error {
        match self.get(name) {
            Some((_, place)) => mistake(format!("{place}: `{name}` {what}")),
            None => mistake(format!("`{name}` {what}")),
        }
    }

    /// All values, without their places: what outcomes depend on.
    pub fn values(&self) -> Map<String, Value> {
        let mut values: Vec<_> =
            self.values.iter().map(|(name, value, _)| (name.clone(), value.clone())).collect();
        values.sort_by(|a, b| a.0.cmp(&b.0));
        values.into_iter().collect()
    }

    /// Whether nothing was given.
    pub fn is_empty(&self) -> bool {
        self.values.is_empty()
    }
}

/// Something that only the user can correct.
pub(crate) fn mistake(sentence: String) -> Error {
    Error::of(ErrorKind::Configuration, sentence)
}

fn from_json(text: &str, place: &str) -> Result<Vec<(String, Value, String)>> {
    match serde_json::from_str(text) {
        Ok(Value::Object(table)) => {
            Ok(table.into_iter().map(|(name, value)| (name, value, place.to_owned())).collect())
        }
        Ok(_) => Err(mistake(format!("{place}: it is not a table; write {{ \"color\": \"rgb\" }}"))),
        Err(error) => Err(mistake(format!("{place}: it is not JSON ({error}); correct it"))),
    }
}

/// The fields of a text in TOML, each with its line.
fn from_toml(text: &str, place: &str) -> Result<Vec<(String, Value, String)>> {
    let line = |at: usize| text[..at.min(text.len())].matches('\n').count() + 1;
    let document = Document::parse(text).map_err(|error| {
        let at = error.span().map_or(0, |span| span.start);
        let reason = error.message().lines().next().unwrap_or_default();
        mistake(format!("{place} line {}: it is not TOML ({reason}); correct it", line(at)))
    })?;
    let table: &Table = document.as_table();
    let mut values = Vec::new();
    for (name, item) in table.iter() {
        let span = table.key(name).and_then(|key| key.span()).or_else(|| item.span());
        let place = format!("{place} line {}", line(span.map_or(0, |span| span.start)));
        let value = value_of(item).ok_or_else(|| {
            mistake(format!("{place}: `{name}` has a value that a description cannot have; write a number, a text, a list or a table"))
        })?;
        values.push((name.to_owned(), value, place));
    }
    Ok(values)
}

/// A value of TOML as JSON; none for a date.
fn value_of(item: &Item) -> Option<Value> {
    if let Some(table) = item.as_table_like() {
        return table
            .iter()
            .map(|(name, item)| Some((name.to_owned(), value_of(item)?)))
            .collect::<Option<Map<_, _>>>()
            .map(Value::Object);
    }
    match item.as_value()? {
        toml_edit::Value::String(text) => Some(text.value().as_str().into()),
        toml_edit::Value::Integer(number) => Some((*number.value()).into()),
        toml_edit::Value::Float(number) => serde_json::Number::from_f64(*number.value()).map(Value::Number),
        toml_edit::Value::Boolean(set) => Some((*set.value()).into()),
        toml_edit::Value::Array(list) => list
            .iter()
            .map(|value| value_of(&Item::Value(value.clone())))
            .collect::<Option<_>>()
            .map(Value::Array),
        toml_edit::Value::InlineTable(_) | toml_edit::Value::Datetime(_) => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use pdk_sdk::serde_json::json;

    fn read(ending: &str, text: &str) -> Result<Given> {
        let name = format!("pdk-network-{}-{:?}.{ending}", std::process::id(), std::thread::current().id());
        let path = std::env::temp_dir().join(name);
        std::fs::write(&path, text).unwrap();
        let given = Given::read(&path);
        std::fs::remove_file(&path).unwrap();
        given
    }

    #[test]
    fn toml_and_json_say_the_same() {
        let toml = "mean = [0.5, 1]\ncolor = \"yuv\"\n[state]\nh_in = \"h_out\"\n[throttle]\noutput = 'a'\nbins = { from = 0.0, to = 1, count = 3 }\n";
        let json = r#"{"mean": [0.5, 1], "color": "yuv", "state": {"h_in": "h_out"}, "throttle": {"output": "a", "bins": {"from": 0.0, "to": 1, "count": 3}}}"#;
        let (toml, json) = (read("toml", toml).unwrap(), read("json", json).unwrap());
        assert_eq!(toml.values(), json.values());
        assert_eq!(toml.get("mean").unwrap().0, &json!([0.5, 1]));
        assert!(toml.get("color").unwrap().1.ends_with(".toml line 2"));
        assert!(toml.get("state").unwrap().1.ends_with(".toml line 3"));
    }

    #[test]
    fn errors_name_the_file_its_line_and_what_was_meant() {
        let error = |ending, text| read(ending, text).unwrap_err().to_string();
        let unknown = error("toml", "color = \"rgb\"\nmaen = 3\n");
        assert!(
            unknown.contains(".toml line 2: there is no field `maen`; did you mean `mean`?"),
            "{unknown}"
        );
        let broken = error("toml", "color = \"rgb\"\nmean = = 3\n");
        assert!(broken.contains(".toml line 2: it is not TOML ("), "{broken}");
        assert!(error("json", "[1]").contains("it is not a table"));
        assert!(error("json", "{").contains("it is not JSON ("));
        assert!(error("toml", "mean = 2020-01-01\n").contains("`mean` has a value that"));
        let wrong = read("toml", "color = \"rgbb\"\n").unwrap().choice("color").unwrap_err().to_string();
        assert!(wrong.contains("line 1: `color` is \"rgbb\"; did you mean `rgb`?"), "{wrong}");
    }

    #[test]
    fn fields_override_those_of_a_preset() {
        let given =
            read("toml", "preset = \"udacity\"\nresize = \"bilinear\"\n").unwrap().with_preset().unwrap();
        assert_eq!(given.choice("resize").unwrap(), Some("bilinear"));
        assert_eq!(given.get("color").unwrap(), (&json!("yuv"), "preset `udacity`"));
        let error = read("toml", "preset = \"udacty\"\n").unwrap().with_preset().unwrap_err().to_string();
        assert!(error.contains("line 1: `preset` is \"udacty\"; did you mean `udacity`?"), "{error}");
    }
}
