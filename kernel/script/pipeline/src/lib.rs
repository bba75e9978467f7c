//! Pipelines: Lua files that say what to drive or evaluate, run with `pdk run`, and programs in other languages that say it line by line.
//!
//! A pipeline executes in the session's own process, which calls no component: scenarios, frames and questions about components
//! go to workers. Everything it can call is registered in [`api`], from which the type definitions for editors are written.
//!
//! | module | subject |
//! |---|---|
//! | [`mod@run`] | runs a pipeline to its end |
//! | [`remote`] | a pipeline that is another program |
//! | [`program`] | a pipeline that is a tool of pdk |
//! | [`finished`], `outcomes` | what a run came to, and each of its scenarios |
//! | [`follow`] | to whom progress is reported |
//! | [`api`] | what a pipeline can call; `session_object` is what `pdk.session` returns; both over `bridge` |
//! | [`host`] | what stands behind it: settings, session, record |
//! | `requests` | what a pipeline writes, as scenarios and evaluations; `fields` reads tables, `given_road` checks roads, `values` crosses from Lua |
//! | `tickets` | what stands for scenarios that were submitted |
//! | `naming` | the names of runs on their topics |
//! | `levels` | levels that are functions of time |
//! | `search` | `pdk.search`: a strategy proposes, a function of the pipeline evaluates |
//! | `evaluation` | the offline loop: frames to lines and sums; [`readers`] finds which dataset reader a recording needs |
//! | [`run_settings`] | what can be set for every run |
//! | [`settings`] | the settings of a pipeline, and `--set` |
//! | [`road`] | `pdk.road` |
//! | `statistics` | how sure a conclusion is |
//! | [`table`], `tables` | results and free tables for people |
//! | [`records`] | the tables that pipelines write and read, as types for editors; `python` writes the keyword arguments of Python |

pub mod api;
mod bridge;
mod evaluation;
mod fields;
pub mod finished;
pub mod follow;
mod given_road;
pub mod host;
mod levels;
mod naming;
mod outcomes;
pub mod program;
#[cfg(test)]
mod python;
pub mod readers;
pub mod records;
pub mod remote;
mod requests;
pub mod road;
pub mod run;
pub mod run_settings;
mod scored;
mod search;
mod session_object;
pub mod settings;
mod statistics;
pub mod table;
mod tables;
mod task;
mod tickets;
mod used;
mod values;
