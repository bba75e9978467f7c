//! The plugin's side of the boundary: wraps the author's types, and turns their panics into errors before they reach it.

mod functions;
mod guard;
mod module;

use std::ffi::c_void;

pub use functions::{
    Functions, datasets, drivers, masks, perturbations, predictors, saliencies, searches, simulators,
};
pub use module::{LibHeader, header};
use pdk_abi::{Sink, Status, Text, status};
use serde_json::{Map, Value};

use super::convert;
use crate::config::Config;
use crate::describe::Description;
use crate::error::{Error, Result};
use crate::input_files::InputFiles;

/// What [`export!`](crate::export) turns into a plugin.
pub trait Exported {
    /// The package of the plugin.
    const PACKAGE: Package;
    /// Its components.
    const TABLE: &'static [Registration];
}

/// One line of a plugin's table of components.
pub struct Registration {
    /// Describes the component.
    pub describe: fn() -> Description,
    /// Makes an instance; the names are those of the parameters, in the order of the description.
    pub create: fn(&Config, Vec<String>) -> Result<*mut c_void>,
    /// The functions of an instance.
    pub functions: Functions,
    /// The files that an instance reads besides those that its parameters name.
    pub input_files: fn(&Config) -> Result<Vec<InputFiles>>,
}

/// What a package says of itself, for the description of the plugin.
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

/// Ends a call: if it failed, with its sentence.
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
