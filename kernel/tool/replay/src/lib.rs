//! Replays recorded scenarios from their record alone, and says whether everything is as it was, bit for bit.
//!
//! Nothing of the pipeline runs. A line of the ledger holds a scenario as a value, with everything that decides its outcome, and
//! that value goes to a session like any other: its workers drive it, in processes of their own, so that a component that ends its
//! process comes out as it did in the run. The session records nothing; each scenario leaves a trace in a temporary folder, which
//! is compared with the recorded one step by step: state, hash of the frame that the driver saw, control. Then the outcomes
//! are compared. In real time the record says which frames the driver did not see, and the replay lets the same ones go by.
//!
//! ```text
//! ledger ── scenarios ──► session ──► traces, outcomes ──┐
//!    └──── traces, outcomes ─────────────────────────────┴── compare ──► equal, or the first difference
//! ```
//!
//! | module | subject |
//! |---|---|
//! | [`recorded`] | the scenarios of a record, by number or id |
//! | [`replay`] | opens a record and drives its scenarios again |
//! | [`parts`] | what is different since then of pdk, components and files, and where these are looked for |
//! | [`compare`] | two traces and two outcomes |
//! | [`shrink`] | the simplest scenario that still fails like a recorded one |
//! | [`why`] | the smallest parts of a drive that are proven to make it fail, and to be needed for that; `smallest` searches for them |
//! | [`drives`] | drives that leave an outcome alone, which the two above consist of |
//! | [`clip`] | a video of one scenario, made from its new trace; [`pair`] one of two beside each other; `gauge` draws the quantities below the frames |
//!
//! The findings of a replay are data ([`compare::Compared`]); that a difference makes the command fail is for the command line
//! to decide. The record is only read.

pub mod clip;
pub mod compare;
pub mod drives;
mod gauge;
pub mod pair;
pub mod parts;
pub mod recorded;
pub mod replay;
pub mod shrink;
pub mod smallest;
pub mod why;
