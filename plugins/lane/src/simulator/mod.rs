//! The simulator of this crate.

mod lane;

pub use lane::Lane;
