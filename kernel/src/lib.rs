//! The kernel of pdk: finds components, routes frames, hands out seeds and keeps the record.
//!
//! The binary `pdk` is a thin layer of command-line verbs over this library.

// First, because the modules after it use its macros.
#[macro_use]
pub mod output;

pub mod chain;
pub mod component;
mod description;
pub mod drive;
mod elf;
pub mod evaluate;
pub mod exit_guard;
pub mod loader;
pub mod lua;
pub mod picture;
pub mod pipeline;
pub mod preview;
pub mod record;
pub mod reference;
pub mod registry;
pub mod replay;
pub mod report;
pub mod suggest;
pub mod watchdog;
