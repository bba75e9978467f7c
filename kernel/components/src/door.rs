//! Opens a plugin library with abi_stable, which proves that its functions are those of this pdk, and refuses every other library with
//! one sentence.
//!
//! abi_stable's own `RootModule::load_from` keeps one library per process, and unloads a library that it refuses. So its steps are taken
//! one by one, and a library that was opened stays.

use std::path::Path;

use pdk_sdk::SDK_VERSION;
use pdk_sdk::abi::pdk_abi::abi_stable::StableAbi;
use pdk_sdk::abi::pdk_abi::abi_stable::abi_stability::abi_checking::AbiInstabilityErrors;
use pdk_sdk::abi::pdk_abi::abi_stable::abi_stability::check_layout_compatibility;
use pdk_sdk::abi::pdk_abi::abi_stable::library::{
    AbiHeader, LibHeader, LibraryError, RawLibrary, RootModule, abi_header_from_raw_library,
};
use pdk_sdk::abi::pdk_abi::abi_stable::std_types::{RBoxError, RErr, ROk};
use pdk_sdk::abi::pdk_abi::abi_stable::type_layout::{TLFieldOrFunction, TypeLayout};
use pdk_sdk::abi::pdk_abi::{PluginRef, VERSION};
use pdk_sdk::error::{Error, Result};

/// Opens a library, which stays in memory until the process ends.
///
/// # Errors
/// If the file is not a library, is not a plugin, or does not fit this pdk.
pub fn open(path: &Path) -> Result<PluginRef> {
    let library = RawLibrary::load_at(path).map_err(|error| {
        Error::new(format!("is not a library that this machine can load ({})", cause(&error)))
    })?;
    // Its functions and types live on in components.
    let library: &'static RawLibrary = Box::leak(Box::new(library));
    // SAFETY: the library stays, and only abi_stable exports something by this name.
    let Ok(header) = (unsafe { abi_header_from_raw_library(library) }) else {
        return Err(Error::new(
            "is not a pdk plugin: it has no header of abi_stable; a plugin is a cdylib that uses pdk_sdk::export!",
        ));
    };
    // Behind another header may be anything.
    let (has, known) = (*header, AbiHeader::VALUE);
    if has.magic_string != known.magic_string {
        return Err(Error::new("is damaged: its header is not one of abi_stable; build or copy it again"));
    }
    let header = header.upgrade().map_err(|error| match error {
        LibraryError::InvalidAbiHeader(_) => again(&format!(
            "was built with abi_stable {}.{}, but this pdk has {}.{}",
            has.abi_major, has.abi_minor, known.abi_major, known.abi_minor
        )),
        error => unexpected(&error),
    })?;
    root_module(header)
}

/// The root module behind a header, if it is that of a plugin that fits.
fn root_module(header: &'static LibHeader) -> Result<PluginRef> {
    let name = header.root_mod_consts().base_name();
    if name != PluginRef::BASE_NAME {
        return Err(Error::new(format!("is not a pdk plugin, but one of another program (`{name}`)")));
    }
    // Without it there is no check, and every library would pass.
    let Some(layout) = header.layout() else {
        return Err(again("does not carry the layout of its functions, which is needed to check them"));
    };
    match header.init_root_module::<PluginRef>() {
        // It has all the functions that this pdk knows, and may have more.
        Ok(plugin) => Ok(plugin),
        Err(LibraryError::IncompatibleVersionNumber { actual_version, .. }) => {
            let has = u64::from(actual_version.major);
            let newer = if has > VERSION { "get a newer pdk, or " } else { "" };
            Err(Error::new(format!(
                "was built for version {has} of the plugin interface, but this pdk has version {VERSION}; {newer}build it again with \
                 pdk-sdk {SDK_VERSION}"
            )))
        }
        Err(LibraryError::AbiInstability(_)) => earlier(header, layout),
        Err(error) => Err(unexpected(&error)),
    }
}

/// The root module of a library that lacks functions which were added later. abi_stable asks for at least as many as this pdk knows, so
/// the two sides change places: everything that the library has must be here as well. What it lacks, its tables report.
fn earlier(header: &'static LibHeader, layout: &'static TypeLayout) -> Result<PluginRef> {
    let own = <PluginRef as StableAbi>::LAYOUT;
    match check_layout_compatibility(layout, own) {
        // SAFETY: the library's part of the layout is this pdk's, and no more than that is read without asking.
        ROk(()) => unsafe { header.init_root_module_with_unchecked_layout::<PluginRef>() }
            .map_err(|error| unexpected(&error)),
        RErr(error) => {
            // Of the two comparisons, the one with fewer differences shows the one that counts.
            let other = check_layout_compatibility(own, layout).into_result().err();
            let places = [Some(error), other].into_iter().flatten().map(|error| differences(&error));
            let places = places.min_by_key(Vec::len).unwrap_or_default();
            let place = places.first().map(|place| format!(" at `{place}`")).unwrap_or_default();
            Err(again(&format!("has other functions than version {VERSION} of the plugin interface{place}")))
        }
    }
}

/// Where two layouts differ: the names of tables, functions and parameters on the way there.
fn differences(error: &RBoxError) -> Vec<String> {
    let Some(errors) = error.downcast_ref::<AbiInstabilityErrors>() else { return Vec::new() };
    let found = errors.errors.iter().filter(|error| !error.errs.is_empty());
    let name = |step: &TLFieldOrFunction| match step {
        TLFieldOrFunction::Field(field) => field.name().to_owned(),
        TLFieldOrFunction::Function(function) => function.name.as_str().to_owned(),
    };
    found
        .map(|error| {
            let mut names: Vec<_> = error.stack_trace.iter().map(|step| name(&step.expected)).collect();
            // What a pointer points to has a number, and so have most parameters. A field and the function in it have the same name.
            names.retain(|name| {
                !name.starts_with(|c: char| c.is_ascii_digit()) && !name.starts_with("param_")
            });
            names.dedup();
            names.join(".")
        })
        .collect()
}

/// An error whose remedy is to build the plugin again.
fn again(sentence: &str) -> Error {
    Error::new(format!("{sentence}; build it again with pdk-sdk {SDK_VERSION}"))
}

/// Something that no library has shown yet, on one line.
fn unexpected(error: &LibraryError) -> Error {
    let text = error.to_string();
    again(&format!("cannot be used ({})", text.split_whitespace().collect::<Vec<_>>().join(" ")))
}

/// What the system says of a library that does not load, without the path that stands in front of it.
fn cause(error: &LibraryError) -> String {
    let mut source: &dyn std::error::Error = match error {
        LibraryError::OpenError { err, .. } => &**err,
        other => other,
    };
    while let Some(next) = source.source() {
        source = next;
    }
    let text = source.to_string();
    let reason = text.rsplit_once(".so: ").map_or(text.as_str(), |(_, reason)| reason);
    reason.trim().lines().next().unwrap_or_default().to_owned()
}

#[cfg(test)]
mod tests {
    use pdk_sdk::abi::pdk_abi::abi_stable::library::{CheckTypeLayout, RootModuleResult};

    use super::*;

    extern "C" fn never() -> RootModuleResult {
        unreachable!("a library that is refused is not asked for its functions");
    }

    #[test]
    fn a_library_that_cannot_be_checked_is_refused() {
        // SAFETY: the constructor is not called.
        let header = unsafe { LibHeader::from_constructor::<PluginRef>(never, CheckTypeLayout::No) };
        let sentence = root_module(Box::leak(Box::new(header))).err().unwrap().to_string();
        assert!(sentence.starts_with("does not carry the layout of its functions"), "{sentence}");
    }
}
