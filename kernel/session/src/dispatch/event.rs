//! What the session's thread is told.

use std::sync::mpsc::Sender;

use pdk_loop::lines::Found;
use pdk_loop::protocol::{FromWorker, Work};
use pdk_sdk::error::Result;

use super::book::Record;
use crate::submission::{Submission, Ticket};

/// What the thread is told.
pub enum Event {
    /// Somebody wants something.
    Submit(Ticket, Request),
    /// Record scenarios from now on.
    Record(Record),
    /// Put the ledger in order.
    Finish(Sender<Result<()>>),
    /// Nobody wants anything any more.
    Close,
    /// A worker says something, on this connection.
    Worker(u64, Found<FromWorker>),
}

/// Something that somebody wants.
pub enum Request {
    /// A scenario, to be recorded.
    Submission(Box<Submission>),
    /// Anything else.
    Work(Box<Work>),
}
