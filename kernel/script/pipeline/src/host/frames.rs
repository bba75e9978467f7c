//! How far the scenarios under way are, in frames.

use std::cell::Cell;
use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use pdk_record::directory::PROGRESS;
use pdk_sdk::file;
use serde_json::json;

use crate::follow::{Audience, Progress};

/// How often the record says how far the run is.
const OFTEN: Duration = Duration::from_secs(1);

/// The bar for frames on the road.
pub(super) struct Frames {
    progress: Progress,
    /// Frames that scenarios did not need.
    spared: u64,
    /// Those that were driven before the bar began.
    before: u64,
    /// Frames that may come, also if no bar is drawn.
    expected: Cell<u64>,
    began: Instant,
    noted: Cell<Option<Instant>>,
}

impl Frames {
    /// A bar for the user who follows the run.
    pub fn new(audience: Audience) -> Self {
        Self {
            progress: Progress::new(audience, "{pos}/{len} frames, {per_sec}, {eta} left"),
            spared: 0,
            before: 0,
            expected: Cell::new(0),
            began: Instant::now(),
            noted: Cell::new(None),
        }
    }

    /// Begins anew, after this many frames in all.
    pub fn restart(&mut self, audience: Audience, driven: u64) {
        *self = Self { before: driven, ..Self::new(audience) };
    }

    /// This many more frames may come.
    pub fn expect(&self, frames: u64) {
        self.expected.set(self.expected.get() + frames);
        self.progress.add(frames);
    }

    /// Of the frames that were expected of a scenario, this many were driven.
    pub fn spare(&mut self, expected: u64, driven: u64) {
        self.spared += expected.saturating_sub(driven);
    }

    /// Takes how many frames were driven in all, and notes in a record of this many scenarios how far the run is.
    pub fn tick<'a>(&'a self, record: Option<&'a Path>, scenarios: usize) -> impl FnMut(u64) + 'a {
        move |frames| {
            let done = frames - self.before + self.spared;
            self.progress.set(done);
            if let Some(record) = record {
                self.note(record, done, scenarios);
            }
        }
    }

    /// For those who watch the run. Without a note they see less, and it goes on all the same; and it need not survive a power cut.
    fn note(&self, record: &Path, frames: u64, scenarios: usize) {
        if self.noted.get().is_some_and(|noted| noted.elapsed() < OFTEN) {
            return;
        }
        self.noted.set(Some(Instant::now()));
        let of = self.expected.get();
        let seconds = self.began.elapsed().as_secs_f64();
        let note = json!({ "scenarios": scenarios, "frames": frames, "of": of, "seconds": seconds });
        let path = record.join(PROGRESS);
        let part = file::part_of(&path);
        let _ = fs::write(&part, note.to_string()).and_then(|()| fs::rename(&part, &path));
    }

    /// Takes the note away: the run is over.
    pub fn forget(record: &Path) {
        let _ = fs::remove_file(record.join(PROGRESS));
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
