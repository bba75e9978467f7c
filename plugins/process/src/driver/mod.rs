//! The driver of this crate.

mod process;

pub use process::Process;
