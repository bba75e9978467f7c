//! The interface as a later SDK may have it: each table has a function more than pdk knows, and there is a kind more.

#![allow(missing_docs)]

use std::ffi::c_void;

use abi_stable::StableAbi;
use abi_stable::library::RootModule;
use abi_stable::sabi_types::VersionStrings;
use pdk_abi::{
    Control, DatasetFunctionsRef, DriveContext, Frame, Instance, MaskFunctionsRef, PerturbationFunctionsRef,
    PredictorFunctionsRef, SaliencyFunctionsRef, SearchFunctionsRef, SimulatorFunctionsRef, Sink, Status,
    Text,
};

/// The functions of a plugin, with two more.
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
    pub input_files: unsafe extern "C" fn(
        index: usize,
        parameters: Text,
        files: *const Sink,
        error: *const Sink,
    ) -> Status,
    pub mask: unsafe extern "C" fn(
        index: usize,
        parameters: Text,
        into: *mut Instance<MaskFunctionsRef>,
        error: *const Sink,
    ) -> Status,
    pub predictor: unsafe extern "C" fn(
        index: usize,
        parameters: Text,
        into: *mut Instance<PredictorFunctionsRef>,
        error: *const Sink,
    ) -> Status,
    pub horn: unsafe extern "C" fn(
        index: usize,
        parameters: Text,
        into: *mut Instance<HornFunctionsRef>,
        error: *const Sink,
    ) -> Status,
    pub forget: unsafe extern "C" fn(),
}

/// The functions of a driver, with one more.
#[repr(C)]
#[derive(StableAbi)]
#[sabi(kind(Prefix(prefix_ref = DriverFunctionsRef, prefix_fields = DriverFunctionsPrefix)))]
pub struct DriverFunctions {
    pub drop: unsafe extern "C" fn(object: *mut c_void),
    pub reset: unsafe extern "C" fn(object: *mut c_void, error: *const Sink) -> Status,
    pub drive: unsafe extern "C" fn(
        object: *mut c_void,
        frame: *const Frame,
        context: *const DriveContext,
        into: *mut Control,
        error: *const Sink,
    ) -> Status,
    #[sabi(last_prefix_field)]
    pub info: unsafe extern "C" fn(object: *mut c_void, info: *const Sink, error: *const Sink) -> Status,
    pub explain: unsafe extern "C" fn(),
}

/// The functions of a kind that pdk does not know.
#[repr(C)]
#[derive(StableAbi)]
#[sabi(kind(Prefix(prefix_ref = HornFunctionsRef, prefix_fields = HornFunctionsPrefix)))]
pub struct HornFunctions {
    #[sabi(last_prefix_field)]
    pub drop: unsafe extern "C" fn(object: *mut c_void),
}

impl RootModule for PluginRef {
    abi_stable::declare_root_module_statics! {PluginRef}
    const BASE_NAME: &'static str = pdk_abi::PluginRef::BASE_NAME;
    const NAME: &'static str = Self::BASE_NAME;
    const VERSION_STRINGS: VersionStrings = abi_stable::package_version_strings!();
}
