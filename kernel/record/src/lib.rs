//! The record of a run: what was driven, with what, and what came of it.
//!
//! What decides an outcome is a value (`pdk_model::scenario::Scenario`): nothing is drawn from a clock, a counter or a place in a list.
//!
//! | module | subject |
//! |---|---|
//! | [`directory`] | the folder of a run |
//! | [`ledger`] | one line an outcome, append-only, on [`lines`] |
//! | [`manifest`] | what was run; `inputs` makes one hash of the files of a dataset and the like |
//! | [`settle`] | what a scenario leaves to the machine, put into it |
//! | [`merge`] | runs in parts, and their records put together |
//! | [`trace`] | what happened in a scenario, frame by frame |

pub mod directory;
mod inputs;
pub mod ledger;
pub mod lines;
pub mod manifest;
pub mod merge;
pub mod settle;
pub mod trace;
