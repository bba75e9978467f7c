//! A video, frame by frame.

use std::path::Path;
use std::sync::mpsc::{Receiver, SyncSender, channel, sync_channel};
use std::thread;
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

/// Frames that wait between two of the three threads: enough to even out those that take longer, and few in memory.
const WAITING: usize = 4;

/// A decoded frame.
struct Decoded {
    frame: FrameBuf,
    /// When it begins and ends, in seconds after the first one. Frames keep their own times, so that a video without a fixed rate does not run faster or slower.
    begins: f64,
    ends: f64,
}

/// Sends the frames through the chain as one sequence, while another thread decodes those that come next and a third one encodes those that are done.
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
    let (rate, count) = (reader.rate(), u64::from(reader.count()));
    if reader.has_sound() {
        eprintln!("pdk: warning: {place} has sound, which the result does not have");
    }
    let mut planes = Yuv420::default();
    if !reader.next(&mut planes).place(&place)? {
        return Err(Error::new(format!("{place}: it has no frames")));
    }
    let (width, height) = (planes.width, planes.height);
    let mut writer = Writer::create(&arguments.output, width, height, rate)?;
    let progress = progress(global, count);

    let begin = Instant::now();
    let mut perturbing = Duration::ZERO;
    let mut frames = 0;
    let (decoded_in, decoded) = sync_channel(WAITING);
    let (done_in, done) = sync_channel::<(FrameBuf, f64)>(WAITING);
    // Frames that were used go back to where they are filled.
    let [(seen_in, seen), (written_in, written)] = [channel(), channel()];
    let new = || FrameBuf::new(width, height);
    thread::scope(|scope| {
        let place = &place;
        let decoding = scope.spawn(move || decode(reader, planes, place, &seen, &decoded_in));
        let encoding = scope.spawn(|| {
            for (frame, ends) in done {
                writer.push_until(frame.as_ref(), ends)?;
                // The sender is gone if no more frames come.
                let _ = written_in.send(frame);
            }
            Ok(())
        });
        let apply = || {
            for Decoded { frame, begins, ends } in decoded {
                let mut perturbed = written.try_recv().unwrap_or_else(|_| new());
                let before = Instant::now();
                let moment = Moment::new(arguments.frame.saturating_add(frames), arguments.time + begins);
                chain.apply(frame.as_ref(), perturbed.as_mut(), &moment)?;
                // Perturbations prepare themselves at their first frame.
                if frames > 0 {
                    perturbing += before.elapsed();
                }
                frames += 1;
                let _ = seen_in.send(frame);
                // If the encoder has failed, it says why.
                if done_in.send((perturbed, ends)).is_err() {
                    break;
                }
                progress.inc(1);
            }
            Ok(())
        };
        let applied: Result<()> = apply();
        drop(done_in);
        let ended = |thread: Option<Result<()>>| {
            thread.unwrap_or_else(|| Err(Error::new(format!("{place}: a thread of pdk panicked"))))
        };
        let encoded = ended(encoding.join().ok());
        let decoded = ended(decoding.join().ok());
        applied.and(encoded).and(decoded)
    })?;
    warn(&chain);
    if frames < count {
        return Err(Error::new(format!(
            "{place}: it is damaged: {frames} of its {count} frames can be decoded"
        )));
    }
    writer.finish()?;
    progress.finish_and_clear();

    let seconds = begin.elapsed().as_secs_f64();
    let perturbing = perturbing.as_secs_f64() * 1e3 / (frames - 1).max(1) as f64;
    if global.json {
        let specs = specs.iter().map(AppliedPerturbation::to_string).collect::<Vec<_>>();
        return print_json(&json!({
            "output": arguments.output, "perturbations": specs, "seed": arguments.seed, "frames": frames,
            "frames_per_second": rate, "width": width, "height": height,
            "milliseconds_per_frame": seconds * 1e3 / frames as f64, "milliseconds_per_perturbed_frame": perturbing,
        }));
    }
    println!(
        "{}: {frames} frames, {:.0} a second; the perturbation takes {perturbing:.1} ms a frame",
        arguments.output.display(),
        frames as f64 / seconds
    );
    Ok(())
}

/// Decodes the frames after the one in `planes`, and sends all of them until the video or their receiver ends.
fn decode(
    mut reader: Video,
    mut planes: Yuv420,
    place: &str,
    seen: &Receiver<FrameBuf>,
    decoded: &SyncSender<Decoded>,
) -> Result<()> {
    let (width, height) = (planes.width, planes.height);
    for number in 0.. {
        if (planes.width, planes.height) != (width, height) {
            return Err(Error::new(format!(
                "{place}: frame {number} is {} x {}, but the first is {width} x {height}; convert it to one size",
                planes.width, planes.height
            )));
        }
        let mut frame = seen.try_recv().unwrap_or_else(|_| FrameBuf::new(width, height));
        planes.to_rgb(frame.as_mut());
        let (begins, ends) = (reader.time(number), reader.time(number + 1));
        if decoded.send(Decoded { frame, begins, ends }).is_err() || !reader.next(&mut planes).place(place)? {
            break;
        }
    }
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
