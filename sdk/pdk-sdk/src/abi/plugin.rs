//! The plugin's side of the boundary: wraps the author's types, and turns their panics into errors before they reach it.

mod functions;
mod guard;

pub use functions::{datasets, drivers, masks, perturbations, saliencies, searches, simulators};
use pdk_abi::{Sink, Status, Text, status, store};
use serde_json::{Map, Value};

use super::PluginDescription;
use super::convert;
use crate::SDK_VERSION;
use crate::config::Config;
use crate::describe::Description;
use crate::error::{Error, Result};
use crate::input_files::InputFiles;

/// One line of a plugin's table of components.
pub struct Registration {
    /// Describes the component.
    pub describe: fn() -> Description,
    /// Makes an instance; the names are those of the parameters, in the order of the description.
    pub create: fn(&Config, Vec<String>) -> Result<pdk_abi::Instance>,
    /// The files that an instance reads besides those that its parameters name.
    pub input_files: fn(&Config) -> Result<Vec<InputFiles>>,
}

/// What a package says of itself, for [`describe`].
pub struct Package {
    /// `CARGO_PKG_NAME`.
    pub name: &'static str,
    /// `CARGO_PKG_VERSION`.
    pub version: &'static str,
    /// `CARGO_PKG_HOMEPAGE`.
    pub homepage: &'static str,
    /// `CARGO_PKG_REPOSITORY`.
    pub repository: &'static str,
}

/// Describes a plugin from its table.
///
/// # Safety
/// Both sinks are those of a call in progress.
pub unsafe fn describe(
    package: &Package,
    table: &[Registration],
    description: *const Sink,
    error: *const Sink,
) -> Status {
    let described = guard::guard(|| {
        let homepage = if package.homepage.is_empty() { package.repository } else { package.homepage };
        let described = PluginDescription {
            name: package.name.to_owned(),
            version: package.version.to_owned(),
            sdk: SDK_VERSION.to_owned(),
            homepage: homepage.to_owned(),
            components: table.iter().map(|registration| (registration.describe)()).collect(),
        };
        // SAFETY: the caller's promise.
        unsafe { put(description, &serde_json::to_string(&described)?) };
        Ok(())
    });
    // SAFETY: the caller's promise.
    unsafe { finish(described, error) }
}

/// Makes an instance of a component from its place in the table.
///
/// # Safety
/// Everything is that of a call in progress.
pub unsafe fn create(
    table: &[Registration],
    index: usize,
    parameters: Text,
    into: *mut pdk_abi::Instance,
    error: *const Sink,
) -> Status {
    let created = guard::guard(|| {
        // SAFETY: the caller's promise.
        let (registration, description, config) = unsafe { configured(table, index, parameters) }?;
        let names = description.parameters.into_iter().map(|p| p.name).collect();
        let instance = (registration.create)(&config, names)?;
        // SAFETY: the caller's promise.
        unsafe { store(instance, into) };
        Ok(())
    });
    // SAFETY: the caller's promise.
    unsafe { finish(created, error) }
}

/// Lists the files that an instance of a component would read.
///
/// # Safety
/// Everything is that of a call in progress.
pub unsafe fn input_files(
    table: &[Registration],
    index: usize,
    parameters: Text,
    files: *const Sink,
    error: *const Sink,
) -> Status {
    let listed = guard::guard(|| {
        // SAFETY: the caller's promise.
        let (registration, _, config) = unsafe { configured(table, index, parameters) }?;
        let listed = serde_json::to_string(&(registration.input_files)(&config)?)?;
        // SAFETY: the caller's promise.
        unsafe { put(files, &listed) };
        Ok(())
    });
    // SAFETY: the caller's promise.
    unsafe { finish(listed, error) }
}

/// The line of a component in the table, its description, and its checked parameters.
///
/// # Safety
/// The parameters are those of a call in progress.
unsafe fn configured(
    table: &[Registration],
    index: usize,
    parameters: Text,
) -> Result<(&Registration, Description, Config)> {
    let registration =
        table.get(index).ok_or_else(|| Error::new(format!("the plugin has no component number {index}")))?;
    // SAFETY: the caller's promise.
    let given: Map<String, Value> = serde_json::from_str(unsafe { convert::text(parameters) }?)?;
    let description = (registration.describe)();
    let config = Config::check(&description, &given)?;
    Ok((registration, description, config))
}

/// Passes a text on.
///
/// # Safety
/// The sink is that of a call in progress.
unsafe fn put(into: *const Sink, text: &str) {
    // SAFETY: the caller's promise.
    unsafe { pdk_abi::load(into, pdk_abi::empty()).put(text.as_bytes()) };
}

/// Ends a call: where it failed, with its sentence.
///
/// # Safety
/// The sink is that of a call in progress.
#[inline]
unsafe fn finish(result: Result<()>, sink: *const Sink) -> Status {
    match result {
        Ok(()) => Status { code: status::DONE },
        Err(error) => {
            // SAFETY: the caller's promise.
            unsafe { put(sink, error.message()) };
            convert::status_of(error.kind())
        }
    }
}
