//! What becomes of a scenario whose process is gone: an outcome that says why, and a trace that says the same.

use pdk_model::outcome::{Cause, Outcome};
use pdk_sdk::error::{ErrorKind, Result};
use pdk_trace::writer::Trace;

use crate::protocol::{Answer, Drive, Driven};
use crate::stages::Times;

/// The answer for a scenario whose process was lost after so many frames.
pub fn answer(drive: &Drive, kind: ErrorKind, message: String, frames: u64) -> Answer {
    if let Err(error) = write_trace(drive, &message) {
        return Answer::Broken(error.into());
    }
    let outcome = Outcome {
        success: false,
        cause: Cause::Error,
        error: Some(message),
        error_kind: Some(kind),
        time: 0.0,
        frames,
        skipped_frames: 0,
        progress: 0.0,
        mean_cross_track_error: 0.0,
        max_cross_track_error: 0.0,
        digest: String::new(),
    };
    Answer::Driven(Driven { outcome, rate: 0.0, times: Times::default(), warnings: Vec::new() })
}

/// Writes a trace in the place of one that was not completed, so that equal failures leave equal records.
fn write_trace(drive: &Drive, message: &str) -> Result<()> {
    let Some(path) = &drive.trace else { return Ok(()) };
    let mut trace = Trace::create(path)?;
    trace.event(0.0, false, &drive.name)?;
    trace.event(0.0, true, message)?;
    trace.finish()
}
