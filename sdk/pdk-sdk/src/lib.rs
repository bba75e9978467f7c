#![doc = include_str!("../README.md")]
//!
//! The SDK takes care of the rest: the interface that crosses the library boundary and its version check, panics
//! (they become errors inside the plugin and never reach the host), parameter checks, and the [`testing`] kit. The values
//! that components take and return, such as scenarios, states and controls, are those of [`model`].

pub mod abi;
pub mod bursts;
pub mod cache;
pub mod camera;
pub mod component;
pub mod config;
pub mod describe;
mod earlier_maps;
mod export;
pub mod file;
pub mod form;
pub mod ground;
pub mod history;
pub mod input_files;
mod kinds;
pub mod level_scales;
pub mod signals;
pub mod suggest;
pub mod testing;
pub mod timeline;

pub use kinds::*;
pub use pdk_abi::each_kind;
pub use pdk_model as model;
pub use pdk_model::error;
pub use pdk_ops as ops;
pub use pdk_seed as seed;
pub use serde_json;

/// The version of the SDK, which a plugin tells. What decides whether a plugin can be used is [`abi::pdk_abi::VERSION`].
pub const SDK_VERSION: &str = env!("CARGO_PKG_VERSION");

/// Everything a component usually needs.
pub mod prelude {
    pub use crate::component::Component;
    pub use crate::config::Config;
    pub use crate::describe::{ActsOn, Description, Geometry, Kind, Parameter, Role, Temporal};
    pub use crate::error::{Error, ErrorKind, Result};
    pub use crate::form::{Form, FormFile, Perturb, Rewrite};
    pub use crate::history::{Earlier, History};
    pub use crate::input_files::InputFiles;
    pub use crate::kinds::traits::*;
    pub use crate::signals::{Signal, Signals};
    pub use pdk_ops::{Frame, FrameBuf, FrameMut};
    pub use pdk_seed::{Key, Random};
}
