//! What an evaluation of a predictor says.

use pdk_model::perturbation::AppliedPerturbation;
use serde::Serialize;
use serde_json::Value;

use super::baseline::{CorruptionErrors, UnderPerturbation};
use super::metric::Metric;
use super::total::Total;
use crate::evaluation::{BadFrame, TaskFrame, level_of};

/// The result of an evaluation of a predictor.
#[derive(Debug, Serialize)]
pub struct TaskSummary {
    /// The number of the evaluation in its run, from 0.
    pub evaluation: u64,
    /// The metric.
    pub task: &'static str,
    /// Pictures that were evaluated.
    pub frames: usize,
    /// Pictures that could not be read or predicted, with the reason.
    pub bad_frames: Vec<BadFrame>,
    /// The metric on the pictures as they are.
    pub original: Vec<Total>,
    /// One row for each perturbation and level.
    pub rows: Vec<TaskRow>,
    /// Corruption errors, for a classification with a baseline.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub corruption_errors: Option<CorruptionErrors>,
}

/// The metric on the pictures under one perturbation at one level.
#[derive(Debug, Serialize)]
pub struct TaskRow {
    /// The perturbation.
    pub perturbation: String,
    /// The perturbation with its parameters.
    pub label: String,
    /// Its level.
    pub level: f64,
    /// What the metric says.
    pub totals: Vec<Total>,
}

/// Gathers pictures, in their order.
pub struct TaskCollector {
    cells: usize,
    names: Vec<String>,
    original: Vec<Value>,
    perturbed: Vec<Vec<Value>>,
    bad_frames: Vec<BadFrame>,
}

impl TaskCollector {
    /// Nothing yet of these perturbations.
    pub fn new(cells: &[AppliedPerturbation]) -> Self {
        Self {
            cells: cells.len(),
            names: Vec::new(),
            original: Vec::new(),
            perturbed: vec![Vec::new(); cells.len()],
            bad_frames: Vec::new(),
        }
    }

    /// Adds a picture.
    pub fn add(&mut self, frame: TaskFrame) {
        match frame {
            TaskFrame::Bad(bad) => self.bad_frames.push(bad),
            TaskFrame::Good { frame, original, perturbed } => {
                debug_assert_eq!(perturbed.len(), self.cells);
                self.names.push(frame);
                self.original.push(original);
                self.perturbed.iter_mut().zip(perturbed).for_each(|(all, kept)| all.push(kept));
            }
        }
    }

    /// The good pictures, and the bad ones.
    pub fn frames(&self) -> (usize, &[BadFrame]) {
        (self.names.len(), &self.bad_frames)
    }

    /// What all of them say.
    pub fn finish(self, evaluation: u64, metric: &Metric, cells: &[AppliedPerturbation]) -> TaskSummary {
        let Self { names, original, perturbed, bad_frames, .. } = self;
        let totals = |kept: &[Value]| {
            let pictures: Vec<(&str, &Value)> = names.iter().map(String::as_str).zip(kept).collect();
            metric.totals(&pictures)
        };
        let original = totals(&original);
        let rows: Vec<TaskRow> = cells
            .iter()
            .zip(&perturbed)
            .map(|(cell, kept)| TaskRow {
                perturbation: cell.name.clone(),
                label: cell.label(),
                level: level_of(cell),
                totals: totals(kept),
            })
            .collect();
        let corruption_errors = corruption_errors(metric, &original, &rows);
        TaskSummary {
            evaluation,
            task: metric.name(),
            frames: names.len(),
            bad_frames,
            original,
            rows,
            corruption_errors,
        }
    }
}

fn corruption_errors(metric: &Metric, original: &[Total], rows: &[TaskRow]) -> Option<CorruptionErrors> {
    let Metric::Classification { baseline: Some(baseline), .. } = metric else { return None };
    let top1 = |totals: &[Total]| totals.first()?.value;
    let mut under: Vec<UnderPerturbation> = Vec::new();
    for row in rows {
        let error = (row.level, top1(&row.totals)?);
        match under.iter_mut().find(|under| under.label == row.label) {
            Some(under) => under.errors.push(error),
            None => under.push(UnderPerturbation { label: row.label.clone(), errors: vec![error] }),
        }
    }
    Some(baseline.compare(top1(original)?, &under))
}
