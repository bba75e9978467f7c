//! A pipeline that is a tool of pdk: it submits scenarios and decides by their outcomes, on the same host as pipelines in Lua, so that
//! its record is like any other and can be continued.

use std::path::{Path, PathBuf};

use pdk_components::catalog::Catalog;
use pdk_loop::protocol::{EvaluateFrames, EvaluatedFrame};
use pdk_model::component::ComponentSpec;
use pdk_model::outcome::Outcome;
use pdk_model::scenario::Scenario;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, Result};
use pdk_session::session::{Session, Submission, Ticket};
use serde::Serialize;
use serde_json::Value;

use crate::finished::Finished;
use crate::host::Host;
pub use crate::host::recordings::frames_of;
use crate::readers::Recording;
use crate::run::{Options, Script, start};
pub use crate::used::Used;

/// The text that a tool runs, for the record.
#[derive(Debug, Clone)]
pub struct Text {
    /// Its file, or its name if it is part of pdk. The folder of the record is named after it.
    pub path: PathBuf,
    /// The text itself.
    pub source: String,
    /// The folder in which it lies; none if it is part of pdk.
    pub folder: Option<PathBuf>,
}

/// A tool while it runs.
pub struct Program {
    host: Host,
}

impl Program {
    /// Starts a session for a tool; `what` is what errors call the tool.
    ///
    /// # Errors
    /// If no worker can be started, or only a part of the run is wanted.
    pub fn start(what: &str, text: Text, options: Options) -> Result<Self> {
        let Text { path, source, folder } = text;
        let host = start(Script::of_tool(path, source, folder), Box::new(|_| Vec::new()), options)?;
        host.refuse_shard(what)?;
        Ok(Self { host })
    }

    /// The components there are.
    pub fn catalog(&mut self) -> &Catalog {
        self.host.session().catalog()
    }

    /// The session, for what is asked besides the scenarios of the run.
    pub fn session(&mut self) -> &mut Session {
        self.host.session()
    }

    /// Makes sure that a component can be made, before anything is recorded. One that panics or ends its process then is the outcome of the scenarios that
    /// need it.
    ///
    /// # Errors
    /// If it cannot be made.
    pub fn check(&mut self, kind: Kind, component: &ComponentSpec) -> Result<()> {
        self.host.try_to_make(kind, component).map(drop)
    }

    /// Notes the settings of the run, before the first scenario.
    ///
    /// # Errors
    /// If they were noted before.
    pub fn settings(&mut self, settings: Value) -> Result<()> {
        self.host.settings(settings).map(drop)
    }

    /// Puts into a scenario what it leaves to the machine, so that it has its id.
    pub fn settle(&mut self, scenario: &mut Scenario) {
        self.host.settle(scenario);
    }

    /// Submits a scenario.
    ///
    /// # Errors
    /// If a component cannot be made, or the record cannot be written or is that of another run.
    pub fn submit(&mut self, submission: Submission) -> Result<Ticket> {
        self.host.submit_one(submission)
    }

    /// Waits for what came of a scenario.
    ///
    /// # Errors
    /// If the session cannot go on.
    pub fn wait(&mut self, ticket: Ticket) -> Result<Outcome> {
        self.host.outcome(ticket)
    }

    /// Opens a recording: a folder, a file, or a reader with its parameters. Its files are noted.
    ///
    /// # Errors
    /// If no reader opens it.
    pub fn recording(&mut self, dataset: &Value) -> Result<Recording> {
        self.host.recording(dataset)
    }

    /// Makes sure that the components can be made that frames of a recording need, notes them in the record, and returns its folder.
    ///
    /// # Errors
    /// If a component cannot be made, or the record cannot be written or is that of another run.
    pub fn use_for(&mut self, frames: &EvaluateFrames) -> Result<&Path> {
        self.host.use_for_frames(frames)?;
        let none = || Error::new("the record has no folder, which is a defect in pdk");
        self.host.folder().ok_or_else(none)
    }

    /// Submits frames of a recording for a driver.
    pub fn evaluate(&mut self, frames: EvaluateFrames) -> Ticket {
        self.host.evaluate_frames(frames)
    }

    /// Waits for what frames came to, one for each.
    ///
    /// # Errors
    /// If a component took its process along, or the session cannot go on.
    pub fn evaluated(&mut self, ticket: Ticket) -> Result<Vec<EvaluatedFrame>> {
        self.host.evaluated(ticket)
    }

    /// What the run has used so far.
    pub fn used(&self) -> Used {
        self.host.used()
    }

    /// The folder of the record, once something was submitted.
    pub fn record(&self) -> Option<&Path> {
        self.host.folder()
    }

    /// Writes a file into the record.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn save(&self, name: &str, value: &impl Serialize) -> Result<()> {
        self.host.write(name, value)
    }

    /// Completes the record; `ended` is what the tool came to.
    pub fn finish(self, ended: Result<()>) -> Finished {
        self.host.finish(ended)
    }
}
