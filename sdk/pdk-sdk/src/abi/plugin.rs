//! The plugin's side of the boundary: wraps the author's types, and turns their panics into errors before they reach it.

pub(crate) mod call;
mod guard;
mod module;
mod registrations;

pub use module::{LibHeader, header};
pub use registrations::*;
