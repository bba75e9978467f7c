//! Opens plugin libraries and refuses those that do not fit, each with one sentence.

use std::path::{Path, PathBuf};

use pdk_sdk::SDK_VERSION;
use pdk_sdk::abi::PluginDescription;
use pdk_sdk::abi::host::{Instance, Module};
use pdk_sdk::abi::pdk_abi::{self, Header};
use pdk_sdk::error::{Error, Place, Result};
use pdk_sdk::input_files::InputFiles;
use serde_json::{Map, Value};

use crate::catalog::PluginRecord;
use crate::description;
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
    /// Where the file is not a library, is not a pdk plugin, was built for another version of the interface, or cannot describe
    /// itself.
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
    /// Where the component refuses the parameters or panics.
    pub fn create(&self, index: usize, parameters: &Map<String, Value>) -> Result<Instance> {
        self.module.create(self.places[index], &serde_json::to_string(parameters)?)
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
    // SAFETY: loading runs the library's initialisers. That is what it means to use a plugin: the user put it there.
    let library = unsafe { libloading::Library::new(path) }.map_err(|error| {
        Error::new(format!("is not a library that this machine can load ({})", cause(&error)))
    })?;
    // A library is never unloaded: its functions and types live on in components.
    let library = Box::leak(Box::new(library));

    // SAFETY: the name belongs to pdk, and every version of the interface has a header under it.
    let header = unsafe { library.get::<*const Header>(pdk_abi::SYMBOL) }.map_err(|_| {
        Error::new(format!(
            "is not a pdk plugin: it has no symbol `{}`; a plugin is a cdylib that uses pdk_sdk::export!",
            pdk_abi::SYMBOL
        ))
    })?;
    let header = *header;
    // SAFETY: the header of every version begins with it.
    let version = unsafe { header.cast::<u64>().read_unaligned() };
    if version != pdk_abi::VERSION {
        let newer = if version > pdk_abi::VERSION { "get a newer pdk, or " } else { "" };
        return Err(Error::new(format!(
            "was built for version {version} of the plugin interface, but this pdk has version {}; {newer}build it again with \
             pdk-sdk {SDK_VERSION}",
            pdk_abi::VERSION
        )));
    }
    // SAFETY: it is the header of a plugin of this version, whose library stays.
    unsafe { Module::behind(&*header) }
}

/// What the system says of a library that does not load, without the path that stands in front of it.
fn cause(error: &libloading::Error) -> String {
    let mut source: &dyn std::error::Error = error;
    while let Some(next) = source.source() {
        source = next;
    }
    let text = source.to_string();
    first_line(text.rsplit_once(".so: ").map_or(text.as_str(), |(_, reason)| reason)).to_owned()
}

fn first_line(text: &str) -> &str {
    text.trim().lines().next().unwrap_or_default()
}
