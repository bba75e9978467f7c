//! `pdk perturb`: perturbs an image, or a video frame by frame.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use indicatif::ProgressBar;
use pdk_chain::chain::Chain;
use pdk_chain::moment::Moment;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_model::scenario::parse_seed;
use pdk_notice::eprintln;
use pdk_notice::println;
use pdk_preview::modifiers;
use pdk_sdk::error::{Error, Place, Result};
use pdk_sdk::file;
use pdk_sdk::prelude::FrameBuf;
use pdk_video::{Video, Writer, Yuv420};
use serde_json::json;

use super::{Global, print_json};

/// Arguments of `pdk perturb`
#[derive(clap::Args)]
#[command(after_help = modifiers::help())]
pub struct Arguments {
    /// The image, or the video: H.264 in MP4, and with ffmpeg on the PATH others
    image: PathBuf,
    /// A perturbation with its intensity from 0 to 4 (2 if none is given) and parameters; several are applied one after the
    /// other
    #[arg(long = "with", value_name = "NAME[@LEVEL][,PARAMETER=VALUE]...", required = true)]
    perturbations: Vec<String>,
    /// Where to write the result; the ending says the format, and is .mp4 for a video
    #[arg(short, long = "out", alias = "output", value_name = "FILE")]
    output: PathBuf,
    /// The seed that all random numbers come from
    #[arg(long, value_parser = parse_seed, default_value_t = 0, allow_negative_numbers = true)]
    seed: u64,
    /// The number of the frame that the image stands for, or the first frame of the video
    #[arg(long, default_value_t = 0)]
    frame: u64,
    /// The simulation time that the image stands for, or the first frame of the video, in seconds
    #[arg(long, default_value_t = 0.0)]
    time: f64,
}

/// The furthest time in seconds: over 30 years, and still exact to less than a frame.
const MAX_TIME: f64 = 1e9;

/// Reads, perturbs and writes an image or a video.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    if !(-MAX_TIME..=MAX_TIME).contains(&arguments.time) {
        return Err(Error::new(format!(
            "--time is {:e}, but has to be a number of seconds within {MAX_TIME:e}",
            arguments.time
        )));
    }
    let specs: Vec<AppliedPerturbation> =
        arguments.perturbations.iter().map(|text| AppliedPerturbation::parse(text)).collect::<Result<_>>()?;
    check_output(&arguments.image, &arguments.output)?;
    let video = is_video(&arguments.image, &arguments.output)?;
    let registry = global.registry()?;
    let chain = Chain::new(&registry, &specs, arguments.seed)?;
    if video {
        perturb_video(global, arguments, &specs, chain)
    } else {
        perturb_image(global, arguments, &specs, chain)
    }
}

/// Refuses to write over what is read.
pub fn check_output(input: &Path, output: &Path) -> Result<()> {
    let place = |path: &Path| std::fs::canonicalize(path).ok();
    match (place(input), place(output)) {
        (Some(read), Some(written)) if read == written => Err(Error::new(format!(
            "the result would replace {}, which it is made from; name another file with -o",
            input.display()
        ))),
        _ => Ok(()),
    }
}

/// Whether the input is a video, by its content. The result has to be of the same sort.
fn is_video(input: &Path, output: &Path) -> Result<bool> {
    let mut head = Vec::new();
    // If it cannot be read, reading the image says so.
    let read = file::open(input).and_then(|(file, _)| Ok(file.take(12).read_to_end(&mut head)?));
    let container = pdk_video::container(&head);
    let mp4 = output.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("mp4"));
    let (input, output) = (input.display(), output.display());
    match container {
        Some(_) if !mp4 => Err(Error::new(format!(
            "`{input}` is a video, so the name of the result, {output}, has to end in .mp4"
        ))),
        None if read.is_ok() && head.is_empty() => Err(Error::new(format!("`{input}` is empty"))),
        // What is given as a picture is read as one, which says what is wrong with it.
        None if read.is_ok() && mp4 && !pdk_image::is_image(&head) => Err(Error::new(format!(
            "`{input}` is neither a video nor an image; name a video in MP4, QuickTime, Matroska, WebM or AVI, or an image in JPEG, PNG, BMP \
             or WebP"
        ))),
        None if read.is_ok() && mp4 => Err(Error::new(format!(
            "`{input}` is an image, so the name of the result, {output}, has to end in .png, .jpg, .bmp or .webp"
        ))),
        container => Ok(container.is_some()),
    }
}

/// Reports what a user should know about the maps that were made.
fn warn(chain: &Chain) {
    for noticed in chain.noticed() {
        eprintln!("pdk: warning: {noticed}");
    }
}

fn perturb_image(
    global: &Global,
    arguments: &Arguments,
    specs: &[AppliedPerturbation],
    mut chain: Chain,
) -> Result<()> {
    let image = pdk_image::read(&arguments.image)?;
    let mut perturbed = FrameBuf::new(image.width(), image.height());
    let moment = Moment::new(arguments.frame, arguments.time).alone();
    chain.apply(image.as_ref(), perturbed.as_mut(), &moment)?;
    warn(&chain);
    pdk_image::write(&arguments.output, perturbed.as_ref())?;
    if global.json {
        let specs = specs.iter().map(AppliedPerturbation::to_string).collect::<Vec<_>>();
        print_json(&json!({ "output": arguments.output, "perturbations": specs, "seed": arguments.seed }))?;
    }
    Ok(())
}

/// Sends the frames through the chain as one sequence. Only one frame is in memory at a time.
fn perturb_video(
    global: &Global,
    arguments: &Arguments,
    specs: &[AppliedPerturbation],
    mut chain: Chain,
) -> Result<()> {
    let place = format!("video `{}`", arguments.image.display());
    let mut reader = Video::open(&arguments.image).place(&place)?;
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
