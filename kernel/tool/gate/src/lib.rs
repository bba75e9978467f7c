//! Whether a new driver is worse than an old one.
//!
//! A suite says which scenarios are drawn and what is required: drives on roads, or blocks of recordings. Both drivers get each scenario under the
//! same luck, and the verdicts are looked at in the order of the suite until the decision is clear. The statistics allow one to look after every scenario
//! (`pdk_statistics::anytime`). The verdict is a file that anyone can check by driving a few scenarios again.
//!
//! ```text
//! suite ── hash, number ──► steps ──► gate: both drivers ──► judge ──► verdict
//!                             └───────► verify: some again ◄───────────┘
//! ```
//!
//! | module | subject |
//! |---|---|
//! | [`suite`] | what a suite says; [`requirement`] what it requires; `check` whether that makes sense |
//! | [`loaded`] | suites by their names or files |
//! | [`recording`] | blocks of recordings, which take the place of roads; [`stretch`] says which frames they are |
//! | [`series`] | where scenarios come from, and what they are drawn from |
//! | [`step`] | its scenarios, in order |
//! | [`judge`] | the decision, from what came of scenarios |
//! | [`repeats`] | simulators that do not repeat themselves: verdicts that are stable, and how often drives disagree |
//! | [`side`] | a driver that takes part; [`role`] which of the two it is |
//! | [`driven`] | how a scenario is given to a driver; [`came`] what comes of it; [`kept`] blocks in the record |
//! | [`gate`] | goes on until the decision is clear |
//! | [`verdict`] | the file with the verdict; `merkle` is the hash over it |
//! | [`verify`] | checks such a file; [`probes`] says which entries are driven again, and what that proves |
//! | [`shown`] | a verdict as a table, as Markdown and as JUnit XML |
//! | [`again`] | suites of what failed before |

pub mod again;
pub mod came;
mod check;
pub mod driven;
#[cfg(test)]
mod fixture;
pub mod gate;
pub mod judge;
pub mod kept;
pub mod loaded;
mod merkle;
pub mod probes;
pub mod recording;
pub mod repeats;
pub mod requirement;
pub mod role;
pub mod series;
pub mod shown;
pub mod side;
pub mod step;
pub mod stretch;
pub mod suite;
pub mod verdict;
pub mod verify;
