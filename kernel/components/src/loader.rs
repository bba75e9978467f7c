//! Loads plugins: opens their libraries and reads what they say of themselves.

use std::path::{Path, PathBuf};

use pdk_sdk::abi::PluginDescription;
use pdk_sdk::abi::host::{Instance, Module};
use pdk_sdk::error::{Error, Place, Result};
use pdk_sdk::input_files::InputFiles;
use serde_json::{Map, Value};

use crate::catalog::PluginRecord;
use crate::description;
use crate::door;
use crate::elf;
use crate::reading::{self, Told};
use pdk_supervise::calls::{self, Function};

/// A plugin that has been loaded. Its library stays in memory until the process ends.
pub struct Plugin {
    /// The library's file.
    pub path: PathBuf,
    /// What the plugin says of itself, as far as it is known here.
    pub description: PluginDescription,
    /// What it says besides, a sentence each.
    pub skipped: Vec<String>,
    /// The place of each component of the description among all that the plugin has.
    places: Vec<usize>,
    module: Module,
}

impl Plugin {
    /// Opens a plugin library.
    ///
    /// # Errors
    /// If the file is not a library, is not a pdk plugin, does not fit this pdk, or cannot describe itself.
    pub fn load(path: &Path) -> Result<Self> {
        let name = format!("plugin {}", path.display());
        let loaded = calls::call(&name, Function::Load, || {
            let module = open(path)?;
            let Told { description, places, skipped } = reading::read(&module.describe()?)?;
            description::check_plugin(&description)?;
            Ok(Self { path: path.to_owned(), description, skipped, places, module })
        });
        loaded.map_err(|error: Error| error.at(name))
    }

    /// What tells it from others.
    pub fn record(&self, built_in: bool) -> PluginRecord {
        let PluginDescription { name, version, homepage, .. } = self.description.clone();
        PluginRecord { name, version, homepage, built_in }
    }

    /// Makes an instance of the component at `index` of the description.
    ///
    /// # Errors
    /// If the component refuses the parameters or panics.
    pub fn create(&self, index: usize, parameters: &Map<String, Value>) -> Result<Instance> {
        let kind = self.description.components[index].kind;
        self.module.create(kind, self.places[index], &serde_json::to_string(parameters)?)
    }

    /// The files that such an instance reads besides those that its parameters name.
    ///
    /// # Errors
    /// If they cannot be listed.
    pub fn input_files(&self, index: usize, parameters: &Map<String, Value>) -> Result<Vec<InputFiles>> {
        self.module.input_files(self.places[index], &serde_json::to_string(parameters)?)
    }
}

fn open(path: &Path) -> Result<Module> {
    if let Some((needed, has)) = elf::missing_part(path)? {
        return Err(Error::new(format!(
            "is cut off: it has {has} of at least {needed} bytes; build or copy it again"
        )));
    }
    // A name without a folder would be looked for among the system's libraries.
    let path = std::path::absolute(path).place("its folder is not known")?;
    let plugin = door::open(&path)?;
    // SAFETY: its layout was checked, and its library stays. What its functions do is the plugin's promise: the user put it there.
    Ok(unsafe { Module::of(plugin) })
}
