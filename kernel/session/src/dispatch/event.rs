//! The messages to the session's thread.

use std::sync::mpsc::Sender;

use pdk_loop::lines::Found;
use pdk_loop::protocol::{FromWorker, Work};
use pdk_sdk::error::Result;

use super::book::Record;
use crate::submission::{Submission, Ticket};

/// A message to the thread.
pub enum Event {
    /// A request.
    Submit(Ticket, Request),
    /// Record scenarios from now on.
    Record(Record),
    /// Put the ledger in order.
    Finish(Sender<Result<()>>),
    /// No more requests come.
    Close,
    /// A worker says something, on this connection.
    Worker(u64, Found<FromWorker>),
}

/// A request.
pub enum Request {
    /// A scenario, to be recorded.
    Submission(Box<Submission>),
    /// Anything else.
    Work(Box<Work>),
}
