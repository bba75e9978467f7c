//! The offline loop: the frames of a dataset are driven one after the other, as they are and under every perturbation at every level,
//! and what the driver makes of them is compared with the recorded ground truth and with what it makes of the original.
//!
//! First the frames are driven as they are, which shows whether the driver can be ranked at all. Then each piece of a recording is
//! driven under each perturbation. Lines are written in the order of the frames, whatever the number of workers; so what a killed run
//! left is a beginning, and continuing it is going on behind that. A [`journal`] has what is done and cannot be written in order yet.

mod check;
mod feed;
mod journal;
mod results;
mod segments;
mod summary;

use std::ops::Range;
use std::time::{Duration, Instant};

use pdk_loop::protocol::{EvaluateFrames, EvaluatedFrame, Subject};
use pdk_model::component::ComponentSpec;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_model::shard::Shard;
use pdk_sdk::error::{Error, Result};
use pdk_sdk::prelude::Control;
use pdk_session::session::Session;
use serde::Serialize;

use self::check::Check;
pub use self::feed::{Feed, Times};
use self::results::Frame;
pub use self::results::{BadFrame, Results, TaskFrame, level_of};
use self::segments::DRIVER;
pub use self::segments::{PREDICTOR, Segment, segments};
use self::summary::Collector;
pub use self::summary::{Interval, Summary};

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

/// What is evaluated.
#[derive(Debug, Clone)]
pub struct Evaluation {
    /// Where the frames come from.
    pub dataset: ComponentSpec,
    /// The driver under test.
    pub driver: ComponentSpec,
    /// Each perturbation at each level.
    pub cells: Vec<AppliedPerturbation>,
    /// What random numbers come from.
    pub seed: u64,
    /// The number of frames.
    pub frames: usize,
    /// Those that begin a sequence.
    pub sequences: Vec<usize>,
    /// The part that is evaluated, if this is a part of a run.
    pub shard: Option<Shard>,
    /// Whether the driver is ranked however it does on the frames as they are.
    pub trust: bool,
    /// The drift of the steering of which the levels are looked for that exceed it.
    pub tolerance: f64,
}

/// What an evaluation came to.
pub enum Evaluated {
    /// The driver was ranked.
    Ranked(Box<Summary>, Performance),
    /// It was not; the check says why.
    Refused(Check, Error),
}

impl Evaluation {
    /// The pieces of the recording that are evaluated here.
    pub fn own(&self) -> Vec<Segment> {
        let all = segments(&self.sequences, self.frames, DRIVER);
        match self.shard {
            Some(shard) => shard.own(all.len()).map(|place| all[place]).collect(),
            None => all,
        }
    }

    /// The job that drives frames of a segment.
    fn job(
        &self,
        segment: &Segment,
        frames: &Range<usize>,
        perturbation: Option<&AppliedPerturbation>,
    ) -> EvaluateFrames {
        EvaluateFrames {
            dataset: self.dataset.clone(),
            subject: Subject::Driver(self.driver.clone()),
            perturbation: perturbation.cloned(),
            seed: self.seed,
            sequence: segment.sequence,
            earliest: None,
            // Frames that follow a bad one begin anew.
            from: if frames.start == segment.start { segment.from } else { frames.start },
            start: frames.start,
            end: frames.end,
        }
    }
}

/// Evaluates every frame, and writes a line for each perturbation and level. `number` is that of the evaluation in its run, `progress`
/// is called with how many predictions are done.
///
/// # Errors
/// If no frame of a whole run can be evaluated, the session is over, or the record cannot be written.
pub fn evaluate(
    session: &mut Session,
    evaluation: &Evaluation,
    number: u64,
    results: &mut Results,
    progress: &mut dyn FnMut(u64),
) -> Result<Evaluated> {
    if evaluation.frames == 0 {
        return Err(Error::new("the dataset has no frames; name a folder that has some"));
    }
    let (started, cells, workers) = (Instant::now(), &evaluation.cells, session.slots());
    let own = evaluation.own();
    results.journal.begin(number);
    let mut recorded = Vec::new();
    for segment in &own {
        let Some(frames) = results.take(number, segment.start..segment.end, cells) else { break };
        recorded.push(frames);
    }
    let new = &own[recorded.len()..];
    let before = recorded.iter().map(Vec::len).sum::<usize>() * (cells.len() + 1);
    let since = session.frames();
    let mut tick = |frames: u64| progress(before as u64 + frames - since);
    tick(since);

    let mut times = Times::default();
    let jobs = new.iter().map(|segment| evaluation.job(segment, &(segment.start..segment.end), None));
    let mut feed = Feed::new(jobs, number, workers);
    let mut originals = Vec::new();
    while let Some(frames) = feed.next(session, &mut results.journal, &mut times, &mut tick)? {
        originals.push(frames);
    }
    let of_originals = results.journal.length();
    let check = check(&recorded, &originals).judged(&evaluation.driver);
    // A part has not seen the other frames. What continues the merged record checks all of them.
    if let Some(refusal) = &check.refusal
        && !evaluation.trust
        && evaluation.shard.is_none()
    {
        let error = Error::new(refusal.clone());
        results.journal.close()?;
        return Ok(Evaluated::Refused(check, error));
    }

    let mut collector = Collector::new(cells);
    recorded.into_iter().flatten().for_each(|frame| collector.add(frame));
    let runs: Vec<Vec<Range<usize>>> =
        new.iter().zip(&originals).map(|(segment, originals)| good_runs(segment, originals)).collect();
    let jobs = new.iter().zip(&runs).flat_map(|(segment, runs)| {
        let of_cell = move |cell| runs.iter().map(move |run| evaluation.job(segment, run, Some(cell)));
        cells.iter().flat_map(of_cell)
    });
    let mut feed = Feed::new(jobs, number, workers);
    for ((segment, originals), runs) in new.iter().zip(&originals).zip(&runs) {
        let mut frames: Vec<Frame> = originals.iter().map(without_cells).collect();
        for run in std::iter::repeat_n(runs, cells.len()).flatten() {
            let Some(found) = feed.next(session, &mut results.journal, &mut times, &mut tick)? else {
                return Err(Error::new("there are fewer results than jobs, which is a defect in pdk"));
            };
            let places = run.start - segment.start..run.end - segment.start;
            frames[places].iter_mut().zip(found).for_each(|(frame, found)| add_cell(frame, found));
        }
        results.add(number, segment.start, &frames, cells)?;
        results.journal.forget(of_originals)?;
        frames.into_iter().for_each(|frame| collector.add(frame));
    }
    results.journal.close()?;
    // A part may not have a good frame.
    if let (0, Some(BadFrame { frame, error, .. }), None) =
        (collector.frames(), collector.bad_frames().first(), evaluation.shard)
    {
        return Err(Error::new(format!(
            "none of the {} frames could be evaluated; the first: {frame}: {error}",
            collector.bad_frames().len()
        )));
    }
    let new: usize = new.iter().map(Segment::len).sum();
    let (known, _) = results.journal.taken();
    let driven = (new * (cells.len() + 1)).saturating_sub(known as usize);
    let perturbed = (new * cells.len()).saturating_sub(results.journal.taken().1 as usize);
    let performance = performance((perturbed, driven), workers, times, started.elapsed());
    let sequences = own.iter().filter(|segment| segment.start == segment.sequence).count();
    let summary = collector.finish(number, sequences, check, evaluation.tolerance);
    Ok(Evaluated::Ranked(Box::new(summary), performance))
}

/// How the driver does on the frames as they are, by what is recorded and by what was driven now.
fn check(recorded: &[Vec<Frame>], originals: &[Vec<EvaluatedFrame>]) -> Check {
    let mut good: Vec<(Control, Control)> = Vec::new();
    let mut failed = 0;
    let mut first_failure = None;
    for frame in recorded.iter().flatten() {
        match frame {
            Frame::Good { truth, original, .. } => good.push((*truth, *original)),
            Frame::Bad(BadFrame { error, by_driver: true, .. }) => {
                failed += 1;
                first_failure.get_or_insert(error);
            }
            Frame::Bad(_) => {}
        }
    }
    for frame in originals.iter().flatten() {
        match frame {
            EvaluatedFrame::Good { truth, control, .. } => good.push((*truth, *control)),
            EvaluatedFrame::Bad { error, by_driver: true, .. } => {
                failed += 1;
                first_failure.get_or_insert(error);
            }
            EvaluatedFrame::Bad { .. } | EvaluatedFrame::Predicted { .. } => {}
        }
    }
    let mut check = Check::of(&good, failed);
    check.first_failure = first_failure.cloned();
    check
}

/// The frames of a segment that follow each other without a bad one between them.
fn good_runs(segment: &Segment, originals: &[EvaluatedFrame]) -> Vec<Range<usize>> {
    let mut runs: Vec<Range<usize>> = Vec::new();
    for (index, frame) in (segment.start..).zip(originals) {
        match (frame, runs.last_mut()) {
            (EvaluatedFrame::Bad { .. } | EvaluatedFrame::Predicted { .. }, _) => {}
            (EvaluatedFrame::Good { .. }, Some(run)) if run.end == index => run.end = index + 1,
            (EvaluatedFrame::Good { .. }, _) => runs.push(index..index + 1),
        }
    }
    runs
}

/// A frame of which only the original was driven.
fn without_cells(original: &EvaluatedFrame) -> Frame {
    match original.clone() {
        EvaluatedFrame::Good { frame, truth, control } => {
            Frame::Good { frame, truth, original: control, perturbed: Vec::new() }
        }
        EvaluatedFrame::Bad { frame, error, by_driver } => Frame::Bad(BadFrame { frame, error, by_driver }),
        EvaluatedFrame::Predicted { frame, .. } => Frame::Bad(not_driven(frame)),
    }
}

/// A frame that a worker gave to a predictor.
fn not_driven(frame: String) -> BadFrame {
    BadFrame {
        frame,
        error: "a worker predicted instead of driving, which is a defect in pdk".to_owned(),
        by_driver: false,
    }
}

/// Adds what the driver makes of a frame under the next perturbation. A frame that is bad under one is bad.
fn add_cell(frame: &mut Frame, found: EvaluatedFrame) {
    let Frame::Good { frame: name, perturbed, .. } = frame else { return };
    match found {
        EvaluatedFrame::Good { control, .. } => perturbed.push(control),
        EvaluatedFrame::Predicted { .. } => *frame = Frame::Bad(not_driven(std::mem::take(name))),
        EvaluatedFrame::Bad { error, .. } => {
            // On the frame as it is, the driver did not fail.
            *frame = Frame::Bad(BadFrame { frame: std::mem::take(name), error, by_driver: false });
        }
    }
}

/// How fast this many perturbed frames and predictions were made.
pub fn performance(
    (perturbed, predictions): (usize, usize),
    workers: usize,
    times: Times,
    wall: Duration,
) -> Performance {
    Performance {
        workers,
        perturbed_frames: perturbed,
        wall_seconds: wall.as_secs_f64(),
        frames_per_second: perturbed as f64 / wall.as_secs_f64().max(f64::MIN_POSITIVE),
        perturbation_milliseconds: times.perturbing * 1e3 / perturbed.max(1) as f64,
        driver_milliseconds: times.driving * 1e3 / predictions.max(1) as f64,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn found(steering: Option<f64>) -> EvaluatedFrame {
        match steering {
            Some(steering) => EvaluatedFrame::Good {
                frame: "a".into(),
                truth: Control::default(),
                control: Control { steering, throttle: 0.0 },
            },
            None => EvaluatedFrame::Bad { frame: "a".into(), error: "cut".into(), by_driver: false },
        }
    }

    #[test]
    fn a_bad_frame_divides_a_segment() {
        let segment = Segment { sequence: 0, from: 0, start: 10, end: 16 };
        let frames = [None, Some(0.0), Some(0.0), None, None, Some(0.0)].map(found);
        assert_eq!(good_runs(&segment, &frames), [11..13, 15..16]);
        assert!(good_runs(&segment, &[None].map(found)).is_empty());
    }

    #[test]
    fn a_frame_that_is_bad_under_one_perturbation_is_bad() {
        let mut frame = without_cells(&found(Some(0.5)));
        add_cell(&mut frame, found(Some(0.25)));
        let Frame::Good { perturbed, .. } = &frame else { panic!("it is good") };
        assert_eq!(perturbed.len(), 1);
        add_cell(&mut frame, found(None));
        add_cell(&mut frame, found(Some(0.25)));
        let expected = BadFrame { frame: "a".into(), error: "cut".into(), by_driver: false };
        assert_eq!(frame, Frame::Bad(expected));
    }
}
