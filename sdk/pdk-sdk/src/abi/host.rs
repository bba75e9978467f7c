//! The host's side of the boundary: what a plugin offers, as the traits of the SDK.

pub(crate) mod call;

use pdk_abi::{PluginRef, Text, each_kind};

use crate::error::Result;
use crate::input_files::InputFiles;
use crate::kinds::Kind;
use call::{Make, Object, collect, make_instance, needed};

/// The functions of a plugin.
#[derive(Clone, Copy)]
pub struct Module {
    plugin: PluginRef,
}

impl Module {
    /// The functions of a root module.
    ///
    /// # Safety
    /// It is the root module of a library whose layout has been checked and that is never unloaded, and its functions do what
    /// [`pdk_abi`] says.
    pub unsafe fn of(plugin: PluginRef) -> Self {
        Self { plugin }
    }

    /// What the plugin says of itself, as JSON: see [`PluginDescription`](super::PluginDescription).
    ///
    /// # Errors
    /// If it cannot describe itself.
    pub fn describe(&self) -> Result<String> {
        // SAFETY: both sinks live through the call.
        collect(|description, error| unsafe { (self.plugin.describe())(description, error) })
    }

    /// The files that an instance of the component with this place reads besides those that the parameters name, a JSON object; none
    /// from a plugin that cannot say.
    ///
    /// # Errors
    /// If they cannot be listed.
    pub fn input_files(&self, index: usize, parameters: &str) -> Result<Vec<InputFiles>> {
        let Some(function) = self.plugin.input_files() else { return Ok(Vec::new()) };
        let parameters = Text::new(parameters.as_bytes());
        // SAFETY: everything lives through the call.
        let listed = collect(|files, error| unsafe { function(index, parameters, files, error) })?;
        Ok(serde_json::from_str(&listed)?)
    }
}

/// What an instance is here, and how it is made, by its kind.
macro_rules! instances {
    ($($(#[$does:meta])* $kind:ident $name:ident $plural:ident: $table:ident $table_ref:ident, $one:literal, $several:literal;)*) => {
        /// An instance of a component of any kind.
        pub enum Instance {
            $(
                #[doc = concat!("A ", $one, ".")]
                $kind(Box<dyn crate::kinds::$name::$kind>),
            )*
        }

        impl Instance {
            /// The kind of the component.
            pub fn kind(&self) -> Kind {
                match self {
                    $(Instance::$kind(_) => Kind::$kind,)*
                }
            }
        }

        impl Module {
            /// Makes an instance of the component of this kind with this place in the description, from its parameters as a JSON object.
            ///
            /// # Errors
            /// If the component refuses the parameters or panics, or fails at once, such as a simulator that has no camera.
            pub fn create(&self, kind: Kind, index: usize, parameters: &str) -> Result<Instance> {
                Ok(match kind {
                    $(Kind::$kind => {
                        // A plugin of an SDK that did not have the kind yet has no such function.
                        let make: Option<Make<pdk_abi::$table_ref>> = self.plugin.$name().into();
                        let (pointer, functions) = make_instance(needed(make, stringify!($name))?, index, parameters)?;
                        let object = Object::new(pointer, functions, functions.drop());
                        Instance::$kind(Box::new(crate::kinds::$name::Host::new(object)?))
                    })*
                })
            }
        }
    };
}

each_kind!(instances);
