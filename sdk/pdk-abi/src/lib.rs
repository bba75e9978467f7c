//! What crosses the boundary between pdk and a plugin: plain C layouts and numbers, and nothing else.
//!
//! Authors and users never meet this crate: the SDK makes it into traits on both sides. It has a version of its own, so that a
//! plugin stays usable for as long as that is the same, whatever becomes of pdk and its SDK. What may change without a new
//! version, and how, is told in `docs/abi.md`; `src/layout.rs` fails where something else has changed.
//!
//! 1. A plugin is a dynamic library that exports one object, a [`Header`], under the name [`SYMBOL`]. A host reads its version
//!    first, and nothing else where that is not its own.
//! 2. Behind it lies a [`Plugin`]: one function describes the plugin and its components, one makes instances.
//! 3. An [`Instance`] is a pointer for the plugin, and a table of the functions of its [`kind`].
//!
//! Every structure but [`Header`], [`Text`] and [`Status`] begins with its size and crosses by pointer. Whoever reads one takes as much
//! as both sides know ([`load`]), and whoever fills one in writes no more than that ([`store`]); what the other side does not
//! know keeps a value that says nothing. Descriptions, configuration and whatever is no concern of a single frame cross as JSON.
//! Memory is never handed over: who has a text or pixels of unknown length to give writes them to a [`Sink`] of the other side.
//!
//! An instance is used by one thread at a time, not always by the same one. A function must not unwind.

#![cfg_attr(not(test), no_std)]

mod declare;
mod fixed;
mod header;
#[cfg(test)]
mod layout;
mod prefix;
mod sized;

pub use fixed::{Status, Text, annotation, kind, status};
pub use header::Header;
pub use prefix::{Prefix, empty, load, store};
pub use sized::{
    Camera, Control, DatasetFunctions, DriveContext, DriverFunctions, Entry, Frame, FrameMut, Heatmap,
    Instance, MapContext, MapSize, MaskFunctions, PerturbationContext, PerturbationFunctions, Plugin,
    SaliencyFunctions, SearchFunctions, SimulatorFunctions, Sink, State, map_flag, state_flag,
};

/// The version of the interface. A host takes the plugins of its own version.
pub const VERSION: u64 = 1;

/// The name of the object that a plugin exports: its [`Header`].
pub const SYMBOL: &str = "pdk_plugin";

// The example in the README compiles.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
