//! A plugin for the tests that was built for another version of the plugin interface: its header is all that may be read.

use abi_stable::StableAbi;
use abi_stable::library::{CheckTypeLayout, LibHeader, RootModule, RootModuleResult};
use abi_stable::sabi_types::VersionStrings;

/// The functions of a plugin of that version.
#[repr(C)]
#[derive(StableAbi)]
#[sabi(kind(Prefix(prefix_ref = PluginRef, prefix_fields = PluginPrefix)))]
pub struct Plugin {
    /// Something else than now.
    #[sabi(last_prefix_field)]
    pub describe: unsafe extern "C" fn(language: u64),
}

impl RootModule for PluginRef {
    abi_stable::declare_root_module_statics! {PluginRef}
    const BASE_NAME: &'static str = "pdk_plugin";
    const NAME: &'static str = Self::BASE_NAME;
    const VERSION_STRINGS: VersionStrings = abi_stable::package_version_strings!();
}

/// Never called by a pdk of another version.
extern "C" fn root_module() -> RootModuleResult {
    std::process::abort();
}

// SAFETY: the name is that of abi_stable's header, and nothing else in this library uses it. The constructor returns nothing.
#[unsafe(no_mangle)]
#[allow(non_upper_case_globals)]
static _1as_0lib_1header_0root_bmodule_bloader: LibHeader =
    unsafe { LibHeader::from_constructor::<PluginRef>(root_module, CheckTypeLayout::Yes) };
