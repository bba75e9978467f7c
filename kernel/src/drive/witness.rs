//! Who looks on while scenarios are driven: the record of a run is written by one, and a replay compares with another.

use std::sync::{Mutex, PoisonError};

use pdk_sdk::error::Result;
use pdk_sdk::prelude::{Camera, Frame};

use super::Outcome;
use super::recent::Recent;
use super::recorder::Recorder;
use crate::record::trace::{ImageTopic, Step};
use crate::record::{Lines, RunDirectory};

/// Looks on while one thread drives one scenario after the other.
///
/// For each it is called in this order: `start`, then `event` with the scenario's name, `step` for each frame and `event`
/// with the end, then `finish`.
pub trait Witness: Send {
    /// What it has to say of a scenario.
    type Verdict: Send;

    /// The scenario of this number begins. A verdict where it need not be driven.
    ///
    /// # Errors
    /// Ends the run.
    fn start(&mut self, index: u64, camera: Camera) -> Result<Option<Self::Verdict>>;

    /// Something happened at this simulation time in seconds.
    fn event(&mut self, time: f64, failure: bool, text: &str);

    /// The loop went around once, with the frame as the camera saw it and as the driver saw it. What goes wrong here is
    /// said by `finish`.
    fn step(&mut self, step: &Step, raw: Frame<'_>, perturbed: Frame<'_>);

    /// In real time: how many frames were skipped after this one, where that is known already; otherwise the clock decides.
    fn skipped(&self, _sequence: u64) -> Option<u64> {
        None
    }

    /// The scenario is over.
    ///
    /// # Errors
    /// Ends the run.
    fn finish(&mut self, outcome: Outcome) -> Result<Self::Verdict>;
}

/// Writes a line and a trace for each scenario, with the last frames of those that fail.
pub struct WriteRecord<'a> {
    directory: &'a RunDirectory,
    lines: &'a Mutex<Lines>,
    recorder: Recorder,
    /// Every how many frames an image is written; 0 for none.
    images_every: u64,
    /// The number of the latest image that was written.
    last_image: Option<u64>,
    recent: Recent,
}

impl<'a> WriteRecord<'a> {
    /// A witness that writes; all threads share the lines.
    ///
    /// # Errors
    /// Where the system has no thread left.
    pub fn new(directory: &'a RunDirectory, lines: &'a Mutex<Lines>, images_every: u64) -> Result<Self> {
        let (recorder, recent) = (Recorder::new()?, Recent::default());
        Ok(Self { directory, lines, recorder, images_every, last_image: None, recent })
    }
}

impl Witness for WriteRecord<'_> {
    type Verdict = Outcome;

    fn start(&mut self, index: u64, _camera: Camera) -> Result<Option<Outcome>> {
        self.recorder.start(self.directory.trace(index)?);
        self.last_image = None;
        self.recent.clear();
        Ok(None)
    }

    fn event(&mut self, time: f64, failure: bool, text: &str) {
        if failure {
            let later = |sequence| self.last_image.is_none_or(|last| sequence > last);
            for pair in self.recent.before_the_end().into_iter().filter(|pair| later(pair.sequence)) {
                self.recorder.image(ImageTopic::Raw, pair.sequence, pair.time, pair.raw.as_ref());
                self.recorder.image(ImageTopic::Perturbed, pair.sequence, pair.time, pair.perturbed.as_ref());
            }
        }
        self.recorder.event(time, failure, text);
    }

    fn step(&mut self, step: &Step, raw: Frame<'_>, perturbed: Frame<'_>) {
        self.recorder.step(*step);
        if self.images_every > 0 && step.sequence.is_multiple_of(self.images_every) {
            self.recorder.image(ImageTopic::Raw, step.sequence, step.state.time, raw);
            self.recorder.image(ImageTopic::Perturbed, step.sequence, step.state.time, perturbed);
            self.last_image = Some(step.sequence);
        }
        // Where every image is written, none is left for the end.
        if self.images_every != 1 {
            self.recent.add(step.sequence, step.state.time, raw, perturbed);
        }
    }

    /// The trace is complete before the line says so, and the line is there before the next scenario begins: a run that
    /// ends then loses only what was in flight.
    fn finish(&mut self, outcome: Outcome) -> Result<Outcome> {
        self.recorder.finish()?;
        let mut lines = self.lines.lock().unwrap_or_else(PoisonError::into_inner);
        lines.write(&outcome)?;
        lines.sync()?;
        Ok(outcome)
    }
}
