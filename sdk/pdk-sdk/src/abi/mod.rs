//! The two sides of the boundary between pdk and a plugin, which is that of [`pdk_abi`].
//!
//! Authors and users never meet this module: [`export!`](crate::export) writes the plugin's side ([`plugin`]), and
//! the host turns what it finds there back into the traits of the SDK ([`host`]). Frames cross as pointer, length, width,
//! height and stride; parameters and descriptions cross as JSON; nothing is converted or allocated per frame.

pub(crate) mod convert;
pub mod host;
pub mod plugin;

pub use pdk_abi;

/// What a plugin says of itself.
#[derive(Debug, Clone, Default, PartialEq, serde::Serialize, serde::Deserialize)]
pub struct PluginDescription {
    /// The plugin's name.
    pub name: String,
    /// The plugin's own version.
    pub version: String,
    /// The version of the SDK that it was built with.
    #[serde(default)]
    pub sdk: String,
    /// Where to get it: `homepage` or else `repository` of its package; empty if it has neither.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub homepage: String,
    /// Its components.
    pub components: Vec<crate::describe::Description>,
}
