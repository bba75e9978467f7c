//! The file with the results of evaluations: a line for each frame, perturbation and level.

use std::collections::VecDeque;
use std::io::Write;

use pdk_model::perturbation::AppliedPerturbation;
use pdk_record::directory::JOURNAL;
use pdk_record::lines::Lines;
use pdk_sdk::error::{Place, Result};
use pdk_sdk::prelude::Control;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use super::journal::Journal;

/// One line of the results.
#[derive(Debug, Serialize, Deserialize)]
#[serde(untagged)]
enum Line {
    Result {
        evaluation: u64,
        index: usize,
        frame: String,
        perturbation: String,
        label: String,
        level: f64,
        #[serde(with = "pdk_loop::recorded")]
        truth: Control,
        original: Control,
        perturbed: Control,
    },
    Bad {
        evaluation: u64,
        index: usize,
        frame: String,
        error: String,
        #[serde(default, skip_serializing_if = "std::ops::Not::not")]
        by_driver: bool,
    },
    Task {
        evaluation: u64,
        index: usize,
        frame: String,
        /// None for the frame as it is, as are the next two.
        perturbation: Option<String>,
        label: Option<String>,
        level: Option<f64>,
        measured: Value,
    },
}

impl Line {
    fn evaluation(&self) -> u64 {
        match self {
            Self::Result { evaluation, .. }
            | Self::Bad { evaluation, .. }
            | Self::Task { evaluation, .. } => *evaluation,
        }
    }
}

/// What one picture came to with a predictor.
#[derive(Debug, Clone, PartialEq)]
pub enum TaskFrame {
    /// The predictor gave outputs, also under each perturbation.
    Good {
        /// Its name.
        frame: String,
        /// What the metric keeps of the outputs for the picture as it is.
        original: Value,
        /// What it keeps under each perturbation.
        perturbed: Vec<Value>,
    },
    /// It could not be evaluated.
    Bad(BadFrame),
}

/// What one frame came to.
#[derive(Debug, Clone, PartialEq)]
pub enum Frame {
    /// The driver decided, also under each perturbation.
    Good {
        /// Its name.
        frame: String,
        /// What was recorded.
        truth: Control,
        /// What the driver makes of the frame as it is.
        original: Control,
        /// What it makes of it under each perturbation.
        perturbed: Vec<Control>,
    },
    /// It could not be evaluated.
    Bad(BadFrame),
}

/// A frame that could not be evaluated.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct BadFrame {
    /// Its name.
    pub frame: String,
    /// The reason.
    pub error: String,
    /// Whether it was the driver that failed.
    #[serde(skip)]
    pub by_driver: bool,
}

/// The file of results, with what an earlier process left in it.
pub struct Results {
    /// What is not in the file yet.
    pub journal: Journal,
    lines: Lines,
    /// Lines of evaluations that have not been come to yet, each with its length in bytes.
    recorded: VecDeque<(Line, u64)>,
    /// Up to here, in bytes, lines were taken up or written.
    length: u64,
    text: Vec<u8>,
}

/// The level of a cell, which is the same for all frames.
pub fn level_of(cell: &AppliedPerturbation) -> f64 {
    cell.level.constant().unwrap_or_default()
}

impl Results {
    /// Opens the file, and the journal beside it.
    ///
    /// # Errors
    /// If it cannot be read or written, or a line is damaged.
    pub fn open(path: &std::path::Path) -> Result<Self> {
        let (lines, text) = Lines::open(path)?;
        let mut recorded = VecDeque::new();
        for (number, line) in text.split_inclusive(|byte| *byte == b'\n').enumerate() {
            let parsed =
                serde_json::from_slice(line).place(format_args!("{}:{}", path.display(), number + 1))?;
            recorded.push_back((parsed, line.len() as u64));
        }
        let journal = Journal::open(&path.with_file_name(JOURNAL))?;
        Ok(Self { journal, lines, recorded, length: 0, text: Vec::new() })
    }

    /// These frames of an evaluation, if all of them are recorded as a whole. What is recorded of them otherwise is forgotten, with
    /// all behind it.
    pub fn take(
        &mut self,
        number: u64,
        frames: std::ops::Range<usize>,
        cells: &[AppliedPerturbation],
    ) -> Option<Vec<Frame>> {
        if self.failed(number) {
            return None;
        }
        let before = self.length;
        let taken: Option<Vec<Frame>> = frames.map(|index| self.take_frame(number, index, cells)).collect();
        if taken.is_none() {
            self.length = before;
            self.recorded.clear();
        }
        taken
    }

    /// Whether an evaluation has no lines although a later one has, as after a driver that is not ranked.
    fn failed(&self, number: u64) -> bool {
        self.recorded.front().is_some_and(|(line, _)| line.evaluation() > number)
    }

    fn take_frame(&mut self, number: u64, index: usize, cells: &[AppliedPerturbation]) -> Option<Frame> {
        match self.recorded.front()? {
            (Line::Bad { evaluation, index: at, frame, error, by_driver }, length) => {
                if (*evaluation, *at) != (number, index) {
                    return None;
                }
                let bad = BadFrame { frame: frame.clone(), error: error.clone(), by_driver: *by_driver };
                self.length += length;
                self.recorded.pop_front();
                Some(Frame::Bad(bad))
            }
            (Line::Result { .. }, _) => {
                let fits = |(line, cell): (&(Line, u64), &AppliedPerturbation)| match &line.0 {
                    Line::Result { evaluation, index: at, label, level, .. } => {
                        (*evaluation, *at) == (number, index)
                            && *label == cell.label()
                            && *level == level_of(cell)
                    }
                    Line::Bad { .. } | Line::Task { .. } => false,
                };
                if self.recorded.len() < cells.len() || !self.recorded.iter().zip(cells).all(fits) {
                    return None;
                }
                // One line more for this frame is of an evaluation with more perturbations.
                if let Some((Line::Result { evaluation, index: at, .. }, _)) = self.recorded.get(cells.len())
                    && (*evaluation, *at) == (number, index)
                {
                    return None;
                }
                let mut found = None;
                let mut controls = Vec::with_capacity(cells.len());
                for (line, length) in self.recorded.drain(..cells.len()) {
                    self.length += length;
                    if let Line::Result { frame, truth, original, perturbed, .. } = line {
                        controls.push(perturbed);
                        found = Some((frame, truth, original));
                    }
                }
                let (frame, truth, original) = found?;
                Some(Frame::Good { frame, truth, original, perturbed: controls })
            }
            (Line::Task { .. }, _) => None,
        }
    }

    /// As [`Results::take`], of an evaluation of a predictor.
    pub fn take_task(
        &mut self,
        number: u64,
        frames: std::ops::Range<usize>,
        cells: &[AppliedPerturbation],
    ) -> Option<Vec<TaskFrame>> {
        if self.failed(number) {
            return None;
        }
        let before = self.length;
        let taken: Option<Vec<TaskFrame>> =
            frames.map(|index| self.take_task_frame(number, index, cells)).collect();
        if taken.is_none() {
            self.length = before;
            self.recorded.clear();
        }
        taken
    }

    fn take_task_frame(
        &mut self,
        number: u64,
        index: usize,
        cells: &[AppliedPerturbation],
    ) -> Option<TaskFrame> {
        let (line, length) = self.recorded.pop_front()?;
        self.length += length;
        let (name, original) = match line {
            Line::Bad { evaluation, index: at, frame, error, by_driver } => {
                let bad = BadFrame { frame, error, by_driver };
                return ((evaluation, at) == (number, index)).then_some(TaskFrame::Bad(bad));
            }
            Line::Task { evaluation, index: at, frame, label: None, measured, .. }
                if (evaluation, at) == (number, index) =>
            {
                (frame, measured)
            }
            Line::Task { .. } | Line::Result { .. } => return None,
        };
        let mut perturbed = Vec::with_capacity(cells.len());
        for cell in cells {
            let (line, length) = self.recorded.pop_front()?;
            self.length += length;
            match line {
                Line::Task { evaluation, index: at, label, level, measured, .. }
                    if (evaluation, at) == (number, index)
                        && label == Some(cell.label())
                        && level == Some(level_of(cell)) =>
                {
                    perturbed.push(measured);
                }
                _ => return None,
            }
        }
        Some(TaskFrame::Good { frame: name, original, perturbed })
    }

    /// As [`Results::add`], of an evaluation of a predictor.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn add_task(
        &mut self,
        evaluation: u64,
        first: usize,
        frames: &[TaskFrame],
        cells: &[AppliedPerturbation],
    ) -> Result<()> {
        self.forget_rest()?;
        for (index, frame) in (first..).zip(frames) {
            self.text.clear();
            match frame {
                TaskFrame::Bad(BadFrame { frame, error, by_driver }) => {
                    let (frame, error, by_driver) = (frame.clone(), error.clone(), *by_driver);
                    write(&mut self.text, &Line::Bad { evaluation, index, frame, error, by_driver })?;
                }
                TaskFrame::Good { frame, original, perturbed } => {
                    let all = std::iter::once((None, original)).chain(cells.iter().map(Some).zip(perturbed));
                    for (cell, measured) in all {
                        let line = Line::Task {
                            evaluation,
                            index,
                            frame: frame.clone(),
                            perturbation: cell.map(|cell| cell.name.clone()),
                            label: cell.map(AppliedPerturbation::label),
                            level: cell.map(level_of),
                            measured: measured.clone(),
                        };
                        write(&mut self.text, &line)?;
                    }
                }
            }
            self.lines.add(&self.text)?;
        }
        self.length = self.lines.length();
        self.lines.sync()
    }

    /// Forgets what an earlier process left behind the last frames that were taken up.
    fn forget_rest(&mut self) -> Result<()> {
        if self.length < self.lines.length() {
            self.lines.truncate(self.length)?;
            self.recorded.clear();
        }
        Ok(())
    }

    /// Adds the lines of frames, of which the first has this number. What an earlier process left behind the last frames that were
    /// taken up is forgotten.
    ///
    /// # Errors
    /// If they cannot be written.
    pub fn add(
        &mut self,
        number: u64,
        first: usize,
        frames: &[Frame],
        cells: &[AppliedPerturbation],
    ) -> Result<()> {
        self.forget_rest()?;
        for (index, frame) in (first..).zip(frames) {
            self.print(number, index, frame, cells)?;
            self.lines.add(&self.text)?;
        }
        self.length = self.lines.length();
        self.lines.sync()
    }

    /// Makes the lines of a frame.
    fn print(
        &mut self,
        evaluation: u64,
        index: usize,
        frame: &Frame,
        cells: &[AppliedPerturbation],
    ) -> Result<()> {
        self.text.clear();
        let mut add = |line: &Line| write(&mut self.text, line);
        match frame {
            Frame::Bad(BadFrame { frame, error, by_driver }) => {
                let (frame, error, by_driver) = (frame.clone(), error.clone(), *by_driver);
                add(&Line::Bad { evaluation, index, frame, error, by_driver })
            }
            Frame::Good { frame, truth, original, perturbed } => {
                cells.iter().zip(perturbed).try_for_each(|(cell, perturbed)| {
                    add(&Line::Result {
                        evaluation,
                        index,
                        frame: frame.clone(),
                        perturbation: cell.name.clone(),
                        label: cell.label(),
                        level: level_of(cell),
                        truth: *truth,
                        original: *original,
                        perturbed: *perturbed,
                    })
                })
            }
        }
    }
}

fn write(text: &mut Vec<u8>, line: &Line) -> Result<()> {
    serde_json::to_writer(&mut *text, line)?;
    Ok(text.write_all(b"\n")?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cells() -> Vec<AppliedPerturbation> {
        ["fog@1", "fog@2"].map(|text| AppliedPerturbation::parse(text).unwrap()).to_vec()
    }

    fn good(steering: f64) -> Frame {
        let control = |steering| Control { steering, throttle: 0.5 };
        Frame::Good {
            frame: "a.jpg".into(),
            truth: control(0.0),
            original: control(steering),
            perturbed: vec![control(0.25), control(0.5)],
        }
    }

    #[test]
    fn whole_segments_are_taken_up_and_the_rest_is_written_anew() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("results.jsonl");
        let cells = cells();
        let bad = Frame::Bad(BadFrame { frame: "b.jpg".into(), error: "cut".into(), by_driver: true });
        let (first, second) = ([good(0.1), bad], [good(0.2), good(0.3)]);
        let mut results = Results::open(&path).unwrap();
        results.add(0, 0, &first, &cells).unwrap();
        results.add(0, 2, &second, &cells).unwrap();
        let whole = std::fs::read(&path).unwrap();
        // A line of the fourth frame is missing, and half of another one is there.
        let lines: Vec<&[u8]> = whole.split_inclusive(|byte| *byte == b'\n').collect();
        let mut cut = lines[..6].concat();
        cut.extend_from_slice(&lines[6][..9]);
        std::fs::write(&path, &cut).unwrap();
        let mut results = Results::open(&path).unwrap();
        assert_eq!(results.take(0, 0..2, &cells).unwrap(), first);
        assert!(results.take(0, 2..4, &cells).is_none());
        results.add(0, 2, &second, &cells).unwrap();
        assert_eq!(std::fs::read(&path).unwrap(), whole);
        // Another evaluation is not taken for this one.
        assert!(Results::open(&path).unwrap().take(1, 0..1, &cells).is_none());
        assert!(Results::open(&path).unwrap().take(0, 0..1, &cells[..1]).is_none());
        // One that failed without a line leaves what the next one has.
        std::fs::remove_file(&path).unwrap();
        Results::open(&path).unwrap().add(1, 0, &first, &cells).unwrap();
        let mut results = Results::open(&path).unwrap();
        assert!(results.take(0, 0..2, &cells).is_none() && results.take_task(0, 0..2, &cells).is_none());
        assert_eq!(results.take(1, 0..2, &cells).unwrap(), first);
    }

    #[test]
    fn pictures_of_a_predictor_are_taken_up_as_well() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("results.jsonl");
        let cells = cells();
        let good = TaskFrame::Good {
            frame: "a/1.png".into(),
            original: serde_json::json!({"top": [1], "class": 1}),
            perturbed: vec![serde_json::json!({"top": [0], "class": 1}); 2],
        };
        let bad = TaskFrame::Bad(BadFrame { frame: "b".into(), error: "cut".into(), by_driver: false });
        let frames = [good, bad];
        Results::open(&path).unwrap().add_task(0, 0, &frames, &cells).unwrap();
        let mut results = Results::open(&path).unwrap();
        assert_eq!(results.take_task(0, 0..2, &cells).unwrap(), frames);
        assert!(results.take_task(0, 2..3, &cells).is_none());
        assert!(Results::open(&path).unwrap().take(0, 0..1, &cells).is_none());
        assert!(Results::open(&path).unwrap().take_task(0, 0..1, &cells[..1]).is_some());
    }
}
