//! The record of a run: what was driven, with what, and what came of it.
//!
//! What decides an outcome is a value (`pdk_model::scenario::Scenario`): nothing is drawn from a clock, a counter or a place in a list.
//!
//! | module | subject |
//! |---|---|
//! | [`directory`] | the folder of a run |
//! | [`ledger`] | one line for each outcome, append-only, on [`lines`] |
//! | [`manifest`] | what was run, with the [`files`] that it read; `inputs` makes one hash of the files of a dataset and the like |
//! | [`evaluated`] | what an evaluation of a dataset goes through |
//! | [`located`] | where these files are, as seen from here |
//! | [`settle`] | what a scenario leaves to the machine, put into it |
//! | [`times`] | how long the stages of the loop took |
//! | [`trace`] | what happened in a scenario, frame by frame |

pub mod directory;
pub mod evaluated;
pub mod files;
mod inputs;
pub mod ledger;
pub mod lines;
pub mod located;
pub mod manifest;
pub mod settle;
pub mod times;
pub mod trace;
