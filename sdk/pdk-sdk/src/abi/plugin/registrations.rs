//! The table line of a component, and the functions of the root module that make instances, for each kind.

use std::ffi::c_void;

use pdk_abi::{Instance, Sink, Status, Text, each_kind};
use serde_json::{Map, Value};

use super::call::{finish, instance};
use super::guard::guard;
use crate::abi::convert;
use crate::component::Component;
use crate::config::Config;
use crate::describe::Description;
use crate::error::{Error, ErrorKind, Result};
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
pub(super) unsafe fn configured(
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

macro_rules! registrations {
    ($($(#[$does:meta])* $kind:ident $name:ident $plural:ident: $table:ident $table_ref:ident, $one:literal, $several:literal;)*) => {
        /// The functions of an instance, by its kind.
        #[derive(Clone, Copy)]
        pub enum Functions {
            $(
                #[doc = concat!("Those of a ", $one, ".")]
                $kind(pdk_abi::$table_ref),
            )*
        }

        $(
            /// The table line of a component of this kind.
            pub const fn $plural<T: Component + crate::kinds::$name::$kind + 'static>() -> Registration {
                fn create<T: Component + crate::kinds::$name::$kind + 'static>(
                    config: &Config,
                    names: Vec<String>,
                ) -> Result<*mut c_void> {
                    Ok(instance::<dyn crate::kinds::$name::$kind>(Box::new(T::new(config)?), names))
                }
                let functions = crate::kinds::$name::functions::table();
                let functions = Functions::$kind(pdk_abi::$table_ref(functions.static_as_prefix()));
                Registration { describe: T::description, create: create::<T>, functions, input_files: T::input_files }
            }
        )*

        /// The functions of the root module that make instances.
        pub(super) mod make {
            use super::*;
            $(
                pub unsafe extern "C" fn $name<P: Exported>(
                    index: usize,
                    parameters: Text,
                    into: *mut Instance<pdk_abi::$table_ref>,
                    error: *const Sink,
                ) -> Status {
                    // SAFETY: the host lends everything for this call.
                    unsafe { from::$name(P::TABLE, index, parameters, into, error) }
                }
            )*
        }

        /// The same, from a plugin's table, compiled once and not for every plugin.
        mod from {
            use super::*;
            $(
                pub(super) unsafe fn $name(
                    table: &[Registration],
                    index: usize,
                    parameters: Text,
                    into: *mut Instance<pdk_abi::$table_ref>,
                    error: *const Sink,
                ) -> Status {
                    let made = guard(|| {
                        // SAFETY: the host lends the parameters for this call.
                        let configured = unsafe { configured(table, index, parameters) };
                        let (registration, description, config) = configured?;
                        let Functions::$kind(functions) = registration.functions else {
                            let sentence = format!(concat!("component number {} is not a ", stringify!($name)), index);
                            return Err(Error::of(ErrorKind::Nonsense, sentence));
                        };
                        let names = description.parameters.into_iter().map(|p| p.name).collect();
                        let object = (registration.create)(&config, names)?;
                        // SAFETY: the host lends it for this call.
                        unsafe { into.write(Instance { object, functions: Some(functions) }) };
                        Ok(())
                    });
                    // SAFETY: the host lends the sink for this call.
                    unsafe { finish(made, error) }
                }
            )*
        }
    };
}

each_kind!(registrations);
