//! Datasets, frame by frame.

use std::path::Path;

use pdk_loop::protocol::{Evaluation, Made};
use pdk_model::component::ComponentSpec;
use pdk_record::directory::{RESULTS, RunDirectory};
use pdk_record::manifest::{EvaluationRecord, components_of_all};
use pdk_record::merge::EvaluatedFrames;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, Result};
use serde_json::Value;

use super::Host;
use super::driving::components;
use crate::evaluation::{self, Results};
use crate::follow::Progress;
use crate::requests::{DatasetSpec, Evaluate};

/// What evaluations came to.
#[derive(Default)]
pub(super) struct Evaluations {
    /// What the pipeline got back.
    pub summaries: Vec<Value>,
    /// What each of them went through.
    pub frames: Vec<EvaluatedFrames>,
    /// How long each took.
    pub times: Vec<Value>,
    /// The file with the results, once there is one.
    results: Option<Results>,
}

impl Host {
    /// `pdk.evaluate`: the offline loop.
    pub(crate) fn evaluate(&mut self, request: Value) -> Result<Value> {
        let Evaluate { dataset, mut driver, mut cells, frames } = Evaluate::from_json(request)?;
        let mut settler = self.settler();
        settler.component(Kind::Driver, &mut driver);
        settler.perturbations(&mut cells);
        let (reader, available) = self.open_dataset(&dataset)?;
        let info = self.make(Kind::Driver, &driver)?.info;
        for component in components(&cells) {
            self.make(Kind::Perturbation, &component)?;
        }
        self.note_files(Kind::Dataset, &reader)?;
        self.note_files(Kind::Driver, &driver)?;
        for (kind, component) in components_of_all(&cells) {
            self.note_files(kind, &component)?;
        }
        let catalog = self.session.catalog();
        self.record.in_use.add(catalog, Kind::Dataset, &reader.name, &reader.parameters, Vec::new())?;
        self.record.in_use.add(catalog, Kind::Driver, &driver.name, &driver.parameters, info)?;
        self.record.in_use.add_perturbations(catalog, &cells)?;
        self.record.evaluations.push(EvaluationRecord { dataset: reader.clone(), driver: driver.clone() });
        self.begin()?;
        let results = match &mut self.evaluations.results {
            Some(results) => results,
            None => {
                let folder = self.record.directory.as_ref().map(RunDirectory::path).unwrap_or(Path::new(""));
                self.evaluations.results.insert(Results::open(&folder.join(RESULTS))?)
            }
        };
        let frames = frames.unwrap_or(usize::MAX).min(available);
        let (shard, number) = (self.setup.common.shard, self.evaluations.summaries.len() as u64);
        let own = shard.map_or(frames, |shard| shard.own(frames).count());
        self.evaluations
            .frames
            .push(EvaluatedFrames { frames, cells: cells.iter().map(ToString::to_string).collect() });
        let bar = Progress::new(self.setup.audience, "{pos}/{len} frames, {eta} left");
        bar.add(own as u64);
        let job = evaluation::Job {
            evaluation: Evaluation {
                dataset: reader,
                driver,
                perturbations: cells,
                seed: self.setup.common.seed,
            },
            frames,
            shard,
            number,
            workers: self.session.slots(),
            results,
            progress: &mut |done| bar.set(done),
        };
        let evaluated = evaluation::evaluate(&mut self.session, job);
        bar.finish();
        let (summary, performance) = evaluated?;
        for bad in &summary.bad_frames {
            self.account.warnings.push(format!("{} was left out: {}", bad.frame, bad.error));
        }
        let summary = serde_json::to_value(summary)?;
        self.evaluations.summaries.push(summary.clone());
        if performance.perturbed_frames > 0 {
            self.account.speed.push(format!(
                "{} perturbed frames in {:.1} s: {:.0} a second",
                performance.perturbed_frames, performance.wall_seconds, performance.frames_per_second
            ));
        }
        self.evaluations.times.push(serde_json::to_value(performance)?);
        Ok(summary)
    }

    /// The reader of a dataset, and how many frames it finds.
    fn open_dataset(&mut self, dataset: &DatasetSpec) -> Result<(ComponentSpec, usize)> {
        let frames = |made: Made| made.frames.unwrap_or_default();
        let path = match dataset {
            DatasetSpec::Reader(reader) => {
                return Ok((reader.clone(), frames(self.make(Kind::Dataset, reader)?)));
            }
            DatasetSpec::Path(path) => path,
        };
        let mut reasons = Vec::new();
        for reader in self.session.catalog().readers(path) {
            match self.make(Kind::Dataset, &reader) {
                Ok(made) => return Ok((reader, frames(made))),
                Err(error) => reasons.push(error.to_string()),
            }
        }
        Err(Error::new(match reasons.is_empty() {
            true => format!("cannot open the dataset {path}: no dataset reader is installed"),
            false => format!("cannot open the dataset {path}: {}", reasons.join("; ")),
        }))
    }
}
