//! The offline loop: every frame of a dataset goes through every perturbation at every level, and what the driver makes of it is
//! compared with the recorded ground truth and with what it makes of the original.
//!
//! Lines are written in the order of the frames, whatever the number of workers; so what a killed run left is a beginning, and
//! continuing it is going on behind that.

use std::collections::VecDeque;
use std::io::Write;
use std::time::{Duration, Instant};

use pdk_loop::protocol::{EvaluateFrame, Evaluated, Evaluation, Failure};
use pdk_model::perturbation::AppliedPerturbation;
use pdk_record::lines::Lines;
use pdk_record::shard::Shard;
use pdk_sdk::error::{Error, Place, Result};
use pdk_sdk::prelude::Control;
use pdk_session::session::{Reply, Session};
use serde::{Deserialize, Serialize};

/// How many frames are under way for each worker: enough that none waits, and few enough that the results of a slow one do not
/// pile up behind it.
const WINDOW: usize = 4;

/// The result of an evaluation.
#[derive(Debug, Clone, Serialize)]
pub struct Summary {
    /// The number of the evaluation in its run, from 0.
    pub evaluation: u64,
    /// Frames that were evaluated.
    pub frames: usize,
    /// Frames that could not be read or driven, with the reason.
    pub bad_frames: Vec<BadFrame>,
    /// Mean absolute steering error on the original frames.
    pub original_steering_error: f64,
    /// One row for each perturbation and level.
    pub rows: Vec<Row>,
}

/// A frame that could not be evaluated.
#[derive(Debug, Clone, Serialize)]
pub struct BadFrame {
    /// Its name.
    pub frame: String,
    /// The reason.
    pub error: String,
}

/// How the driver did under one perturbation at one level.
#[derive(Debug, Clone, Serialize)]
pub struct Row {
    /// The perturbation.
    pub perturbation: String,
    /// The perturbation with its parameters, which tells it from the same one with others.
    pub label: String,
    /// Its level.
    pub level: f64,
    /// Mean absolute difference between the prediction on the perturbed frame and the recorded steering.
    pub steering_error: f64,
    /// Mean absolute difference between the predictions on the perturbed and on the original frame.
    pub steering_drift: f64,
    /// The same for the throttle.
    pub throttle_error: f64,
    /// The same for the throttle.
    pub throttle_drift: f64,
}

/// How long it took: the part of the result that differs from run to run.
#[derive(Debug, Clone, Serialize)]
pub struct Performance {
    /// Workers at most.
    pub workers: usize,
    /// Perturbed frames, each with a prediction.
    pub perturbed_frames: usize,
    /// Wall time in seconds.
    pub wall_seconds: f64,
    /// Perturbed frames per second of wall time.
    pub frames_per_second: f64,
    /// Mean time of one perturbation in milliseconds, over all perturbations and levels.
    pub perturbation_milliseconds: f64,
    /// Mean time of one prediction in milliseconds.
    pub driver_milliseconds: f64,
}

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
        truth: Control,
        original: Control,
        perturbed: Control,
    },
    Bad {
        evaluation: u64,
        index: usize,
        frame: String,
        error: String,
    },
}

/// What one frame came to.
#[derive(Debug)]
enum Frame {
    Good { frame: String, truth: Control, original: Control, perturbed: Vec<Control> },
    Bad(BadFrame),
}

/// The file of results, with what an earlier process left in it.
pub struct Results {
    lines: Lines,
    /// Lines of evaluations that have not been come to yet, each with its length in bytes.
    recorded: VecDeque<(Line, u64)>,
    /// Up to here, in bytes, lines were taken up or written.
    length: u64,
}

impl Results {
    /// Opens the file.
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
        Ok(Self { lines, recorded, length: 0 })
    }

    /// The next frame of an evaluation, where it is recorded as a whole.
    fn take(&mut self, number: u64, index: usize, cells: &[AppliedPerturbation]) -> Option<Frame> {
        match self.recorded.front()? {
            (Line::Bad { evaluation, index: at, frame, error }, length) => {
                if (*evaluation, *at) != (number, index) {
                    return None;
                }
                let bad = BadFrame { frame: frame.clone(), error: error.clone() };
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
                    Line::Bad { .. } => false,
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
        }
    }

    /// Adds the lines of the next frame. What an earlier process left behind the last frame that was taken up is forgotten.
    fn add(&mut self, text: &[u8]) -> Result<()> {
        if self.length < self.lines.length() {
            self.lines.truncate(self.length)?;
            self.recorded.clear();
        }
        self.lines.add(text)?;
        self.length = self.lines.length();
        Ok(())
    }
}

/// The level of a cell, which is the same for all frames.
fn level_of(cell: &AppliedPerturbation) -> f64 {
    cell.level.constant().unwrap_or_default()
}

/// What is evaluated, and where it goes.
pub struct Job<'a> {
    /// What every frame goes through.
    pub evaluation: Evaluation,
    /// The number of frames.
    pub frames: usize,
    /// Which of them are evaluated, where this is a part of a run.
    pub shard: Option<Shard>,
    /// The number of the evaluation in its run.
    pub number: u64,
    /// Workers at most.
    pub workers: usize,
    /// Where the lines go.
    pub results: &'a mut Results,
    /// Told how many frames are done.
    pub progress: &'a mut dyn FnMut(u64),
}

/// Evaluates every frame, and writes a line for each perturbation and level.
///
/// # Errors
/// If no frame of a whole run can be evaluated, the session is over, or the record cannot be written.
pub fn evaluate(session: &mut Session, job: Job<'_>) -> Result<(Summary, Performance)> {
    let Job { evaluation, frames, shard, number, workers, results, progress } = job;
    if frames == 0 {
        return Err(Error::new("the dataset has no frames; name a folder that has some"));
    }
    let started = Instant::now();
    let mut collector = Collector::new(&evaluation.perturbations, number);
    let own: Vec<usize> = shard.map_or_else(|| (0..frames).collect(), |shard| shard.own(frames).collect());
    let mut done = 0;
    while done < own.len()
        && let Some(frame) = results.take(number, own[done], &evaluation.perturbations)
    {
        collector.count(frame);
        done += 1;
        progress(done as u64);
    }
    let new = own.len() - done;
    let mut under_way = VecDeque::new();
    let mut waiting = own[done..].iter();
    let mut written = Instant::now();
    for &index in &own[done..] {
        while under_way.len() < workers * WINDOW
            && let Some(&index) = waiting.next()
        {
            under_way.push_back(session.evaluate(EvaluateFrame { evaluation: evaluation.clone(), index }));
        }
        let Some(ticket) = under_way.pop_front() else { break };
        let frame = match session.wait(ticket, &mut |_| {})? {
            Reply::Evaluated(evaluated) => collector.evaluated(*evaluated),
            Reply::Failed(Failure { message, frame, .. }) => {
                let frame = frame.unwrap_or_else(|| format!("frame {index}"));
                Frame::Bad(BadFrame { frame, error: message })
            }
            _ => return Err(Error::new("a frame came to something else, which is a defect in pdk")),
        };
        results.add(collector.print(index, &frame)?)?;
        collector.count(frame);
        done += 1;
        progress(done as u64);
        // A power cut loses no more than a second.
        if written.elapsed() > Duration::from_secs(1) {
            results.lines.sync()?;
            written = Instant::now();
        }
    }
    results.lines.sync()?;
    // A part may have no frame at all that is good.
    if shard.is_none() {
        collector.check()?;
    }
    Ok(collector.finish(new, workers, started.elapsed()))
}

/// Sums frames up, in their order.
struct Collector<'a> {
    cells: &'a [AppliedPerturbation],
    number: u64,
    frames: usize,
    bad_frames: Vec<BadFrame>,
    original_error: f64,
    sums: Vec<[f64; 4]>,
    perturbing: f64,
    driving: f64,
    text: Vec<u8>,
}

impl<'a> Collector<'a> {
    fn new(cells: &'a [AppliedPerturbation], number: u64) -> Self {
        Self {
            cells,
            number,
            frames: 0,
            bad_frames: Vec::new(),
            original_error: 0.0,
            sums: vec![[0.0; 4]; cells.len()],
            perturbing: 0.0,
            driving: 0.0,
            text: Vec::new(),
        }
    }

    fn evaluated(&mut self, evaluated: Evaluated) -> Frame {
        let Evaluated { frame, truth, original, perturbed, perturbation_seconds, driver_seconds } = evaluated;
        self.perturbing += perturbation_seconds;
        self.driving += driver_seconds;
        Frame::Good { frame, truth, original, perturbed }
    }

    /// The lines of a frame.
    fn print(&mut self, index: usize, frame: &Frame) -> Result<&[u8]> {
        self.text.clear();
        let evaluation = self.number;
        let mut add = |line: &Line| -> Result<()> {
            serde_json::to_writer(&mut self.text, line)?;
            Ok(self.text.write_all(b"\n")?)
        };
        match frame {
            Frame::Bad(BadFrame { frame, error }) => {
                add(&Line::Bad { evaluation, index, frame: frame.clone(), error: error.clone() })?;
            }
            Frame::Good { frame, truth, original, perturbed } => {
                for (cell, perturbed) in self.cells.iter().zip(perturbed) {
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
                    })?;
                }
            }
        }
        Ok(&self.text)
    }

    fn count(&mut self, frame: Frame) {
        let (truth, original, perturbed) = match frame {
            Frame::Bad(bad) => return self.bad_frames.push(bad),
            Frame::Good { truth, original, perturbed, .. } => (truth, original, perturbed),
        };
        self.frames += 1;
        self.original_error += (original.steering - truth.steering).abs();
        for (sums, control) in self.sums.iter_mut().zip(perturbed) {
            sums[0] += (control.steering - truth.steering).abs();
            sums[1] += (control.steering - original.steering).abs();
            sums[2] += (control.throttle - truth.throttle).abs();
            sums[3] += (control.throttle - original.throttle).abs();
        }
    }

    /// Makes sure that there was a good frame.
    fn check(&self) -> Result<()> {
        match (self.frames, self.bad_frames.first()) {
            (0, Some(BadFrame { frame, error })) => Err(Error::new(format!(
                "none of the {} frames could be evaluated; the first: {frame}: {error}",
                self.bad_frames.len()
            ))),
            _ => Ok(()),
        }
    }

    /// `new` is how many frames were not recorded already. Means over no frames are 0.
    fn finish(self, new: usize, workers: usize, wall: Duration) -> (Summary, Performance) {
        let count = self.frames.max(1) as f64;
        let rows = self.cells.iter().zip(&self.sums).map(|(cell, sums)| Row {
            perturbation: cell.name.clone(),
            label: cell.label(),
            level: level_of(cell),
            steering_error: sums[0] / count,
            steering_drift: sums[1] / count,
            throttle_error: sums[2] / count,
            throttle_drift: sums[3] / count,
        });
        let perturbed = new * self.cells.len();
        let performance = Performance {
            workers,
            perturbed_frames: perturbed,
            wall_seconds: wall.as_secs_f64(),
            frames_per_second: perturbed as f64 / wall.as_secs_f64().max(f64::MIN_POSITIVE),
            perturbation_milliseconds: self.perturbing * 1e3 / perturbed.max(1) as f64,
            driver_milliseconds: self.driving * 1e3 / (perturbed + new).max(1) as f64,
        };
        let summary = Summary {
            evaluation: self.number,
            frames: self.frames,
            original_steering_error: self.original_error / count,
            rows: rows.collect(),
            bad_frames: self.bad_frames,
        };
        (summary, performance)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cells() -> Vec<AppliedPerturbation> {
        ["fog@1", "fog@2"].map(|text| AppliedPerturbation::parse(text).unwrap()).to_vec()
    }

    fn good(steering: f64) -> Frame {
        let control = |steering| Control { steering, throttle: 0.5 };
        let perturbed = vec![control(steering + 0.1), control(steering + 0.3)];
        Frame::Good { frame: "a".into(), truth: control(0.0), original: control(steering), perturbed }
    }

    #[test]
    fn what_is_recorded_is_taken_up_and_half_a_frame_is_not() {
        let path = std::env::temp_dir().join(format!("pdk-results-{}.jsonl", std::process::id()));
        let _ = std::fs::remove_file(&path);
        let cells = cells();
        let mut collector = Collector::new(&cells, 0);
        let mut results = Results::open(&path).unwrap();
        for (index, frame) in
            [good(0.1), Frame::Bad(BadFrame { frame: "b".into(), error: "cut".into() }), good(0.2)]
                .iter()
                .enumerate()
        {
            results.add(collector.print(index, frame).unwrap()).unwrap();
        }
        drop(results);
        let whole = std::fs::read(&path).unwrap();
        // The last line of the last frame is missing, and half of the one before.
        let lines: Vec<&[u8]> = whole.split_inclusive(|byte| *byte == b'\n').collect();
        let cut: usize = lines[..4].iter().map(|line| line.len()).sum();
        std::fs::write(&path, &whole[..cut + 5]).unwrap();
        let mut results = Results::open(&path).unwrap();
        assert!(matches!(results.take(0, 0, &cells), Some(Frame::Good { .. })));
        assert!(matches!(results.take(0, 1, &cells), Some(Frame::Bad(_))));
        assert!(results.take(0, 2, &cells).is_none());
        results.add(collector.print(2, &good(0.2)).unwrap()).unwrap();
        assert!(results.recorded.is_empty());
        assert_eq!(std::fs::read(&path).unwrap(), whole);
        // Another evaluation is not taken for this one.
        let mut results = Results::open(&path).unwrap();
        assert!(results.take(1, 0, &cells).is_none() && results.take(0, 0, &cells[..1]).is_none());
        std::fs::remove_file(&path).unwrap();
    }

    #[test]
    fn sums_are_means_over_good_frames() {
        let cells = cells();
        let mut collector = Collector::new(&cells, 0);
        collector.count(good(0.1));
        collector.count(Frame::Bad(BadFrame { frame: "b".into(), error: "cut".into() }));
        collector.count(good(0.3));
        assert!(collector.check().is_ok());
        let (summary, _) = collector.finish(3, 1, Duration::from_secs(1));
        assert_eq!((summary.frames, summary.bad_frames.len()), (2, 1));
        assert!((summary.original_steering_error - 0.2).abs() < 1e-12);
        assert!((summary.rows[1].steering_error - 0.5).abs() < 1e-12);
        assert!((summary.rows[1].steering_drift - 0.3).abs() < 1e-12);
    }
}
