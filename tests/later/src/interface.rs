//! The interface as a later SDK may have it: each table has a function more than pdk knows, and there is a kind more.

#![allow(missing_docs)]

use std::ffi::c_void;

use abi_stable::StableAbi;
use abi_stable::library::RootModule;
use abi_stable::sabi_types::VersionStrings;
// What is declared here comes before what has the same name there.
use pdk_abi::*;

// The functions of a plugin, with two more: see build.rs.
include!(concat!(env!("OUT_DIR"), "/plugin.rs"));

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
    pub gradient: unsafe extern "C" fn(
        object: *mut c_void,
        frame: *const Frame,
        context: *const DriveContext,
        into: *mut f32,
        length: usize,
        steering: *mut f64,
        error: *const Sink,
    ) -> Status,
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
