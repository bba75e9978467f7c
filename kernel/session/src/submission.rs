//! What goes into a session, and what comes out of it.

use std::collections::BTreeMap;
use std::sync::Arc;
use std::sync::mpsc::Sender;

use pdk_components::search_path::SearchPath;
use pdk_model::outcome::Outcome;
use pdk_model::scenario::{Scenario, ScenarioId};
use pdk_model::search::Candidate;
use pdk_record::directory::RunDirectory;
use pdk_record::ledger::Ledger;
use pdk_sdk::error::Result;
use pdk_sdk::input_files::InputFiles;
use pdk_supervise::supervisor::Limits;
use serde::{Deserialize, Serialize};

use crate::connection::Pool;
use pdk_loop::lines::Found;
use pdk_loop::protocol::{Driven, Evaluated, Failure, FromWorker, Made, Work};
use pdk_loop::stages::Times;

/// How a session works.
#[derive(Debug, Clone)]
pub struct Options {
    /// The name of the run on the topics: letters, digits, dashes and underscores, unique on this machine.
    pub run: String,
    /// Where workers come from.
    pub pool: Pool,
    /// What the processes with components are held to.
    pub limits: Limits,
    /// Where components are looked for besides the usual places.
    pub search: SearchPath,
}

/// A scenario to drive and record.
#[derive(Debug, Clone, Serialize, Deserialize)]
pub struct Submission {
    /// What to drive.
    pub scenario: Scenario,
    /// What it is called.
    pub name: String,
    /// Every how many frames an image goes into the trace; 0 for none.
    pub images_every: u64,
}

impl Submission {
    /// As it waits.
    ///
    /// # Errors
    /// If it cannot be JSON, which is a defect in pdk.
    pub fn waiting(&self) -> Result<WaitingSubmission> {
        Ok(WaitingSubmission { id: self.scenario.id(), text: serde_json::to_string(self)?.into() })
    }
}

/// A submission as a text, which takes less memory: many may wait.
#[derive(Debug, Clone)]
pub struct WaitingSubmission {
    /// The id of the scenario.
    pub id: ScenarioId,
    text: Box<str>,
}

impl WaitingSubmission {
    /// Reads it.
    pub(crate) fn read(&self) -> Result<Submission> {
        Ok(serde_json::from_str(&self.text)?)
    }
}

/// An outcome as a text, which takes less memory: a run may have many.
#[derive(Debug, Clone)]
pub struct WrittenOutcome(Arc<str>);

impl WrittenOutcome {
    /// Writes it.
    pub(crate) fn new(outcome: &Outcome) -> Result<Self> {
        Ok(Self(serde_json::to_string(outcome)?.into()))
    }

    /// Reads it.
    ///
    /// # Errors
    /// None that is not a defect in pdk.
    pub fn read(&self) -> Result<Outcome> {
        Ok(serde_json::from_str(&self.0)?)
    }
}

/// Where scenarios are recorded.
pub(crate) struct Record {
    /// The folder.
    pub directory: RunDirectory,
    /// The ledger in it.
    pub ledger: Ledger,
    /// Whether scenarios in which a component failed in an earlier session are answered from the ledger, rather than driven again.
    pub keep_errors: bool,
}

/// A message to the session's thread.
pub(crate) enum Event {
    /// A request.
    Submit(Ticket, Request),
    /// Record scenarios from now on.
    Record(Record),
    /// Put the ledger in order.
    Finish(Sender<Result<()>>),
    /// No more requests come.
    Close,
    /// A worker says something, on this connection.
    Worker(u64, Box<Found<FromWorker>>),
}

/// A request.
pub(crate) enum Request {
    /// A scenario, to be recorded.
    Submission(WaitingSubmission),
    /// Anything else.
    Work(Box<Work>),
}

/// Stands for something that was submitted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Ticket(pub(crate) u64);

/// What something that was submitted came to.
#[derive(Debug, Clone)]
pub enum Reply {
    /// A scenario that was recorded: its outcome, and whether that was in the ledger before the session.
    Recorded(WrittenOutcome, bool),
    /// A scenario that was driven without being recorded.
    Driven(Box<Driven>),
    /// Frames of a dataset.
    Evaluated(Box<Evaluated>),
    /// A component.
    Made(Made),
    /// The files that a component would read.
    InputFiles(Vec<InputFiles>),
    /// Candidates of a search.
    Proposed(Vec<Candidate>),
    /// A scenario that another process drives.
    Elsewhere,
    /// A component failed, so that there is no result.
    Failed(Failure),
}

/// What all scenarios took together.
#[derive(Debug, Clone, Default)]
pub struct Performance {
    /// The stages of all steps.
    pub times: Times,
    /// Simulated time in seconds.
    pub simulated_seconds: f64,
    /// Wall time in seconds in which at least one worker was at work.
    pub wall_seconds: f64,
    /// The most slots that were at work at the same time.
    pub slots: usize,
    /// What was noticed, such as a component that changed the working directory, and after how many jobs.
    pub warnings: BTreeMap<String, u64>,
}

impl Performance {
    /// A sentence about each thing that was noticed.
    pub fn noticed(&self) -> impl Iterator<Item = String> + '_ {
        self.warnings.iter().map(|(warning, times)| {
            let times = if *times == 1 { "once".to_owned() } else { format!("{times} times") };
            format!("{warning}, {times}")
        })
    }
}
