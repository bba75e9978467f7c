//! The record of a run as files for other tools.
//!
//! | module | subject |
//! |---|---|
//! | [`folder`] | a record as a folder of files: what goes where |
//! | `flat` | lines of a record as flat CSV, a column for each field |
//! | `telemetry` | all traces as flat CSV, a line for each frame |
//! | `tables` | the tables of the report as CSV, Markdown and LaTeX |
//! | [`odd`] | what was driven of an operational design domain; [`domain`] what stands for what |
//! | [`junit`] | scenarios, and what else is decided, as test cases |
//!
//! Equal records make equal files. A number that is not finite is an empty field.

pub mod domain;
mod flat;
pub mod folder;
pub mod junit;
pub mod odd;
mod tables;
mod telemetry;

pub use folder::{Kind, Written, write};
