//! Opens plugin libraries and refuses those that do not fit, each with one sentence.

use std::ffi::CStr;
use std::path::{Path, PathBuf};

use abi_stable::library::{AbiHeaderRef, LibraryError};
use pdk_sdk::SDK_VERSION;
use pdk_sdk::abi::host::{self, Instance};
use pdk_sdk::abi::{self, PluginDescription, PluginModuleRef};
use pdk_sdk::error::{Error, Place, Result};
use serde_json::{Map, Value};

use crate::calls::{self, Function};
use crate::description;
use crate::elf;

/// A plugin that has been loaded. Its library stays in memory until the process ends.
pub struct Plugin {
    /// The library's file.
    pub path: PathBuf,
    /// What the plugin says of itself.
    pub description: PluginDescription,
    module: PluginModuleRef,
}

impl Plugin {
    /// Opens a plugin library.
    ///
    /// # Errors
    /// Where the file is not a library, is not a pdk plugin, was built with another SDK version, or cannot describe itself.
    pub fn load(path: &Path) -> Result<Self> {
        let name = format!("plugin {}", path.display());
        let loaded = calls::call(&name, Function::Load, || {
            let module = open(path)?;
            let description: PluginDescription = serde_json::from_str(&host::result((module.describe())())?)?;
            description::check_plugin(&description)?;
            Ok(Self { path: path.to_owned(), description, module })
        });
        loaded.map_err(|error: Error| error.at(name))
    }

    /// Makes an instance of the component at `index` of the description.
    ///
    /// # Errors
    /// Where the component refuses the parameters or panics.
    pub fn create(&self, index: usize, parameters: &Map<String, Value>) -> Result<Instance> {
        let json = serde_json::to_string(parameters)?;
        host::instance(host::result((self.module.create())(index, json.as_str().into()))?)
    }
}

fn open(path: &Path) -> Result<PluginModuleRef> {
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

    // SAFETY: the name belongs to pdk, and every SDK version gives it this type.
    let version = unsafe { library.get::<abi::VersionFn>(abi::VERSION_SYMBOL) }.map_err(|_| {
        Error::new(format!(
            "is not a pdk plugin: it has no symbol `{}`; a plugin is a cdylib that uses pdk_sdk::export!",
            abi::VERSION_SYMBOL
        ))
    })?;
    let version = version();
    if version.is_null() {
        return Err(Error::new("does not tell its SDK version; build it again with pdk_sdk::export!"));
    }
    // SAFETY: the function returns a static string that ends with NUL.
    let version = unsafe { CStr::from_ptr(version) }.to_string_lossy();
    if version != SDK_VERSION {
        return Err(Error::new(format!(
            "was built with pdk-sdk {version}, but this pdk needs {SDK_VERSION}; build it again with pdk-sdk = \"={SDK_VERSION}\""
        )));
    }
    // SAFETY: a plugin of this SDK version exports its header under this name.
    let header = unsafe { library.get::<AbiHeaderRef>(abi::HEADER_SYMBOL) }.map_err(|_| {
        Error::new(format!("has no symbol `{}`; build it again with pdk_sdk::export!", abi::HEADER_SYMBOL))
    })?;
    header.upgrade().and_then(|header| header.init_root_module::<PluginModuleRef>()).map_err(|error| {
        match error {
            LibraryError::AbiInstability(_) => Error::new(format!(
                "says pdk-sdk {SDK_VERSION} but has another layout; build it again with this compiler and SDK"
            )),
            other => Error::new(format!("cannot be started: {}", first_line(&other.to_string()))),
        }
    })
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
