//! One page about a run of pdk: HTML that needs nothing besides itself, no network and no other file.
//!
//! What is known of the run goes in as plain data ([`Run`]); equal data make equal pages.

use std::fmt;

mod closed_loop;
mod color;
mod curve;
mod heat;
mod offline;
mod page;
mod road;
mod text;
mod view;

pub use closed_loop::worst_failures;
pub use page::render;
pub use text::address;
pub use view::*;

/// Why a page cannot be made.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Error(pub(crate) String);

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&self.0)
    }
}

impl std::error::Error for Error {}
