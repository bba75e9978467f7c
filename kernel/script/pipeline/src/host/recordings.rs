//! Recordings whose frames a tool picks itself, which `pdk.evaluate` does not.

use pdk_loop::protocol::{EvaluateFrames, Evaluated, EvaluatedFrame, Subject};
use pdk_model::component::ComponentSpec;
use pdk_record::manifest::components_of_all;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, Result};
use pdk_session::session::{Reply, Ticket};
use serde_json::Value;

use super::Host;
use super::components::key;
use super::driving::{components, stop_if_dropped};
use crate::readers::{self, Recording};
use crate::requests::DatasetSpec;

impl Host {
    /// Opens a recording, which is a folder, a file or a reader with its parameters, and notes its files.
    pub(crate) fn recording(&mut self, dataset: &Value) -> Result<Recording> {
        let mut dataset = DatasetSpec::from_json(dataset)?;
        if let DatasetSpec::Reader(reader) = &mut dataset {
            self.settler().component(Kind::Dataset, reader);
        }
        let (mut reader, made) = self.open_dataset(&dataset)?;
        self.settler().component(Kind::Dataset, &mut reader);
        self.note_files(Kind::Dataset, &reader)?;
        let told: Vec<String> = made
            .info
            .iter()
            .map(|(name, value)| format!("dataset {}: {name}: {value}", reader.name))
            .collect();
        let catalog = self.session.catalog();
        self.record.in_use.add(
            catalog,
            Kind::Dataset,
            &reader.name,
            &reader.parameters,
            made.info.clone(),
        )?;
        let content = self.content(&reader)?;
        told.iter().for_each(|line| self.print(line));
        Ok(Recording { reader, made, content })
    }

    /// The hash of what is in a recording whose files have been noted.
    pub(super) fn content(&mut self, reader: &ComponentSpec) -> Result<String> {
        let key = key(Kind::Dataset, reader)?;
        if let Some(content) = self.components.recordings.get(&key) {
            return Ok(content.clone());
        }
        let groups = self.session.input_files(Kind::Dataset, reader)?;
        let content = readers::content(reader, &groups, &self.record.in_use)?;
        self.components.recordings.insert(key, content.clone());
        Ok(content)
    }

    /// Makes sure that the components can be made that frames of a recording need, and notes them.
    pub(crate) fn use_for_frames(&mut self, job: &EvaluateFrames) -> Result<()> {
        stop_if_dropped()?;
        let Subject::Driver(driver) = &job.subject else {
            return Err(Error::new("frames are given to a predictor, which is a defect in pdk"));
        };
        let info = self.make(Kind::Driver, driver)?.info;
        let applied = job.perturbation.as_slice();
        for component in components(applied) {
            self.make(Kind::Perturbation, &component)?;
        }
        self.note_files(Kind::Driver, driver)?;
        for (kind, component) in components_of_all(applied) {
            self.note_files(kind, &component)?;
        }
        let catalog = self.session.catalog();
        self.record.in_use.add(catalog, Kind::Driver, &driver.name, &driver.parameters, info)?;
        self.record.in_use.add_perturbations(catalog, applied)?;
        self.begin()
    }

    /// Submits frames of a recording for a driver.
    pub(crate) fn evaluate_frames(&mut self, job: EvaluateFrames) -> Ticket {
        self.frames.expect((job.end - job.from) as u64);
        self.session.evaluate(job)
    }

    /// Waits for what frames came to.
    pub(crate) fn evaluated(&mut self, ticket: Ticket) -> Result<Vec<EvaluatedFrame>> {
        let reply = self.session.wait(ticket, &mut self.frames.tick(None, 0))?;
        frames_of(reply)
    }
}

/// The frames that a job came to.
///
/// # Errors
/// How a component failed.
pub fn frames_of(reply: Reply) -> Result<Vec<EvaluatedFrame>> {
    match reply {
        Reply::Evaluated(evaluated) => {
            let Evaluated { frames, .. } = *evaluated;
            Ok(frames)
        }
        Reply::Failed(failure) => Err(failure.into()),
        _ => Err(Error::new("frames came to something else, which is a defect in pdk")),
    }
}
