//! `pdk perturb`: perturbs images, or a video frame by frame.

mod image;
mod video;

use std::io::Read;
use std::path::{Path, PathBuf};

use pdk_chain::chain::Chain;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_model::scenario::parse_seed;
use pdk_notice::eprintln;
use pdk_preview::modifiers;
use pdk_sdk::error::{Error, Result};
use pdk_sdk::file;

use super::Global;
use crate::supervised::Memory;

/// Arguments of `pdk perturb`
#[derive(clap::Args)]
#[command(after_help = modifiers::help())]
pub struct Arguments {
    /// Images, or a video: H.264 in MP4, and with ffmpeg on the PATH others; `-` is an image on standard input
    #[arg(required = true, value_name = "IMAGE")]
    inputs: Vec<PathBuf>,
    /// A perturbation with its intensity from 0 to 4 (2 if none is given) and parameters; several are applied one after the
    /// other
    #[arg(long = "with", value_name = "NAME[@LEVEL][,PARAMETER=VALUE]...", required = true)]
    perturbations: Vec<String>,
    /// Where to write the result; the ending says the format, and is .mp4 for a video. For several images it is a folder, in which each keeps its
    /// name; `-` is standard output, as PNG
    #[arg(short, long = "out", alias = "output", value_name = "FILE")]
    output: PathBuf,
    /// The seed that all random numbers come from
    #[arg(long, value_parser = parse_seed, default_value_t = 0, allow_negative_numbers = true)]
    seed: u64,
    /// The number of the frame that the image stands for, or the first image or frame of the video; with each further one it is one more
    #[arg(long, default_value_t = 0)]
    frame: u64,
    /// The simulation time that the images stand for, or the first frame of the video, in seconds
    #[arg(long, default_value_t = 0.0)]
    time: f64,
    #[command(flatten)]
    pub memory: Memory,
}

/// The furthest time in seconds: over 30 years, and still exact to less than a frame.
const MAX_TIME: f64 = 1e9;

/// The name that stands for standard input or output.
const STANDARD: &str = "-";

/// Reads, perturbs and writes images or a video.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    if !(-MAX_TIME..=MAX_TIME).contains(&arguments.time) {
        return Err(Error::new(format!(
            "--time is {:e}, but has to be a number of seconds within {MAX_TIME:e}",
            arguments.time
        )));
    }
    let specs: Vec<AppliedPerturbation> =
        arguments.perturbations.iter().map(|text| AppliedPerturbation::parse(text)).collect::<Result<_>>()?;
    let output = &arguments.output;
    if global.json && output.as_os_str() == STANDARD {
        return Err(Error::new("--json and `-o -` both write to standard output; leave one of them out"));
    }
    if let [input] = arguments.inputs.as_slice()
        && input.as_os_str() != STANDARD
        && output.as_os_str() != STANDARD
        && !output.is_dir()
    {
        check_output(input, output)?;
        if is_video(input, output)? {
            let chain = Chain::new(&global.registry()?, &specs, arguments.seed)?;
            return video::perturb(global, arguments, input, &specs, chain);
        }
    }
    let outputs = image::outputs(&arguments.inputs, output)?;
    let chain = Chain::new(&global.registry()?, &specs, arguments.seed)?;
    image::perturb(global, arguments, &outputs, &specs, chain)
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

/// The first bytes of a file, which say what it is.
fn head(input: &Path) -> Result<Vec<u8>> {
    let mut head = Vec::new();
    file::open(input)?.0.take(12).read_to_end(&mut head)?;
    Ok(head)
}

/// What holds the video that a file is; none if it is not a video.
fn container(input: &Path) -> Result<Option<pdk_video::Container>> {
    Ok(pdk_video::container(&head(input)?))
}

/// Whether the input is a video, by its content. The result has to be of the same sort.
fn is_video(input: &Path, output: &Path) -> Result<bool> {
    // If it cannot be read, reading the image says so.
    let read = head(input);
    let head = read.as_deref().unwrap_or_default();
    let container = pdk_video::container(head);
    let mp4 = output.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("mp4"));
    let (input, output) = (input.display(), output.display());
    match container {
        Some(_) if !mp4 => Err(Error::new(format!(
            "`{input}` is a video, so the name of the result, {output}, has to end in .mp4"
        ))),
        None if read.is_ok() && head.is_empty() => Err(Error::new(format!("`{input}` is empty"))),
        // What is given as a picture is read as one, which says what is wrong with it.
        None if read.is_ok() && mp4 && !pdk_image::is_image(head) => Err(Error::new(format!(
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
