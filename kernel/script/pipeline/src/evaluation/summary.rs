//! What an evaluation says: means with their intervals, and the levels from which on they exceed a tolerance.

use pdk_model::perturbation::AppliedPerturbation;
use pdk_sdk::prelude::Control;
use pdk_statistics::exceeded::{self, Exceeded};
use pdk_statistics::{CONFIDENCE, Estimate, blocks};
use serde::Serialize;

use super::check::Check;
use super::results::{BadFrame, Frame, level_of};

/// The result of an evaluation.
#[derive(Debug, Clone, Serialize)]
pub struct Summary {
    /// The number of the evaluation in its run, from 0.
    pub evaluation: u64,
    /// Frames that were evaluated.
    pub frames: usize,
    /// Stretches of the recording without a gap.
    pub sequences: usize,
    /// Frames that could not be read or driven, with the reason.
    pub bad_frames: Vec<BadFrame>,
    /// How the driver does on the frames as they are, beside a constant.
    pub check: Check,
    /// Mean absolute steering error on the original frames.
    pub original_steering_error: f64,
    /// Its interval.
    pub original_steering_error_interval: Option<Interval>,
    /// Mean absolute throttle error on the original frames.
    pub original_throttle_error: f64,
    /// One row for each perturbation and level.
    pub rows: Vec<Row>,
    /// The drift of the steering that [`Summary::levels`] are about.
    pub tolerance: f64,
    /// For each perturbation the level from which on the drift of the steering exceeds the tolerance.
    pub levels: Vec<LevelRow>,
}

/// Where a mean may lie, with a probability of 95 %.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct Interval {
    /// Its lower end.
    pub low: f64,
    /// Its upper end.
    pub high: f64,
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
    /// Its interval.
    pub steering_error_interval: Option<Interval>,
    /// Mean absolute difference between the predictions on the perturbed and on the original frame.
    pub steering_drift: f64,
    /// Its interval.
    pub steering_drift_interval: Option<Interval>,
    /// The same for the throttle.
    pub throttle_error: f64,
    /// Its interval.
    pub throttle_error_interval: Option<Interval>,
    /// The same for the throttle.
    pub throttle_drift: f64,
    /// Its interval.
    pub throttle_drift_interval: Option<Interval>,
}

/// From which level on a perturbation makes the driver drift.
#[derive(Debug, Clone, Serialize)]
pub struct LevelRow {
    /// The perturbation.
    pub perturbation: String,
    /// The perturbation with its parameters.
    pub label: String,
    /// The level with its interval.
    #[serde(flatten)]
    pub exceeded: Exceeded,
}

/// Gathers frames, in their order.
pub struct Collector<'a> {
    cells: &'a [AppliedPerturbation],
    truth: Vec<Control>,
    original: Vec<Control>,
    /// For each cell what the driver makes of each good frame.
    perturbed: Vec<Vec<Control>>,
    bad_frames: Vec<BadFrame>,
}

impl<'a> Collector<'a> {
    /// Nothing yet of these perturbations.
    pub fn new(cells: &'a [AppliedPerturbation]) -> Self {
        let perturbed = vec![Vec::new(); cells.len()];
        Self { cells, truth: Vec::new(), original: Vec::new(), perturbed, bad_frames: Vec::new() }
    }

    /// Adds a frame.
    pub fn add(&mut self, frame: Frame) {
        match frame {
            Frame::Bad(bad) => self.bad_frames.push(bad),
            Frame::Good { truth, original, perturbed, .. } => {
                self.truth.push(truth);
                self.original.push(original);
                for (all, control) in self.perturbed.iter_mut().zip(perturbed) {
                    all.push(control);
                }
            }
        }
    }

    /// The good frames.
    pub fn frames(&self) -> usize {
        self.truth.len()
    }

    /// The bad frames.
    pub fn bad_frames(&self) -> &[BadFrame] {
        &self.bad_frames
    }

    /// What all of them say. Means over no frames are 0.
    pub fn finish(self, evaluation: u64, sequences: usize, check: Check, tolerance: f64) -> Summary {
        let Self { cells, truth, original, perturbed, bad_frames } = self;
        let original_steering = mean(&original, &truth, steering);
        let measured: Vec<(Row, Estimate)> = cells
            .iter()
            .zip(&perturbed)
            .map(|(cell, perturbed)| {
                let (error, drift) =
                    (mean(perturbed, &truth, steering), mean(perturbed, &original, steering));
                let (throttle_error, throttle_drift) =
                    (mean(perturbed, &truth, throttle), mean(perturbed, &original, throttle));
                let row = Row {
                    perturbation: cell.name.clone(),
                    label: cell.label(),
                    level: level_of(cell),
                    steering_error: error.value,
                    steering_error_interval: interval(&error),
                    steering_drift: drift.value,
                    steering_drift_interval: interval(&drift),
                    throttle_error: throttle_error.value,
                    throttle_error_interval: interval(&throttle_error),
                    throttle_drift: throttle_drift.value,
                    throttle_drift_interval: interval(&throttle_drift),
                };
                (row, drift)
            })
            .collect();
        let levels = levels(&measured, tolerance);
        Summary {
            evaluation,
            frames: truth.len(),
            sequences,
            bad_frames,
            check,
            original_steering_error: original_steering.value,
            original_steering_error_interval: interval(&original_steering),
            original_throttle_error: mean(&original, &truth, throttle).value,
            rows: measured.into_iter().map(|(row, _)| row).collect(),
            tolerance,
            levels,
        }
    }
}

/// For each perturbation, in their order, the level from which on it exceeds the tolerance.
fn levels(measured: &[(Row, Estimate)], tolerance: f64) -> Vec<LevelRow> {
    let mut levels: Vec<LevelRow> = Vec::new();
    for (row, _) in measured {
        if levels.iter().any(|known| known.label == row.label) {
            continue;
        }
        let own: Vec<(f64, Estimate)> = measured
            .iter()
            .filter(|(other, _)| other.label == row.label)
            .map(|(other, drift)| (other.level, *drift))
            .collect();
        levels.push(LevelRow {
            perturbation: row.perturbation.clone(),
            label: row.label.clone(),
            exceeded: exceeded::from_level(&own, tolerance),
        });
    }
    levels
}

fn steering(control: &Control) -> f64 {
    control.steering
}

fn throttle(control: &Control) -> f64 {
    control.throttle
}

/// The mean absolute difference of a number, with its interval.
fn mean(controls: &[Control], from: &[Control], number: fn(&Control) -> f64) -> Estimate {
    let differences: Vec<f64> =
        controls.iter().zip(from).map(|(control, from)| (number(control) - number(from)).abs()).collect();
    let none = Estimate { value: 0.0, low: f64::NEG_INFINITY, high: f64::INFINITY };
    blocks::mean(&differences, blocks::length(&differences), CONFIDENCE).unwrap_or(none)
}

/// The interval, unless the frames are too few to say anything.
fn interval(estimate: &Estimate) -> Option<Interval> {
    let Estimate { low, high, .. } = *estimate;
    (low.is_finite() && high.is_finite()).then_some(Interval { low, high })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn good(steering: f64, perturbed: [f64; 2]) -> Frame {
        let control = |steering| Control { steering, throttle: 0.5 };
        Frame::Good {
            frame: "a.jpg".into(),
            truth: control(0.0),
            original: control(steering),
            perturbed: perturbed.map(control).to_vec(),
        }
    }

    #[test]
    fn means_are_over_good_frames_and_levels_follow_from_the_drift() {
        let cells: Vec<AppliedPerturbation> = ["fog@1", "fog@2"].map(|text| text.parse().unwrap()).to_vec();
        let mut collector = Collector::new(&cells);
        for _ in 0..20 {
            collector.add(good(0.1, [0.1, 0.5]));
            collector.add(good(0.3, [0.3, 0.7]));
        }
        collector.add(Frame::Bad(BadFrame { frame: "b".into(), error: "cut".into(), by_driver: false }));
        let check = Check::of(&[], 0);
        let summary = collector.finish(0, 1, check, 0.2);
        assert_eq!((summary.frames, summary.bad_frames.len()), (40, 1));
        assert!((summary.original_steering_error - 0.2).abs() < 1e-12);
        assert!((summary.rows[1].steering_error - 0.6).abs() < 1e-12);
        assert!((summary.rows[1].steering_drift - 0.4).abs() < 1e-12);
        let Interval { low, high } = summary.rows[1].steering_error_interval.unwrap();
        assert!(low < 0.6 && 0.6 < high);
        assert_eq!(summary.levels.len(), 1);
        assert!((summary.levels[0].exceeded.level.unwrap() - 1.5).abs() < 1e-12);
    }
}
