//! What a tool of pdk that drives scenarios needs of the host besides what pipelines call.

use std::path::Path;

use pdk_model::outcome::Outcome;
use pdk_model::scenario::Scenario;
use pdk_record::directory::RunDirectory;
use pdk_sdk::error::{Error, ErrorKind, Result};
use pdk_session::session::{Session, Ticket};
use serde::Serialize;

use super::Host;
use crate::used::Used;

impl Host {
    /// The session.
    pub(crate) fn session(&mut self) -> &mut Session {
        &mut self.session
    }

    /// Puts into a scenario what it leaves to the machine, so that it has its id.
    pub(crate) fn settle(&mut self, scenario: &mut Scenario) {
        self.settler().scenario(scenario);
    }

    /// Waits for what came of a scenario.
    ///
    /// # Errors
    /// If it came to nothing.
    pub(crate) fn outcome(&mut self, ticket: Ticket) -> Result<Outcome> {
        self.wait(ticket)?;
        match self.scenarios.outcomes.get(&ticket) {
            Some(Ok(Some(came))) => came.outcome.read(),
            Some(Err(error)) => Err(error.clone()),
            _ => Err(Error::new("a scenario came to nothing, which is a defect in pdk")),
        }
    }

    /// What the run has used so far.
    pub(crate) fn used(&self) -> Used {
        Used { components: self.record.in_use.components(), settled: self.components.settled.clone() }
    }

    /// The folder of the record, once it was begun.
    pub(crate) fn folder(&self) -> Option<&Path> {
        self.record.directory.as_ref().map(RunDirectory::path)
    }

    /// Writes a file into the record, which has to be begun.
    ///
    /// # Errors
    /// If it cannot be written.
    pub(crate) fn write(&self, name: &str, value: &impl Serialize) -> Result<()> {
        self.record.directory.as_ref().map_or(Ok(()), |directory| directory.write_json(name, value))
    }

    /// Refuses a part of a run that decides by outcomes.
    pub(crate) fn refuse_shard(&self, what: &str) -> Result<()> {
        match self.setup.common.shard {
            None => Ok(()),
            Some(_) => Err(Error::of(
                ErrorKind::Configuration,
                format!(
                    "{what} decides by outcomes what to drive next, so a part of it cannot be run alone; leave out --shard"
                ),
            )),
        }
    }
}
