//! Predictors on pictures: each picture as it is and under every perturbation at every level goes through a predictor, and a metric says
//! how good its outputs are.

mod baseline;
mod classes;
mod detection;
mod metric;
mod pixels;
mod request;
mod summary;
mod total;
mod trajectory;

pub use metric::Metric;
pub use request::Request;
pub use summary::TaskCollector;

use std::collections::VecDeque;

use pdk_loop::protocol::{EvaluateFrames, EvaluatedFrame, Subject};
use pdk_model::component::ComponentSpec;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_model::shard::Shard;
use pdk_sdk::error::{Error, Result};
use pdk_session::session::Session;
use serde_json::Value;

use crate::evaluation::{BadFrame, Feed, PREDICTOR, Results, Segment, TaskFrame, Times, segments};

/// What goes through a predictor.
#[derive(Debug, Clone)]
pub struct TaskEvaluation {
    /// Where the pictures come from.
    pub dataset: ComponentSpec,
    /// The predictor under test.
    pub predictor: ComponentSpec,
    /// Each perturbation at each level.
    pub cells: Vec<AppliedPerturbation>,
    /// What random numbers come from.
    pub seed: u64,
    /// The number of pictures.
    pub frames: usize,
    /// Those that begin a sequence.
    pub sequences: Vec<usize>,
    /// The part that is evaluated, if this is a part of a run.
    pub shard: Option<Shard>,
}

impl TaskEvaluation {
    /// The pieces that are evaluated here.
    pub fn own(&self) -> Vec<Segment> {
        let all = segments(&self.sequences, self.frames, PREDICTOR);
        match self.shard {
            Some(shard) => shard.own(all.len()).map(|place| all[place]).collect(),
            None => all,
        }
    }

    /// The jobs of a piece: the pictures as they are, then under each perturbation.
    fn jobs(&self, segment: Segment, metric: &Metric) -> Vec<EvaluateFrames> {
        let subject = Subject::Predictor { component: self.predictor.clone(), take: metric.take() };
        let job = |perturbation: Option<&AppliedPerturbation>| EvaluateFrames {
            dataset: self.dataset.clone(),
            subject: subject.clone(),
            perturbation: perturbation.cloned(),
            seed: self.seed,
            sequence: segment.sequence,
            earliest: None,
            from: segment.from,
            start: segment.start,
            end: segment.end,
        };
        std::iter::once(None).chain(self.cells.iter().map(Some)).map(job).collect()
    }
}

/// An evaluation that is under way.
pub struct TaskRun {
    /// What is evaluated.
    pub evaluation: TaskEvaluation,
    /// By which metric.
    pub metric: Metric,
    /// The number of the evaluation in its run.
    pub number: u64,
    /// What was found so far.
    pub collector: TaskCollector,
    /// How long components took.
    pub times: Times,
    /// Pictures that were not recorded already.
    pub new: usize,
    /// The pieces that are left.
    left: VecDeque<Segment>,
    feed: Feed<std::vec::IntoIter<EvaluateFrames>>,
}

/// Pictures of which the metric has measured nothing yet.
pub struct Piece {
    segment: Segment,
    /// What the metric keeps, or gives to a function of the pipeline.
    pub frames: Vec<TaskFrame>,
}

impl TaskRun {
    /// Begins an evaluation, with what is recorded of it already.
    pub fn new(
        evaluation: TaskEvaluation,
        metric: Metric,
        number: u64,
        results: &mut Results,
        workers: usize,
    ) -> Self {
        results.journal.begin(number);
        let mut left: VecDeque<Segment> = evaluation.own().into();
        let mut collector = TaskCollector::new(&evaluation.cells);
        while let Some(segment) = left.front()
            && let Some(frames) = results.take_task(number, segment.start..segment.end, &evaluation.cells)
        {
            left.pop_front();
            frames.into_iter().for_each(|frame| collector.add(frame));
        }
        let jobs: Vec<EvaluateFrames> =
            left.iter().flat_map(|segment| evaluation.jobs(*segment, &metric)).collect();
        Self {
            metric,
            number,
            collector,
            times: Times::default(),
            new: left.iter().map(Segment::len).sum(),
            left,
            feed: Feed::new(jobs.into_iter(), number, workers),
            evaluation,
        }
    }

    /// The next pictures; none if all are done. `tick` is called with the frames that are done so far.
    ///
    /// # Errors
    /// If the session is over, or the journal cannot be written.
    pub fn next(
        &mut self,
        session: &mut Session,
        results: &mut Results,
        tick: &mut dyn FnMut(u64),
    ) -> Result<Option<Piece>> {
        let Some(segment) = self.left.pop_front() else { return Ok(None) };
        let mut frames: Vec<TaskFrame> = Vec::new();
        for place in 0..=self.evaluation.cells.len() {
            let Some(found) = self.feed.next(session, &mut results.journal, &mut self.times, tick)? else {
                return Err(Error::new("there are fewer results than jobs, which is a defect in pdk"));
            };
            if place == 0 {
                frames = found.into_iter().map(|found| self.first(found)).collect();
            } else {
                frames.iter_mut().zip(found).for_each(|(frame, found)| self.add(frame, found));
            }
        }
        Ok(Some(Piece { segment, frames }))
    }

    /// Writes what the metric keeps of pictures.
    ///
    /// # Errors
    /// If it cannot be written.
    pub fn keep(&mut self, results: &mut Results, piece: Piece) -> Result<()> {
        let Piece { segment, frames } = piece;
        results.add_task(self.number, segment.start, &frames, &self.evaluation.cells)?;
        results.journal.forget(0)?;
        frames.into_iter().for_each(|frame| self.collector.add(frame));
        Ok(())
    }

    fn first(&self, found: EvaluatedFrame) -> TaskFrame {
        match self.measured(found) {
            Ok((frame, original)) => TaskFrame::Good { frame, original, perturbed: Vec::new() },
            Err(bad) => TaskFrame::Bad(bad),
        }
    }

    /// Adds what was found of a picture under the next perturbation. One that is bad under any is bad.
    fn add(&self, frame: &mut TaskFrame, found: EvaluatedFrame) {
        let TaskFrame::Good { perturbed, .. } = frame else { return };
        match self.measured(found) {
            Ok((_, measured)) => perturbed.push(measured),
            Err(bad) => *frame = TaskFrame::Bad(bad),
        }
    }

    fn measured(&self, found: EvaluatedFrame) -> Result<(String, Value), BadFrame> {
        match found {
            EvaluatedFrame::Predicted { frame, truth, taken } => match self
                .metric
                .measure(&frame, &truth, taken)
            {
                Ok(measured) => Ok((frame, measured)),
                Err(error) => Err(BadFrame { frame, error: error.message().to_owned(), by_driver: false }),
            },
            EvaluatedFrame::Bad { frame, error, by_driver } => Err(BadFrame { frame, error, by_driver }),
            EvaluatedFrame::Good { frame, .. } => Err(BadFrame {
                frame,
                error: "a worker drove instead of predicting, which is a defect in pdk".to_owned(),
                by_driver: false,
            }),
        }
    }
}
