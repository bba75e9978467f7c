//! The root module of a plugin, and the header by which abi_stable finds it.

pub use pdk_abi::abi_stable::library::LibHeader;
use pdk_abi::abi_stable::library::{CheckTypeLayout, RootModuleResult};
use pdk_abi::abi_stable::marker_type::ErasedPrefix;
use pdk_abi::abi_stable::prefix_type::{PrefixRefTrait, WithMetadata};
use pdk_abi::abi_stable::std_types::ROk;
use pdk_abi::{Plugin, PluginRef, Sink, Status, Text, each_kind};

use super::call::{finish, put};
use super::guard::guard;
use super::registrations::{Exported, Package, Registration, configured, make};
use crate::SDK_VERSION;
use crate::abi::PluginDescription;

/// The header of a plugin, with the layout of everything in its root module.
pub const fn header<P: Exported>() -> LibHeader {
    // SAFETY: the constructor returns this root module.
    unsafe { LibHeader::from_constructor::<PluginRef>(root_module::<P>, CheckTypeLayout::Yes) }
}

/// The function of the root module, with the functions that make instances of each kind.
macro_rules! root_module {
    ($($(#[$does:meta])* $kind:ident $name:ident $plural:ident: $table:ident $table_ref:ident, $one:literal, $several:literal;)*) => {
        extern "C" fn root_module<P: Exported>() -> RootModuleResult {
            let plugin = const {
                &WithMetadata::new(Plugin {
                    describe: describe::<P>,
                    input_files: input_files::<P>,
                    $($name: make::$name::<P>,)*
                })
            };
            let plugin = PluginRef(plugin.static_as_prefix()).to_prefix_ref();
            // SAFETY: the host compares the layout in the header before it uses it.
            ROk(unsafe { plugin.cast::<ErasedPrefix>() })
        }
    };
}

each_kind!(root_module);

unsafe extern "C" fn describe<P: Exported>(description: *const Sink, error: *const Sink) -> Status {
    // SAFETY: the host lends both sinks for this call.
    unsafe { describe_all(&P::PACKAGE, P::TABLE, description, error) }
}

/// Describes a plugin.
///
/// # Safety
/// The sinks are those of a call in progress.
unsafe fn describe_all(
    package: &Package,
    table: &[Registration],
    description: *const Sink,
    error: *const Sink,
) -> Status {
    let described = guard(|| {
        let Package { name, version, homepage, repository } = *package;
        let homepage = if homepage.is_empty() { repository } else { homepage };
        let described = PluginDescription {
            name: name.to_owned(),
            version: version.to_owned(),
            sdk: SDK_VERSION.to_owned(),
            homepage: homepage.to_owned(),
            components: table.iter().map(|registration| (registration.describe)()).collect(),
        };
        // SAFETY: the caller's promise.
        unsafe { put(description, &serde_json::to_string(&described)?) };
        Ok(())
    });
    // SAFETY: as above.
    unsafe { finish(described, error) }
}

unsafe extern "C" fn input_files<P: Exported>(
    index: usize,
    parameters: Text,
    files: *const Sink,
    error: *const Sink,
) -> Status {
    // SAFETY: the host lends everything for this call.
    unsafe { list_input_files(P::TABLE, index, parameters, files, error) }
}

/// Lists the files that an instance reads.
///
/// # Safety
/// The parameters and the sinks are those of a call in progress.
unsafe fn list_input_files(
    table: &[Registration],
    index: usize,
    parameters: Text,
    files: *const Sink,
    error: *const Sink,
) -> Status {
    let listed = guard(|| {
        // SAFETY: the caller's promise.
        let (registration, _, config) = unsafe { configured(table, index, parameters) }?;
        let listed = serde_json::to_string(&(registration.input_files)(&config)?)?;
        // SAFETY: the caller's promise.
        unsafe { put(files, &listed) };
        Ok(())
    });
    // SAFETY: as above.
    unsafe { finish(listed, error) }
}
