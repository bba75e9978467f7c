//! Datasets, frame by frame.

use std::collections::BTreeMap;
use std::path::Path;

use crate::readers;
use pdk_loop::protocol::Made;
use pdk_model::component::ComponentSpec;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_record::directory::{RESULTS, RunDirectory};
use pdk_record::evaluated::EvaluationRecord;
use pdk_record::manifest::components_of_all;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, Result};
use serde_json::Value;

use super::Host;
use super::driving::components;
use crate::evaluation::{self, BadFrame, Evaluated, Evaluation, Performance, Results, Segment};
use crate::follow::Progress;
use crate::requests::{DatasetSpec, Evaluate};
use crate::table;
use crate::task::Request;

impl Host {
    /// `pdk.evaluate`: the offline loop.
    pub(crate) fn evaluate(&mut self, request: Value) -> Result<Value> {
        if Request::is(&request) {
            return self.evaluate_task(request);
        }
        let Evaluate { dataset, mut driver, mut cells, frames, trust, tolerance } =
            Evaluate::from_json(request)?;
        let mut settler = self.settler();
        settler.component(Kind::Driver, &mut driver);
        settler.perturbations(&mut cells);
        let (reader, Made { frames: available, sequences, info: told, .. }) = self.open_dataset(&dataset)?;
        let info = self.make(Kind::Driver, &driver)?.info;
        for component in components(&cells) {
            self.make(Kind::Perturbation, &component)?;
        }
        self.check_levels(&cells)?;
        self.note_files(Kind::Dataset, &reader)?;
        self.note_files(Kind::Driver, &driver)?;
        for (kind, component) in components_of_all(&cells) {
            self.note_files(kind, &component)?;
        }
        let catalog = self.session.catalog();
        // What was guessed is said before anything is computed from it.
        let lines: Vec<String> =
            told.iter().map(|(name, value)| format!("dataset {}: {name}: {value}", reader.name)).collect();
        self.record.in_use.add(catalog, Kind::Dataset, &reader.name, &reader.parameters, told)?;
        self.record.in_use.add(catalog, Kind::Driver, &driver.name, &driver.parameters, info)?;
        self.record.in_use.add_perturbations(catalog, &cells)?;
        let evaluation = Evaluation {
            dataset: reader,
            driver,
            cells,
            seed: self.setup.common.seed,
            frames: frames.unwrap_or(usize::MAX).min(available.unwrap_or_default()),
            sequences,
            shard: self.setup.common.shard,
            trust,
            tolerance,
        };
        let Evaluation { dataset, driver, cells, .. } = &evaluation;
        let files = self.named_files(dataset, (Kind::Driver, driver.clone()), cells)?;
        let own = evaluation.own().iter().map(Segment::len).sum();
        let record = EvaluationRecord {
            dataset: dataset.clone(),
            driver: Some(driver.clone()),
            predictor: None,
            task: None,
            perturbations: cells.clone(),
            frames: evaluation.frames,
            files,
        };
        let number = self.begin_evaluation(record, own)?;
        lines.iter().for_each(|line| self.print(line));
        let bar = Progress::new(self.setup.audience, "{pos}/{len} predictions, {eta} left");
        let all = (own * (evaluation.cells.len() + 1)) as u64;
        bar.add(all);
        // What is driven again because a process was lost does not count twice.
        let progress = &mut |done: u64| bar.set(done.min(all));
        self.results()?;
        let Some(results) = &mut self.evaluations.results else {
            return Err(Error::new("there is no file for results, which is a defect in pdk"));
        };
        let evaluated = evaluation::evaluate(&mut self.session, &evaluation, number, results, progress);
        bar.finish();
        let (summary, performance) = match evaluated? {
            Evaluated::Ranked(summary, performance) => (summary, performance),
            // The error says why.
            Evaluated::Refused(check, error) => {
                let check = check.unjudged();
                self.print(&table::check(&serde_json::to_value(check)?));
                return Err(error);
            }
        };
        self.conclude(&summary.bad_frames, serde_json::to_value(&summary)?, performance)
    }

    /// The files and folders that an evaluation names, each with the hash of its content. Those of the reader have been noted.
    pub(super) fn named_files(
        &mut self,
        reader: &ComponentSpec,
        subject: (Kind, ComponentSpec),
        cells: &[AppliedPerturbation],
    ) -> Result<BTreeMap<String, String>> {
        let content = self.content(reader)?;
        let mut settler = self.settler();
        let mut files = settler.listed_files(&subject.1);
        let mut components = components_of_all(cells);
        components.push(subject);
        files.extend(settler.files(&components, cells));
        let paths = reader.parameters.values().filter_map(Value::as_str);
        let paths = paths.filter(|path| Path::new(path).exists());
        files.extend(paths.map(|path| (path.to_owned(), content.clone())));
        Ok(files)
    }

    /// Writes down what is evaluated, before anything is computed, and returns the number of the evaluation: an evaluation that fails has
    /// one too. `own` frames are evaluated here.
    pub(super) fn begin_evaluation(&mut self, record: EvaluationRecord, own: usize) -> Result<u64> {
        let number = self.record.evaluations.len() as u64;
        self.record.evaluations.push(record);
        self.evaluations.own.push(own);
        self.begin()?;
        Ok(number)
    }

    /// The file with the results, which is opened when it is first needed.
    pub(super) fn results(&mut self) -> Result<&mut Results> {
        match &mut self.evaluations.results {
            Some(results) => Ok(results),
            empty => {
                let folder = self.record.directory.as_ref().map(RunDirectory::path).unwrap_or(Path::new(""));
                Ok(empty.insert(Results::open(&folder.join(RESULTS))?))
            }
        }
    }

    /// Notes what came of an evaluation, and returns it.
    pub(super) fn conclude(
        &mut self,
        bad_frames: &[BadFrame],
        summary: Value,
        performance: Performance,
    ) -> Result<Value> {
        for bad in bad_frames {
            self.account.warnings.push(format!("{} was left out: {}", bad.frame, bad.error));
        }
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

    /// The reader of a dataset, and what it says of the recording.
    pub(super) fn open_dataset(&mut self, dataset: &DatasetSpec) -> Result<(ComponentSpec, Made)> {
        match dataset {
            DatasetSpec::Reader(reader) => Ok((reader.clone(), self.make(Kind::Dataset, reader)?)),
            DatasetSpec::Path(path) => {
                let catalog = self.session.catalog().clone();
                Ok(readers::open(&catalog, path, |reader| self.make(Kind::Dataset, reader))?)
            }
        }
    }
}
