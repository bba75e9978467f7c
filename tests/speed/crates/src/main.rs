//! Measures kornia-rs, `fast_image_resize` and libblur, for `tests/speed/compare.py`, which gives it one task a line and reads one
//! answer a line, both as JSON.
//!
//! A task names a frame, the library and what it does. The answer has the median processor time of a call, as pdk's own benchmark
//! (`tests/benches/speed.rs`) measures it: one thread, memory kept from call to call, a few calls before the first that counts. The
//! picture that the last call made goes into a file, so that the other side can see whether it is the right one.

mod blur;
mod kornia;
mod resize;
mod task;

use std::error::Error;
use std::fs;
use std::io::{self, BufRead, Write};

use kornia_image::{Image, ImageSize};
use rustix::time::{ClockId, clock_gettime};
use serde_json::json;

use crate::task::{Library, Task};

/// A frame: red, green and blue in bytes.
type Frame = Image<u8, 3>;
/// What any of the libraries may fail with.
type Failed = Box<dyn Error + Send + Sync>;
/// What a library does to a frame, with all that it can prepare or keep.
type Step = Box<dyn FnMut(&Frame, &mut Frame) -> Result<(), Failed>>;

fn main() -> Result<(), Failed> {
    // The pool of kornia-rs: this thread alone, so that its clock counts all work.
    rayon::ThreadPoolBuilder::new().num_threads(1).use_current_thread().build_global()?;
    let mut answers = io::stdout().lock();
    for line in io::stdin().lock().lines() {
        let answer = match measured(&line?) {
            Ok(ms) => json!({ "ms": ms }),
            Err(failed) => json!({ "error": failed.to_string() }),
        };
        writeln!(answers, "{answer}")?;
        answers.flush()?;
    }
    Ok(())
}

/// Milliseconds that the task of a line takes.
fn measured(line: &str) -> Result<f64, Failed> {
    let Task { library, work, size: [width, height], frame, picture } = serde_json::from_str(line)?;
    let source = Frame::new(ImageSize { width, height }, fs::read(frame)?)?;
    let mut target = Frame::from_size_val(source.size(), 0)?;
    let mut step = match library {
        Library::Kornia => kornia::step(&work, source.size())?,
        Library::FastImageResize => resize::step(&work, source.size())?,
        Library::Libblur => blur::step(&work, source.size())?,
    };
    let ms = median(&mut || step(&source, &mut target))?;
    fs::write(picture, target.as_slice())?;
    Ok(ms)
}

/// The median processor time of a call in milliseconds, after a few calls that fill caches.
fn median(work: &mut dyn FnMut() -> Result<(), Failed>) -> Result<f64, Failed> {
    const WARM_UP: u64 = 3;
    const BUDGET: f64 = 0.06;
    for _ in 0..WARM_UP {
        work()?;
    }
    let process = seconds(ClockId::ProcessCPUTime);
    let started = seconds(ClockId::ThreadCPUTime);
    let mut times = Vec::new();
    while times.len() < 7 || (seconds(ClockId::ThreadCPUTime) - started < BUDGET && times.len() < 2_000) {
        let call = seconds(ClockId::ThreadCPUTime);
        work()?;
        times.push(seconds(ClockId::ThreadCPUTime) - call);
    }
    let (thread, process) =
        (seconds(ClockId::ThreadCPUTime) - started, seconds(ClockId::ProcessCPUTime) - process);
    if process > 1.05 * thread + 1e-3 {
        return Err("it works on other threads too, whose time would not count".into());
    }
    times.sort_unstable_by(f64::total_cmp);
    Ok(times[times.len() / 2] * 1e3)
}

/// Seconds of a clock of processor time.
fn seconds(clock: ClockId) -> f64 {
    let time = clock_gettime(clock);
    #[allow(clippy::cast_precision_loss)] // A double has nanoseconds of three months.
    let seconds = time.tv_sec as f64 + time.tv_nsec as f64 * 1e-9;
    seconds
}

/// What a library has no function for.
fn unknown() -> Failed {
    "the library has no function for this".into()
}
