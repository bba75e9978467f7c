//! What components there are and where they come from, as plain data: it can be sent from the process that has loaded them to
//! one that has not.

use std::path::{Path, PathBuf};

use pdk_model::component::ComponentSpec;
use pdk_sdk::config::Config;
use pdk_sdk::describe::{Description, Kind, ParameterType};
use pdk_sdk::error::{Error, ErrorKind, Result};
use serde::de::Error as _;
use serde::{Deserialize, Deserializer, Serialize};
use serde_json::{Map, Value};

use crate::hash;
use crate::reading;
use pdk_sdk::level_scales::Measured;
use pdk_sdk::suggest;

/// Stands before the name of a script that is part of pdk, in the place of a path.
pub const BUILT_IN: &str = "built-in:";

/// The components that were found, in order of kind and name.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
#[serde(transparent)]
pub struct Catalog {
    #[serde(deserialize_with = "as_far_as_known")]
    entries: Vec<Entry>,
}

/// Entries of another pdk, without components of a kind that is not known here.
fn as_far_as_known<'de, D: Deserializer<'de>>(from: D) -> std::result::Result<Vec<Entry>, D::Error> {
    let read = |mut entry: Value| {
        let error = match Entry::deserialize(&entry) {
            Ok(entry) => return Ok(Some(entry)),
            Err(error) => error,
        };
        let described = entry.get_mut("description").ok_or(error)?;
        let Some(known) = reading::as_far_as_known(described.take())? else { return Ok(None) };
        *described = serde_json::to_value(known)?;
        Ok(Some(serde_json::from_value(entry)?))
    };
    let read = Vec::deserialize(from)?.into_iter().map(read).filter_map(Result::transpose);
    read.collect::<Result<_>>().map_err(D::Error::custom)
}

/// A component and where it comes from.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Entry {
    /// What it says of itself.
    pub description: Description,
    /// The file that it comes from: a library or a script, or the user's file that it shows; [`BUILT_IN`] and a name where it is
    /// a script that is part of pdk.
    pub file: PathBuf,
    /// The component that makes this one from a file of the user's; none if it stands for itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub base: Option<String>,
    /// The plugin that it is in; none if it is in a script, or is made from a file of the user's.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub plugin: Option<PluginRecord>,
    /// BLAKE3 of a script that is part of pdk, in hexadecimal; none if there is a file to read.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub blake3: Option<String>,
    /// The scales that a perturbation was measured for.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub scales: Vec<Measured>,
}

impl Entry {
    /// A component that stands for itself, in a file.
    pub fn new(description: Description, file: PathBuf) -> Self {
        Self { description, file, base: None, plugin: None, blake3: None, scales: Vec::new() }
    }

    /// Whether it comes with pdk.
    pub fn is_built_in(&self) -> bool {
        self.blake3.is_some() || self.plugin.as_ref().is_some_and(|plugin| plugin.built_in)
    }

    /// The place of its code: for a component that comes with pdk the source file, as a path in the repository; otherwise the
    /// script or the library.
    pub fn code(&self) -> &Path {
        match self.is_built_in() {
            true => Path::new(&self.description.defined_in),
            false => &self.file,
        }
    }

    /// Whether it stands for a file that is part of pdk or of a plugin, and this file has the same content.
    pub fn is_made_of(&self, file: &Path) -> bool {
        let own = self.blake3.as_deref().unwrap_or(&self.description.blake3);
        !own.is_empty() && hash::of(file).is_ok_and(|hash| hash == own)
    }
}

/// What tells a plugin from others, for a user who has to find it again.
#[derive(Debug, Clone, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct PluginRecord {
    /// Its name.
    pub name: String,
    /// Its own version.
    pub version: String,
    /// Where to get it; empty if it does not say.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub homepage: String,
    /// It comes with pdk.
    #[serde(default, skip_serializing_if = "std::ops::Not::not")]
    pub built_in: bool,
}

impl Catalog {
    /// Where a component stands, or would.
    fn place(&self, kind: Kind, name: &str) -> std::result::Result<usize, usize> {
        self.entries.binary_search_by(|entry| {
            (entry.description.kind, entry.description.name.as_str()).cmp(&(kind, name))
        })
    }

    /// Adds a component, unless there is one of its kind and name, which is returned then.
    pub fn add(&mut self, entry: Entry) -> Option<&Entry> {
        match self.place(entry.description.kind, &entry.description.name) {
            Ok(place) => self.entries.get(place),
            Err(place) => {
                self.entries.insert(place, entry);
                None
            }
        }
    }

    /// All components.
    pub fn entries(&self) -> &[Entry] {
        &self.entries
    }

    /// All components of a kind, by name.
    pub fn of_kind(&self, kind: Kind) -> impl Iterator<Item = &Entry> + Clone {
        self.entries.iter().filter(move |entry| entry.description.kind == kind)
    }

    /// A component by kind and name.
    ///
    /// # Errors
    /// If there is none, with what was probably meant.
    pub fn get(&self, kind: Kind, name: &str) -> Result<&Entry> {
        self.place(kind, name).map(|place| &self.entries[place]).map_err(|_| {
            let known = self.of_kind(kind).map(|entry| entry.description.name.as_str());
            let sentence = format!("there is no {kind} `{name}`; {}", suggest::hint(name, known));
            Error::of(ErrorKind::Configuration, sentence)
        })
    }

    /// A component to be changed; none if there is none.
    pub(crate) fn get_mut(&mut self, kind: Kind, name: &str) -> Option<&mut Entry> {
        self.place(kind, name).ok().map(|place| &mut self.entries[place])
    }

    /// The component of a kind that is used if none is named: a built-in one that says so, or else another one.
    ///
    /// # Errors
    /// If no component of the kind says so.
    pub fn preferred(&self, kind: Kind) -> Result<&Entry> {
        let said = || self.of_kind(kind).filter(|entry| entry.base.is_none() && entry.description.preferred);
        said().find(|entry| entry.is_built_in()).or_else(|| said().next()).ok_or_else(|| {
            let sentence = format!("there is no default {kind}; name one that `pdk list {kind}` shows");
            Error::of(ErrorKind::Configuration, sentence)
        })
    }

    /// The dataset readers that may open a folder or file, with it as the parameter by which they take one.
    pub fn readers(&self, path: &str) -> Vec<ComponentSpec> {
        let reader = |entry: &Entry| {
            let parameters = &entry.description.parameters;
            let parameter = parameters.iter().find(|parameter| parameter.kind == ParameterType::Path)?;
            let parameters = Map::from_iter([(parameter.name.clone(), path.into())]);
            Some(ComponentSpec { name: entry.description.name.clone(), parameters })
        };
        self.of_kind(Kind::Dataset).filter_map(reader).collect()
    }

    /// The component that makes this one from a file of the user's; none if it stands for itself.
    pub fn base_of(&self, entry: &Entry) -> Option<&Entry> {
        entry.base.as_ref().and_then(|base| self.get(entry.description.kind, base).ok())
    }

    /// The component whose library or script has the code of this one.
    pub fn code_of<'a>(&'a self, entry: &'a Entry) -> &'a Entry {
        self.base_of(entry).unwrap_or(entry)
    }

    /// Says what is wrong with a component's name or its parameters.
    ///
    /// # Errors
    /// If there is no such component, or its description does not allow the parameters.
    pub fn check(&self, kind: Kind, name: &str, parameters: &Map<String, Value>) -> Result<Config> {
        Config::check(&self.get(kind, name)?.description, parameters)
    }
}

/// The name of the component that a file of the user's becomes.
pub fn drop_in_name(file: &Path) -> String {
    let stem = file.file_stem().unwrap_or_default().to_string_lossy().to_lowercase();
    let fits = |c: char| if c.is_ascii_alphanumeric() { c } else { '_' };
    stem.chars().map(fits).collect()
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn the_catalog_of_a_later_pdk_is_read_as_far_as_it_is_known() {
        let described = Description::driver("pilot", "Drives");
        let mut later = serde_json::to_value([Entry::new(described, "/p.so".into())]).unwrap();
        later[0]["since"] = json!(2030);
        later[0]["description"]["parameters"] =
            json!([{ "name": "tint", "doc": "", "type": "colour", "default": "red" }]);
        let list = later.as_array_mut().unwrap();
        list.insert(0, json!({ "description": { "kind": "horn", "name": "h" }, "file": "/h.so" }));
        let catalog: Catalog = serde_json::from_value(later).unwrap();
        let [entry] = catalog.entries() else { panic!("{catalog:?}") };
        assert_eq!((entry.description.name.as_str(), &*entry.file), ("pilot", Path::new("/p.so")));
        assert_eq!(entry.description.parameters[0].kind, ParameterType::Json);
        for nonsense in [
            json!([7]),
            json!([{ "file": "/p.so" }]),
            json!([{ "description": { "kind": "driver" }, "file": "/p.so" }]),
        ] {
            assert!(serde_json::from_value::<Catalog>(nonsense.clone()).is_err(), "{nonsense}");
        }
    }
}
