//! Offline results as a page shows them: sums over the lines, so that a run that has not ended has them too.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};

use pdk_record::directory::{RESULTS, RunDirectory};
use pdk_record::evaluated::EvaluationRecord;
use pdk_sdk::error::{Error, Place, Result};
use pdk_sdk::file;
use pdk_sdk::prelude::Control;
use pdk_statistics::{CONFIDENCE, Estimate, blocks};
use serde::Deserialize;
use serde_json::Value;

use super::under_way::UnderWay;
use crate::named::Named;
use crate::view::{Evaluation, EvaluationCell, Task, WorstFrame};

/// Frames in the table of the worst.
const WORST: usize = 12;

/// A line of the results.
#[derive(Deserialize)]
#[serde(untagged)]
enum Line {
    /// A frame at a perturbation and level.
    Result(ResultLine),
    /// A frame that could not be evaluated.
    Bad { evaluation: u64, frame: String, error: String },
    /// A picture with a predictor.
    Task { evaluation: u64, label: Option<String>, level: Option<f64>, measured: Value },
}

#[derive(Deserialize)]
struct ResultLine {
    evaluation: u64,
    index: usize,
    frame: String,
    label: String,
    level: f64,
    truth: Truth,
    original: Control,
    perturbed: Control,
}

/// What was recorded, as far as the page needs it.
#[derive(Deserialize)]
struct Truth {
    /// Not a number if it was not recorded.
    #[serde(default = "not_a_number")]
    steering: f64,
}

fn not_a_number() -> f64 {
    f64::NAN
}

/// The sums of an evaluation.
#[derive(Default)]
struct Sums {
    /// What was recorded with each original frame, and the error on it.
    original: BTreeMap<usize, (f64, f64)>,
    bad_frames: Vec<(String, String)>,
    cells: Vec<Cell>,
    /// Where a cell stands in `cells`: its label and the bits of its level.
    places: BTreeMap<(String, u64), usize>,
    /// By perturbation, the frame on which the error grew most, with how much.
    worst: BTreeMap<String, (f64, WorstFrame)>,
}

struct Cell {
    label: String,
    level: f64,
    /// On each frame.
    errors: Vec<(usize, f64)>,
    drifts: Vec<(usize, f64)>,
}

/// The evaluations of drivers in a run, in order, with what the manifest tells of each, and those of predictors about which the summary does not
/// have all, as those in `known` have. A last line that was cut off is left out.
///
/// # Errors
/// If the results cannot be read, or a line is damaged.
pub fn read(
    directory: &RunDirectory,
    told: &[EvaluationRecord],
    known: &[u64],
) -> Result<(Vec<Evaluation>, Vec<Task>)> {
    let path = directory.path().join(RESULTS);
    let Some((file, _)) = file::open_if_there(&path).place(path.display())? else {
        return Ok(Default::default());
    };
    let mut evaluations: BTreeMap<u64, Sums> = BTreeMap::new();
    let mut of_tasks: BTreeMap<u64, UnderWay> = BTreeMap::new();
    let (mut reader, mut text, mut number) = (BufReader::new(file), Vec::new(), 0);
    loop {
        text.clear();
        reader.read_until(b'\n', &mut text).place(path.display())?;
        if text.last() != Some(&b'\n') {
            break;
        }
        number += 1;
        let line: Line = serde_json::from_slice(&text).map_err(|error| {
            Error::new(format!("{}:{number} is not a result as pdk writes it ({error})", path.display()))
        })?;
        match line {
            Line::Result(line) => evaluations.entry(line.evaluation).or_default().add(line),
            Line::Bad { evaluation, frame, error } => {
                evaluations.entry(evaluation).or_default().bad_frames.push((frame, error));
            }
            Line::Task { evaluation, label, level, measured } => {
                let task = of_tasks.entry(evaluation).or_default();
                if !known.contains(&evaluation) {
                    task.add(label.zip(level), &measured);
                }
            }
        }
    }
    // One with a predictor may have pictures that were left out.
    let tasks = of_tasks.into_iter().filter_map(|(number, task)| {
        let bad = evaluations.remove(&number).map(|sums| sums.bad_frames).unwrap_or_default();
        (!known.contains(&number)).then(|| task.finish(number, bad))
    });
    let tasks = tasks.collect();
    Ok((evaluations.into_iter().map(|(number, sums)| sums.finish(number, told)).collect(), tasks))
}

impl Sums {
    fn add(&mut self, line: ResultLine) {
        let ResultLine { index, frame, label, level, truth, original, perturbed, .. } = line;
        let before = (original.steering - truth.steering).abs();
        let error = (perturbed.steering - truth.steering).abs();
        self.original.insert(index, (truth.steering, before));
        let cells = &mut self.cells;
        let place = *self.places.entry((label.clone(), level.to_bits())).or_insert_with(|| {
            cells.push(Cell { label: label.clone(), level, errors: Vec::new(), drifts: Vec::new() });
            cells.len() - 1
        });
        let cell = &mut cells[place];
        let drift = (perturbed.steering - original.steering).abs();
        if !error.is_nan() {
            cell.errors.push((index, error));
        }
        cell.drifts.push((index, drift));
        // Without a recorded steering, the drift is all that is known of the harm.
        let grown = if error.is_nan() { drift } else { error - before };
        if self.worst.get(&label).is_none_or(|(most, _)| grown > *most) {
            let worst = WorstFrame {
                frame,
                perturbation: label.clone(),
                level,
                truth: truth.steering,
                original: original.steering,
                perturbed: perturbed.steering,
            };
            self.worst.insert(label, (grown, worst));
        }
    }

    fn finish(self, number: u64, told: &[EvaluationRecord]) -> Evaluation {
        let own = told.get(number as usize).cloned();
        let named = Named::of(told.iter().filter_map(|record| record.driver.as_ref()));
        let driver = own.as_ref().and_then(|record| Some(named.name(record.driver.as_ref()?)));
        let frames = self.original.len();
        let mut worst: Vec<_> = self.worst.into_values().collect();
        worst.sort_by(|(a, _), (b, _)| b.total_cmp(a));
        Evaluation {
            number,
            driver: driver.unwrap_or_default(),
            dataset: own.map(|record| record.dataset.to_string()).unwrap_or_default(),
            frames,
            bad_frames: self.bad_frames,
            original_error: {
                let known: Vec<f64> =
                    self.original.values().map(|(_, error)| *error).filter(|error| !error.is_nan()).collect();
                known.iter().sum::<f64>() / known.len() as f64
            },
            constant_error: constant_error(
                self.original.values().map(|(truth, _)| *truth).filter(|truth| !truth.is_nan()).collect(),
            ),
            cells: self
                .cells
                .into_iter()
                .map(|cell| {
                    let (error, drift) = (mean(&cell.errors), mean(&cell.drifts));
                    EvaluationCell {
                        perturbation: cell.label,
                        level: cell.level,
                        error: if cell.errors.is_empty() { f64::NAN } else { error.value },
                        drift: drift.value,
                        error_interval: interval(&error),
                        drift_interval: interval(&drift),
                        frames: if cell.errors.is_empty() { cell.drifts } else { cell.errors },
                    }
                })
                .collect(),
            worst: worst.into_iter().take(WORST).map(|(_, frame)| frame).collect(),
        }
    }
}

/// The mean absolute error of the best constant, which is the median of what was recorded.
fn constant_error(mut truth: Vec<f64>) -> f64 {
    truth.sort_by(f64::total_cmp);
    let constant = truth.get(truth.len() / 2).copied().unwrap_or_default();
    truth.iter().map(|truth| (truth - constant).abs()).sum::<f64>() / truth.len().max(1) as f64
}

/// The mean over frames, with its interval: see [`pdk_statistics::blocks`].
fn mean(frames: &[(usize, f64)]) -> Estimate {
    let values: Vec<f64> = frames.iter().map(|(_, value)| *value).collect();
    let none = Estimate { value: 0.0, low: f64::NEG_INFINITY, high: f64::INFINITY };
    blocks::mean(&values, blocks::length(&values), CONFIDENCE).unwrap_or(none)
}

/// The interval, unless the frames are too few to say anything.
fn interval(found: &Estimate) -> Option<(f64, f64)> {
    (found.low.is_finite() && found.high.is_finite()).then_some((found.low, found.high))
}
