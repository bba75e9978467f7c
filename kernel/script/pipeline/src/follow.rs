//! Who follows a run while it goes on: a person at a terminal, a program that reads lines of JSON, or no one.

use std::borrow::Cow;
use std::cell::Cell;
use std::io::{self, Write};
use std::time::{Duration, Instant};

use indicatif::ProgressBar;
use pdk_notice::println;
use pdk_sdk::error::{Error, ErrorKind};
use serde::Serialize;
use serde_json::Value;

use crate::finished::{Finished, Summary};

/// How often progress is reported to a program.
const OFTEN: Duration = Duration::from_millis(200);

/// Who follows a run.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Audience {
    /// A person: progress bars on standard error, tables on standard output.
    Person,
    /// A program, which gets everything on standard output: see [`Told`].
    Program,
    /// No one: only the result counts.
    None,
}

/// The messages to a program, a line of JSON each. `docs/session-protocol.md` is the page about it.
#[derive(Debug, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Told<'a> {
    /// The session has begun.
    Ready {
        /// The version of the protocol.
        protocol: u32,
        /// The version of pdk.
        pdk: &'a str,
        /// How many scenarios are driven at the same time.
        slots: usize,
    },
    /// This many frames are done, of a total.
    Progress {
        /// Frames that are done.
        frames: u64,
        /// Frames that there are, as far as it is known.
        of: u64,
    },
    /// A table that the pipeline prints, without what a terminal would obey.
    Text(&'a str),
    /// What a call returned.
    Returned(&'a Value),
    /// What a call failed with.
    Failed(Failed<'a>),
    /// The run is over.
    End {
        /// The folder of the record; none if nothing was driven or evaluated.
        record: Option<&'a std::path::Path>,
        /// The table at the end.
        summary: &'a Summary,
        /// How fast it went, a line each.
        speed: &'a [String],
        /// Why the run counts as failed.
        failure: Option<Failed<'a>>,
    },
}

/// An error in a message to a program.
#[derive(Debug, Serialize)]
pub struct Failed<'a> {
    /// Its kind.
    kind: ErrorKind,
    /// Its sentence, without what a terminal would obey.
    message: Cow<'a, str>,
}

impl<'a> From<&'a Error> for Failed<'a> {
    fn from(error: &'a Error) -> Self {
        Self { kind: error.kind(), message: pdk_notice::printable(error.message()) }
    }
}

impl<'a> From<&'a Finished> for Told<'a> {
    fn from(finished: &'a Finished) -> Self {
        Self::End {
            record: finished.record.as_deref(),
            summary: &finished.summary,
            speed: &finished.speed,
            failure: finished.failure.as_ref().map(Failed::from),
        }
    }
}

/// Tells the program at the other end of standard output. If it is gone, the end of its input shows it.
pub fn tell(message: &Told<'_>) {
    // The message at the end may be long, so it goes out as it is made.
    let mut output = io::BufWriter::with_capacity(1 << 16, io::stdout().lock());
    let _ = serde_json::to_writer(&mut output, message)
        .map(|()| output.write_all(b"\n").and_then(|()| output.flush()));
}

/// How far a part of a run is.
pub struct Progress {
    audience: Audience,
    bar: ProgressBar,
    /// When the program was told last.
    told: Cell<Option<Instant>>,
}

impl Progress {
    /// Nothing is done of nothing. `numbers` stands behind the bar that a person sees.
    pub fn new(audience: Audience, numbers: &str) -> Self {
        let bar = pdk_terminal::progress(audience != Audience::Person, numbers);
        Self { audience, bar, told: Cell::new(None) }
    }

    /// There are this many frames more.
    pub fn add(&self, frames: u64) {
        self.bar.inc_length(frames);
    }

    /// This many frames are done.
    pub fn set(&self, done: u64) {
        self.bar.set_position(done);
        let due = self.told.get().is_none_or(|told| told.elapsed() >= OFTEN);
        if self.audience == Audience::Program && due {
            self.tell();
        }
    }

    /// Nothing more is to be done.
    pub fn finish(&self) {
        // If nothing was said of it, there is nothing to put right.
        if self.audience == Audience::Program && self.told.get().is_some() {
            self.tell();
        }
        self.bar.finish_and_clear();
    }

    fn tell(&self) {
        self.told.set(Some(Instant::now()));
        tell(&Told::Progress {
            frames: self.bar.position(),
            of: self.bar.length().unwrap_or(self.bar.position()),
        });
    }

    /// Prints a table.
    pub fn print(&self, text: &str) {
        match self.audience {
            Audience::Person => self.bar.suspend(|| println!("{text}")),
            Audience::Program => tell(&Told::Text(&pdk_notice::printable(text))),
            Audience::None => {}
        }
    }
}
