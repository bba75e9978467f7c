//! A video, frame by frame.

use std::path::Path;
use std::time::{Duration, Instant};

use indicatif::ProgressBar;
use pdk_chain::chain::Chain;
use pdk_chain::moment::Moment;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_notice::eprintln;
use pdk_notice::println;
use pdk_sdk::error::{Error, Place, Result};
use pdk_sdk::prelude::FrameBuf;
use pdk_video::{Video, Writer, Yuv420};
use serde_json::json;

use super::{Arguments, warn};
use crate::verbs::{Global, print_json};

/// Sends the frames through the chain as one sequence. Only one frame is in memory at a time.
///
/// # Errors
/// If the video cannot be read or written, or a perturbation fails.
pub fn perturb(
    global: &Global,
    arguments: &Arguments,
    video: &Path,
    specs: &[AppliedPerturbation],
    mut chain: Chain,
) -> Result<()> {
    let place = format!("video `{}`", video.display());
    let mut reader = Video::open(video).place(&place)?;
    let rate = reader.rate();
    if reader.has_sound() {
        eprintln!("pdk: warning: {place} has sound, which the result does not have");
    }
    let mut planes = Yuv420::default();
    if !reader.next(&mut planes).place(&place)? {
        return Err(Error::new(format!("{place}: it has no frames")));
    }
    let (width, height) = (planes.width, planes.height);
    let mut writer = Writer::create(&arguments.output, width, height, rate)?;
    let (mut frame, mut perturbed) = (FrameBuf::new(width, height), FrameBuf::new(width, height));
    let progress = progress(global, u64::from(reader.count()));

    let begin = Instant::now();
    let mut perturbing = Duration::ZERO;
    loop {
        if (planes.width, planes.height) != (width, height) {
            return Err(Error::new(format!(
                "{place}: frame {} is {} x {}, but the first is {width} x {height}; convert it to one size",
                writer.frames(),
                planes.width,
                planes.height
            )));
        }
        planes.to_rgb(frame.as_mut());
        let number = writer.frames();
        let before = Instant::now();
        // Frames keep their own times, so that a video without a fixed rate does not run faster or slower.
        let (begins, ends) = (reader.time(number as u32), reader.time(number as u32 + 1));
        let time = arguments.time + begins;
        let moment = Moment::new(arguments.frame.saturating_add(number), time);
        chain.apply(frame.as_ref(), perturbed.as_mut(), &moment)?;
        // Perturbations prepare themselves at their first frame.
        if number > 0 {
            perturbing += before.elapsed();
        }
        writer.push_until(perturbed.as_ref(), ends)?;
        progress.inc(1);
        if !reader.next(&mut planes).place(&place)? {
            break;
        }
    }
    warn(&chain);
    let frames = writer.frames();
    if frames < u64::from(reader.count()) {
        let count = reader.count();
        return Err(Error::new(format!(
            "{place}: it is damaged: {frames} of its {count} frames can be decoded"
        )));
    }
    writer.finish()?;
    progress.finish_and_clear();

    let milliseconds = begin.elapsed().as_secs_f64() * 1e3 / frames as f64;
    let perturbing = perturbing.as_secs_f64() * 1e3 / (frames - 1).max(1) as f64;
    if global.json {
        let specs = specs.iter().map(AppliedPerturbation::to_string).collect::<Vec<_>>();
        return print_json(&json!({
            "output": arguments.output, "perturbations": specs, "seed": arguments.seed, "frames": frames,
            "frames_per_second": rate, "width": width, "height": height,
            "milliseconds_per_frame": milliseconds, "milliseconds_per_perturbed_frame": perturbing,
        }));
    }
    println!(
        "{}: {frames} frames, {milliseconds:.1} ms a frame, of which {perturbing:.1} ms for the perturbation",
        arguments.output.display()
    );
    Ok(())
}

/// A bar on a terminal, nothing elsewhere.
fn progress(global: &Global, frames: u64) -> ProgressBar {
    let bar = pdk_terminal::progress(global.json, "{pos}/{len} frames, {eta} left");
    bar.set_length(frames);
    // At the first frame a perturbation may prepare itself for seconds.
    bar.tick();
    bar
}
