//! `pdk attack patch` and `pdk attack universal`: train a picture on recorded frames that makes a driver steer elsewhere, wherever it is seen.

use std::path::PathBuf;

use pdk_chain::chain::Chain;
use pdk_components::registry::Registry;
use pdk_model::component::ComponentSpec;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_model::scenario::parse_seed;
use pdk_notice::println;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, Result};
use pdk_sdk::prelude::Driver;
use pdk_terminal::table::table;
use serde_json::json;

use super::artwork::{Artwork, Road};
use super::training::{Measured, Training};
use super::{Goal, Shown};
use crate::supervised::Memory;
use crate::verbs::perturb::check_output;
use crate::verbs::saliency::frames::Frames;
use crate::verbs::{Global, print_json};

/// One of this many frames is held back to measure on.
const HELD_BACK: usize = 4;

/// What every training on frames takes
#[derive(clap::Args)]
pub struct Arguments {
    /// A folder of images, the record of a run with images, or the folder of a dataset
    frames: PathBuf,
    /// The driver that is attacked, which runs a network, with its parameters
    #[arg(long, value_name = "NAME[,PARAMETER=VALUE]...")]
    driver: String,
    /// The picture to write
    #[arg(short, long = "out", alias = "output", value_name = "FILE.png")]
    output: PathBuf,
    /// Where the driver is to steer
    #[arg(long, default_value = "left")]
    goal: Goal,
    /// A perturbation that the picture is to survive; may be given several times, and each frame gets one of them or none
    #[arg(long = "under", value_name = "NAME[@LEVEL][,PARAMETER=VALUE]...")]
    under: Vec<String>,
    /// How often the picture is changed
    #[arg(long, default_value_t = 200, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    steps: u32,
    /// How many frames are looked at for each change
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=1000))]
    batch: u32,
    /// At most this many frames, spread evenly
    #[arg(long, value_name = "N", default_value_t = 200)]
    count: usize,
    /// The speed for a network with a speed input, in metres per second; frames of a record have their own, and those of a dataset if it was recorded
    #[arg(long, default_value_t = 8.0)]
    speed: f64,
    /// The seed that all random numbers come from
    #[arg(long, value_parser = parse_seed, default_value_t = 0, allow_negative_numbers = true)]
    seed: u64,
    #[command(flatten)]
    pub memory: Memory,
}

/// Arguments of `pdk attack patch`
#[derive(clap::Args)]
#[command(after_help = AFTER)]
pub struct Patch {
    #[command(flatten)]
    pub arguments: Arguments,
    /// Width and height of the patch in pixels
    #[arg(long, default_value_t = 48, value_parser = clap::value_parser!(u16).range(2..=1024))]
    pixels: u16,
    #[command(flatten)]
    road: Road,
}

/// Arguments of `pdk attack universal`
#[derive(clap::Args)]
#[command(after_help = AFTER)]
pub struct Universal {
    #[command(flatten)]
    pub arguments: Arguments,
    /// The largest change of a value of the frame, of 255
    #[arg(long, default_value_t = 8.0)]
    epsilon: f64,
}

const AFTER: &str = "The perturbations of the family attack take the picture as their parameter `picture`. One frame in four is held back, and the table is measured on \
these frames.";

/// Trains a patch.
pub fn patch(global: &Global, Patch { arguments, pixels, road }: &Patch) -> Result<()> {
    let labels = ["as they are", "with a patch of the mean colour", "with the patch"];
    run(global, arguments, labels, |_| Artwork::patch(*road, usize::from(*pixels)))
}

/// Trains a universal change.
pub fn universal(global: &Global, Universal { arguments, epsilon }: &Universal) -> Result<()> {
    let labels = ["as they are", "changed at random", "changed"];
    run(global, arguments, labels, |frames| Artwork::universal(*epsilon, frames))
}

/// Trains a picture, writes it, and shows what it does on frames that it was not trained on.
fn run(
    global: &Global,
    arguments: &Arguments,
    labels: [&str; 3],
    artwork: impl FnOnce(&[&Shown]) -> Result<Artwork>,
) -> Result<()> {
    check_output(&arguments.frames, &arguments.output)?;
    let registry = global.registry()?;
    let (driver, place) = driver(&registry, &arguments.driver)?;
    let (frames, held_back) = frames(&registry, arguments)?;
    let all: Vec<&Shown> = frames.iter().chain(&held_back).collect();
    let mut training = Training {
        driver,
        place,
        artwork: artwork(&all)?,
        under: under(&registry, arguments)?,
        side: arguments.goal.side(),
        speed: arguments.speed,
        seed: arguments.seed,
    };
    let progress = pdk_terminal::progress(global.json, "{pos}/{len} steps {msg} {elapsed}");
    progress.set_length(arguments.steps.into());
    let values = training.train(&frames, arguments.steps, arguments.batch, |steering| {
        progress.set_message(format!("steering {steering:+.3}"));
        progress.inc(1);
    })?;
    progress.finish_and_clear();
    let picture = training.artwork.picture(&values)?;
    pdk_image::write(&arguments.output, picture.as_ref())?;
    // What counts is what was written, in whole bytes.
    let measured = training.measure(&held_back, &training.artwork.values(picture.as_ref()))?;
    show(global, arguments, labels, &measured, [frames.len(), held_back.len()])
}

/// Makes the driver.
fn driver(registry: &Registry, text: &str) -> Result<(Box<dyn Driver>, String)> {
    let spec = ComponentSpec::parse("driver", text)?;
    registry.catalog().check(Kind::Driver, &spec.name, &spec.parameters)?;
    let (driver, _) = registry.driver(&spec.name, &spec.parameters)?;
    Ok((driver, format!("driver `{}`", spec.name)))
}

/// A chain for each perturbation that the picture is to survive.
fn under(registry: &Registry, arguments: &Arguments) -> Result<Vec<Chain>> {
    let chain = |text: &String| {
        let applied = AppliedPerturbation::parse(text)?;
        Chain::new(registry, &[applied], arguments.seed)
    };
    arguments.under.iter().map(chain).collect()
}

/// The frames to train on, and those that are held back.
fn frames(registry: &Registry, arguments: &Arguments) -> Result<(Vec<Shown>, Vec<Shown>)> {
    let mut frames = Frames::open(registry, &arguments.frames, Some(arguments.count))?;
    let (mut trained, mut held_back) = (Vec::new(), Vec::new());
    for index in 0..frames.len() {
        let into = if index % HELD_BACK == HELD_BACK - 1 { &mut held_back } else { &mut trained };
        into.push(frames.read(index)?);
    }
    if held_back.is_empty() {
        return Err(Error::new(format!(
            "{} has {} frames, too few to hold one in {HELD_BACK} back; name a recording with more",
            arguments.frames.display(),
            trained.len()
        )));
    }
    Ok((trained, held_back))
}

/// Prints what the picture does.
fn show(
    global: &Global,
    arguments: &Arguments,
    labels: [&str; 3],
    measured: &[Measured; 3],
    count: [usize; 2],
) -> Result<()> {
    if global.json {
        let rows = labels.iter().zip(measured).map(|(label, measured)| {
            json!({ "frames": label, "steering": measured.steering, "moved": measured.moved, "share": measured.share })
        });
        return print_json(&json!({
            "file": arguments.output,
            "trained_on": count[0],
            "measured_on": count[1],
            "measured": rows.collect::<Vec<_>>(),
        }));
    }
    let mut rows = table([
        "frames",
        "mean steering",
        &format!("moved to the {}", arguments.goal.text()),
        "by more than 0.1",
    ]);
    for (label, measured) in labels.iter().zip(measured) {
        rows.add_row([
            (*label).to_owned(),
            format!("{:+.3}", measured.steering),
            format!("{:+.3}", measured.moved),
            format!("{:.0} %", 100.0 * measured.share),
        ]);
    }
    println!(
        "{rows}\nTrained on {} frames, measured on {} others. Wrote {}",
        count[0],
        count[1],
        arguments.output.display()
    );
    Ok(())
}
