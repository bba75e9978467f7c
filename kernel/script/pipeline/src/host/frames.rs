//! How far the scenarios under way are, in frames.

use crate::follow::{Audience, Progress};

/// The bar for frames on the road.
pub(super) struct Frames {
    progress: Progress,
    /// Frames that scenarios did not need.
    spared: u64,
    /// Those that were driven before the bar began.
    before: u64,
}

impl Frames {
    /// A bar for the user who follows the run.
    pub fn new(audience: Audience) -> Self {
        Self {
            progress: Progress::new(audience, "{pos}/{len} frames, {per_sec}, {eta} left"),
            spared: 0,
            before: 0,
        }
    }

    /// Begins anew, after this many frames in all.
    pub fn restart(&mut self, audience: Audience, driven: u64) {
        *self = Self { before: driven, ..Self::new(audience) };
    }

    /// This many more frames may come.
    pub fn expect(&self, frames: u64) {
        self.progress.add(frames);
    }

    /// Of the frames that were expected of a scenario, this many were driven.
    pub fn spare(&mut self, expected: u64, driven: u64) {
        self.spared += expected.saturating_sub(driven);
    }

    /// Takes how many frames were driven in all.
    pub fn tick(&self) -> impl FnMut(u64) + '_ {
        |frames| self.progress.set(frames - self.before + self.spared)
    }

    /// Prints above the bar.
    pub fn print(&self, text: &str) {
        self.progress.print(text);
    }

    /// Nothing more is under way.
    pub fn finish(&self) {
        self.progress.finish();
    }
}
