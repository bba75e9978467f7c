//! A plugin for the tests of which one function takes another parameter than those of this version of the interface, as if an author had
//! changed it without a new version: no call of it may be made.

#![allow(missing_docs)]

use std::ffi::c_void;

use abi_stable::StableAbi;
use abi_stable::library::{CheckTypeLayout, LibHeader, RootModule, RootModuleResult};
use abi_stable::sabi_types::VersionStrings;
use pdk_abi::{
    Control, DatasetFunctionsRef, DriveContext, Frame, Instance, PerturbationFunctionsRef,
    SaliencyFunctionsRef, SearchFunctionsRef, SimulatorFunctionsRef, Sink, Status, Text,
};

/// The functions of a plugin, as those of the first SDK.
#[repr(C)]
#[derive(StableAbi)]
#[sabi(kind(Prefix(prefix_ref = PluginRef, prefix_fields = PluginPrefix)))]
pub struct Plugin {
    pub describe: unsafe extern "C" fn(description: *const Sink, error: *const Sink) -> Status,
    pub perturbation: unsafe extern "C" fn(
        index: usize,
        parameters: Text,
        into: *mut Instance<PerturbationFunctionsRef>,
        error: *const Sink,
    ) -> Status,
    pub simulator: unsafe extern "C" fn(
        index: usize,
        parameters: Text,
        into: *mut Instance<SimulatorFunctionsRef>,
        error: *const Sink,
    ) -> Status,
    pub driver: unsafe extern "C" fn(
        index: usize,
        parameters: Text,
        into: *mut Instance<DriverFunctionsRef>,
        error: *const Sink,
    ) -> Status,
    pub saliency: unsafe extern "C" fn(
        index: usize,
        parameters: Text,
        into: *mut Instance<SaliencyFunctionsRef>,
        error: *const Sink,
    ) -> Status,
    pub search: unsafe extern "C" fn(
        index: usize,
        parameters: Text,
        into: *mut Instance<SearchFunctionsRef>,
        error: *const Sink,
    ) -> Status,
    #[sabi(last_prefix_field)]
    pub dataset: unsafe extern "C" fn(
        index: usize,
        parameters: Text,
        into: *mut Instance<DatasetFunctionsRef>,
        error: *const Sink,
    ) -> Status,
}

/// The functions of a driver, with a parameter more in one of them.
#[repr(C)]
#[derive(StableAbi)]
#[sabi(kind(Prefix(prefix_ref = DriverFunctionsRef, prefix_fields = DriverFunctionsPrefix)))]
pub struct DriverFunctions {
    pub drop: unsafe extern "C" fn(object: *mut c_void),
    pub reset: unsafe extern "C" fn(object: *mut c_void, seed: u64, error: *const Sink) -> Status,
    pub drive: unsafe extern "C" fn(
        object: *mut c_void,
        frame: *const Frame,
        context: *const DriveContext,
        into: *mut Control,
        error: *const Sink,
    ) -> Status,
    #[sabi(last_prefix_field)]
    pub info: unsafe extern "C" fn(object: *mut c_void, info: *const Sink, error: *const Sink) -> Status,
}

impl RootModule for PluginRef {
    abi_stable::declare_root_module_statics! {PluginRef}
    const BASE_NAME: &'static str = pdk_abi::PluginRef::BASE_NAME;
    const NAME: &'static str = Self::BASE_NAME;
    const VERSION_STRINGS: VersionStrings = abi_stable::package_version_strings!();
}

/// Never called by a pdk that compares the layout.
extern "C" fn root_module() -> RootModuleResult {
    std::process::abort();
}

// SAFETY: the name is that of abi_stable's header, and nothing else in this library uses it. The constructor returns nothing.
#[unsafe(no_mangle)]
#[allow(non_upper_case_globals)]
static _1as_0lib_1header_0root_bmodule_bloader: LibHeader =
    unsafe { LibHeader::from_constructor::<PluginRef>(root_module, CheckTypeLayout::Yes) };
