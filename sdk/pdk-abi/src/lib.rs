//! What crosses the boundary between pdk and a plugin.
//!
//! Authors and users never meet this crate: the SDK makes it into traits on both sides. It has a version of its own, so that a
//! plugin stays usable for as long as the major version is the same, whatever becomes of pdk and its SDK. `docs/abi.md` says what may
//! change without a new version, and how.
//!
//! 1. A plugin is a dynamic library with a header and a root module of [abi_stable]. The root module is [`Plugin`]: one function
//!    describes the plugin and its components, and there is one for each kind that makes instances.
//! 2. An [`Instance`] is a pointer for the plugin, and the table of the functions of its kind.
//! 3. abi_stable proves that the tables and functions of a library are those of the host, when the library is opened. Tables may
//!    grow at their end.
//! 4. The values of a call cross by pointer, in structures that begin with their size and may grow at their end, which abi_stable
//!    cannot do. A reader takes as much as both sides know ([`load`]), and a writer writes no more than that
//!    ([`store`]). What the other side does not know keeps a neutral value. `src/layout.rs` fails if they change in another way.
//!
//! Descriptions, configuration and whatever does not concern a single frame cross as JSON. Memory is never handed over: a side that
//! has a text or pixels of unknown length to give writes them to a [`Sink`] of the other side.
//!
//! An instance is used by one thread at a time, not always by the same one.

mod declare;
mod fixed;
mod functions;
#[cfg(test)]
mod layout;
mod prefix;
mod sized;

pub use abi_stable;
pub use fixed::{Status, Text, annotation, status, way};
pub use functions::*;
pub use prefix::{Prefix, empty, load, store};
pub use sized::{
    Camera, Control, DriveContext, Entry, Frame, FrameMut, Heatmap, MapContext, MapSize, PerturbationContext,
    Perturber, Position, Sink, State, map_flag, state_flag,
};

/// The version of the interface, which is the major version of this package. A host takes the plugins of its own version.
pub const VERSION: u64 = 1;

// The example in the README compiles.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
