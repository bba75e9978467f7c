//! Predictors on datasets of pictures, piece by piece.

use std::path::Path;

use pdk_model::canonical::canonical;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_record::evaluated::EvaluationRecord;
use pdk_sdk::describe::{Geometry, Kind};
use pdk_sdk::error::{Error, Result};
use serde_json::Value;

use super::Host;
use super::driving::components;
use crate::evaluation::{BadFrame, Segment};
use crate::follow::Progress;
use crate::task::{Metric, Piece, Request, TaskEvaluation, TaskRun};
use pdk_record::manifest::components_of_all;

/// A task with the hash of its labels in their place, if they are a table: there may be one for each of many pictures.
fn without_labels(mut task: Value) -> Value {
    if let Some(labels) = task.get_mut("labels").filter(|labels| labels.is_object()) {
        *labels = format!("blake3:{}", blake3::hash(canonical(labels).as_bytes())).into();
    }
    task
}

/// An evaluation of a predictor that is under way.
pub(crate) struct UnderWay {
    run: TaskRun,
    bar: Progress,
    /// Predictions that are wanted, and those that were done before.
    all: u64,
    before: u64,
    /// The frames that the session had done when it began.
    since: u64,
    started: std::time::Instant,
}

impl Host {
    /// `pdk.evaluate` with a task whose metric is built in.
    pub(super) fn evaluate_task(&mut self, request: Value) -> Result<Value> {
        let mut run = self.begin_task(request)?;
        if matches!(run.run.metric, Metric::Function { .. }) {
            return Err(Error::new(
                "task: `score` is missing, a function of the pipeline that gets the outputs for a picture and returns numbers",
            ));
        }
        while let Some(piece) = self.next_piece(&mut run)? {
            self.keep_piece(&mut run, piece)?;
        }
        self.finish_task(run)
    }

    /// Begins an evaluation of a predictor.
    pub(crate) fn begin_task(&mut self, request: Value) -> Result<UnderWay> {
        let Request { dataset, mut predictor, task, mut cells, frames, keep_labels } =
            Request::from_json(request)?;
        let mut settler = self.settler();
        settler.component(Kind::Predictor, &mut predictor);
        settler.perturbations(&mut cells);
        let (reader, opened) = self.open_dataset(&dataset)?;
        let (available, sequences) = (opened.frames.unwrap_or_default(), opened.sequences);
        let info = self.make(Kind::Predictor, &predictor)?.info;
        for component in components(&cells) {
            self.make(Kind::Perturbation, &component)?;
        }
        self.check_levels(&cells)?;
        let folder =
            reader.parameters.values().filter_map(Value::as_str).map(Path::new).find(|path| path.is_dir());
        let (metric, labels) = Metric::read(task.clone(), folder)?;
        if metric.is_placed() && !keep_labels {
            self.refuse_moving(&metric, &cells)?;
        }
        self.note_files(Kind::Dataset, &reader)?;
        self.note_files(Kind::Predictor, &predictor)?;
        for (kind, component) in components_of_all(&cells) {
            self.note_files(kind, &component)?;
        }
        self.record.in_use.add_input_files(&labels, &mut |_, _| Ok(()))?;
        let catalog = self.session.catalog();
        self.record.in_use.add(catalog, Kind::Dataset, &reader.name, &reader.parameters, Vec::new())?;
        self.record.in_use.add(catalog, Kind::Predictor, &predictor.name, &predictor.parameters, info)?;
        self.record.in_use.add_perturbations(catalog, &cells)?;
        let evaluation = TaskEvaluation {
            dataset: reader,
            predictor,
            cells,
            seed: self.setup.common.seed,
            frames: frames.unwrap_or(usize::MAX).min(available),
            sequences,
            shard: self.setup.common.shard,
        };
        let TaskEvaluation { dataset, predictor, cells, .. } = &evaluation;
        let mut files = self.named_files(dataset, (Kind::Predictor, predictor.clone()), cells)?;
        let content = labels.first().and_then(|labels| self.record.in_use.content_of(labels));
        if let (Some(path), Some(content)) = (task["labels"].as_str(), content) {
            files.insert(path.to_owned(), content.to_owned());
        }
        let own: usize = evaluation.own().iter().map(Segment::len).sum();
        let record = EvaluationRecord {
            dataset: dataset.clone(),
            driver: None,
            predictor: Some(predictor.clone()),
            task: Some(without_labels(task)),
            perturbations: cells.clone(),
            frames: evaluation.frames,
            files,
        };
        let number = self.begin_evaluation(record, own)?;
        let each = evaluation.cells.len() as u64 + 1;
        let workers = self.session.slots();
        let run = TaskRun::new(evaluation, metric, number, self.results()?, workers);
        let bar = Progress::new(self.setup.audience, "{pos}/{len} predictions, {eta} left");
        let all = own as u64 * each;
        bar.add(all);
        let before = (own - run.new) as u64 * each;
        Ok(UnderWay {
            run,
            bar,
            all,
            before,
            since: self.session.frames(),
            started: std::time::Instant::now(),
        })
    }

    /// Refuses perturbations under which labels that say where something is would be wrong.
    fn refuse_moving(&self, metric: &Metric, cells: &[AppliedPerturbation]) -> Result<()> {
        let catalog = self.session.catalog();
        for cell in cells {
            let geometry = catalog.get(Kind::Perturbation, &cell.name)?.description.geometry;
            if matches!(geometry, Geometry::Moved | Geometry::Altered) {
                return Err(Error::new(format!(
                    "perturbation `{}` moves what a picture shows, and the labels of a {} stay where they are; leave it out, write a                      perturbed dataset with `pdk corrupt`, which moves labels, or set `keep_labels` of the task",
                    cell.name,
                    metric.name()
                )));
            }
        }
        Ok(())
    }

    /// The next pictures of an evaluation; none if all are done.
    pub(crate) fn next_piece(&mut self, under_way: &mut UnderWay) -> Result<Option<Piece>> {
        let UnderWay { run, bar, all, before, since, .. } = under_way;
        self.results()?;
        let Some(results) = &mut self.evaluations.results else {
            return Err(Error::new("there is no file for results, which is a defect in pdk"));
        };
        run.next(&mut self.session, results, &mut |frames| bar.set((*before + frames - *since).min(*all)))
    }

    /// Writes what the metric keeps of pictures.
    pub(crate) fn keep_piece(&mut self, under_way: &mut UnderWay, piece: Piece) -> Result<()> {
        under_way.run.keep(self.results()?, piece)
    }

    /// What an evaluation came to.
    pub(crate) fn finish_task(&mut self, under_way: UnderWay) -> Result<Value> {
        let UnderWay { run, bar, started, .. } = under_way;
        bar.finish();
        let journal = &mut self.results()?.journal;
        journal.close()?;
        let (known, perturbed) = journal.taken();
        if let ((0, [BadFrame { frame, error, .. }, ..]), None) =
            (run.collector.frames(), run.evaluation.shard)
        {
            let all = run.collector.frames().1.len();
            return Err(Error::new(format!(
                "none of the {all} pictures could be evaluated; the first: {frame}: {error}"
            )));
        }
        let cells = &run.evaluation.cells;
        let done = (run.new * cells.len()).saturating_sub(perturbed as usize);
        let predictions = (run.new * (cells.len() + 1)).saturating_sub(known as usize);
        let performance = crate::evaluation::performance(
            (done, predictions),
            self.session.slots(),
            run.times,
            started.elapsed(),
        );
        let summary = run.collector.finish(run.number, &run.metric, cells);
        self.conclude(&summary.bad_frames, serde_json::to_value(&summary)?, performance)
    }
}
