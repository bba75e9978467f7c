//! Offline results as a page shows them: sums over the lines, so that a run that has not ended has them too.

use std::collections::BTreeMap;
use std::io::{BufRead, BufReader};

use pdk_model::component::ENGINE;
use pdk_record::directory::{RESULTS, RunDirectory};
use pdk_record::manifest::EvaluationRecord;
use pdk_sdk::error::{Error, Place, Result};
use pdk_sdk::file;
use pdk_sdk::prelude::Control;
use serde::Deserialize;

use crate::view::{Evaluation, EvaluationCell, WorstFrame};

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
}

#[derive(Deserialize)]
struct ResultLine {
    evaluation: u64,
    index: usize,
    frame: String,
    label: String,
    level: f64,
    truth: Control,
    original: Control,
    perturbed: Control,
}

/// The sums of an evaluation.
#[derive(Default)]
struct Sums {
    /// The error on each original frame.
    original: BTreeMap<usize, f64>,
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
    frames: usize,
    error: f64,
    drift: f64,
}

/// The evaluations of a run, in order, with what the manifest tells of each; none if there are none. A last line that was cut off is left out.
///
/// # Errors
/// If the results cannot be read, or a line is damaged.
pub fn read(directory: &RunDirectory, told: &[EvaluationRecord]) -> Result<Vec<Evaluation>> {
    let path = directory.path().join(RESULTS);
    let Some((file, _)) = file::open_if_there(&path).place(path.display())? else { return Ok(Vec::new()) };
    let mut evaluations: BTreeMap<u64, Sums> = BTreeMap::new();
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
        }
    }
    Ok(evaluations.into_iter().map(|(number, sums)| sums.finish(number, told)).collect())
}

impl Sums {
    fn add(&mut self, line: ResultLine) {
        let ResultLine { index, frame, label, level, truth, original, perturbed, .. } = line;
        let before = (original.steering - truth.steering).abs();
        let error = (perturbed.steering - truth.steering).abs();
        self.original.insert(index, before);
        let cells = &mut self.cells;
        let place = *self.places.entry((label.clone(), level.to_bits())).or_insert_with(|| {
            cells.push(Cell { label: label.clone(), level, frames: 0, error: 0.0, drift: 0.0 });
            cells.len() - 1
        });
        let cell = &mut cells[place];
        cell.frames += 1;
        cell.error += error;
        cell.drift += (perturbed.steering - original.steering).abs();
        let grown = error - before;
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
        // Who ran the networks tells them apart only if several did.
        let engine = |record: &EvaluationRecord| record.driver.parameters.get(ENGINE).cloned();
        let one_engine = told.iter().all(|record| told.first().map(engine) == Some(engine(record)));
        let driver = own.as_ref().map(|record| {
            let mut driver = record.driver.clone();
            if one_engine {
                driver.parameters.shift_remove(ENGINE);
            }
            driver.to_string()
        });
        let frames = self.original.len();
        let mut worst: Vec<_> = self.worst.into_values().collect();
        worst.sort_by(|(a, _), (b, _)| b.total_cmp(a));
        Evaluation {
            number,
            driver: driver.unwrap_or_default(),
            dataset: own.map(|record| record.dataset.to_string()).unwrap_or_default(),
            frames,
            bad_frames: self.bad_frames,
            original_error: self.original.values().sum::<f64>() / frames.max(1) as f64,
            cells: self
                .cells
                .into_iter()
                .map(|cell| EvaluationCell {
                    perturbation: cell.label,
                    level: cell.level,
                    error: cell.error / cell.frames as f64,
                    drift: cell.drift / cell.frames as f64,
                })
                .collect(),
            worst: worst.into_iter().take(WORST).map(|(_, frame)| frame).collect(),
        }
    }
}
