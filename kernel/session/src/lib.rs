//! Scenarios to outcomes.
//!
//! A [`session`] lives as long as a pipeline. It takes scenarios, frames of datasets and questions about components, gives them to
//! workers, writes the ledger, and hands out what came of them, as it comes or in the order of submission.
//!
//! A [`worker`] is a process of its own, and so is what it supervises: the loop process (`pdk-loop`) loads components and calls them. So
//! nothing that a component does reaches further than the scenario at hand: a crash, an exit, a hang or a lack of memory becomes that
//! scenario's outcome, and the next scenario gets a new process. When the session is gone, workers leave and take along what they started.
//!
//! ```text
//! session ── JSON lines ──► worker ── JSON lines ──► loop process: simulator ► perturbations ► driver
//!    │ ledger                  │ watches, answers for it    │ trace, topics in shared memory
//! ```
//!
//! | module | subject |
//! |---|---|
//! | [`session`] | the handle that a pipeline holds; `dispatch` is its thread: jobs to workers, outcomes to the ledger |
//! | [`submission`] | what goes in and comes out |
//! | [`connection`] | the session's end of a conversation; where workers come from |
//! | [`worker`] | answers every job, whatever its process does |
//! | [`interrupt`] | Ctrl-C |

pub mod connection;
mod dispatch;
pub mod interrupt;
pub mod session;
pub mod submission;
pub mod worker;
