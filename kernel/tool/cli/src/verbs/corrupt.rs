//! `pdk corrupt`: a dataset under perturbations, with its labels.

use std::path::PathBuf;

use clap::ValueEnum;
use pdk_corrupt::conditions::{self, Suite};
use pdk_corrupt::corrupt::{self, Done};
use pdk_corrupt::options::{Format, LabelsOption, Options};
use pdk_model::scenario::parse_seed;
use pdk_notice::eprintln;
use pdk_notice::println;
use pdk_preview::modifiers;
use pdk_sdk::error::{Error, Result};
use serde_json::json;

use super::{Global, check_folder, print_json};
use crate::supervised::Memory;

/// Arguments of `pdk corrupt`
#[derive(clap::Args)]
#[command(after_help = modifiers::help())]
pub struct Arguments {
    /// A folder of pictures with or without labels, a recording, or a dataset reader with its parameters
    dataset: String,
    /// Perturbations with their levels, or a range of levels (0..4 if none is given), and parameters; each makes a dataset of its own
    #[arg(
        long = "with",
        value_name = "NAME[@LEVEL[..LEVEL]][,PARAMETER=VALUE]...[,NAME...]",
        required_unless_present = "suite",
        conflicts_with = "suite"
    )]
    perturbations: Vec<String>,
    /// All perturbations of a family, such as imagenet_c, or of the default set
    #[arg(long, value_name = "default|FAMILY")]
    suite: Option<String>,
    /// The levels of the suite [default: 0..4]
    #[arg(long, value_name = "LEVEL[..LEVEL]", requires = "suite")]
    levels: Option<String>,
    /// The scale that the levels of the suite are on; what does not reach all of them is left out [default: the published one]
    #[arg(long, value_name = "SCALE", requires = "suite")]
    level_scale: Option<String>,
    /// A perturbation of the suite that is left out; may be given several times
    #[arg(long, value_name = "NAME", requires = "suite")]
    without: Vec<String>,
    /// The folder to write to: NAME/LEVEL/... and manifest.json; the same command continues what was ended
    #[arg(short, long = "out", alias = "output", value_name = "DIR")]
    output: PathBuf,
    /// What becomes of labels: moved as the pixels are, kept as they are, or left out
    #[arg(long, value_enum, default_value = "move")]
    labels: Labels,
    /// The share of a box or polygon that has to be in the picture, so that it stays
    #[arg(long, value_name = "SHARE", default_value_t = 0.1, value_parser = share)]
    visible: f64,
    /// The value in masks of what comes from outside of the picture
    #[arg(long, value_name = "VALUE", default_value_t = 0)]
    outside: u16,
    /// A folder whose PNG files are masks of the pictures with the same names; may be given several times
    #[arg(long, value_name = "FOLDER")]
    masks: Vec<String>,
    /// The format of the pictures that are written
    #[arg(long, value_enum, default_value = "same")]
    format: Pictures,
    /// The quality of JPEG files
    #[arg(long, default_value_t = 95, value_parser = clap::value_parser!(u8).range(1..=100))]
    quality: u8,
    /// Write a recording as pictures with a record beside each, whatever it was
    #[arg(long)]
    plain: bool,
    /// The seed that all random numbers come from, with the path of each picture
    #[arg(long, value_parser = parse_seed, default_value_t = 0, allow_negative_numbers = true)]
    seed: u64,
    /// How many files are done at a time [default: one for each processor]
    #[arg(long, value_parser = clap::value_parser!(u32).range(1..=40))]
    workers: Option<u32>,
    #[command(flatten)]
    pub memory: Memory,
}

#[derive(Clone, Copy, ValueEnum)]
enum Labels {
    Move,
    Keep,
    Drop,
}

#[derive(Clone, Copy, ValueEnum)]
enum Pictures {
    Same,
    Png,
    Jpeg,
}

fn share(text: &str) -> std::result::Result<f64, String> {
    match text.parse() {
        Ok(share) if (0.0..=1.0).contains(&share) => Ok(share),
        _ => Err("it has to be a number from 0 to 1".to_owned()),
    }
}

/// Writes the perturbed datasets.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    check_folder(&arguments.output)?;
    let registry = global.registry()?;
    let catalog = registry.catalog();
    let conditions = match &arguments.suite {
        Some(name) => {
            let suite = Suite {
                name,
                levels: arguments.levels.as_deref(),
                level_scale: arguments.level_scale.as_deref(),
                without: &arguments.without,
            };
            let (conditions, left_out) = conditions::suite(catalog, &suite)?;
            for sentence in left_out {
                eprintln!("pdk: warning: left out: {sentence}");
            }
            conditions
        }
        None => {
            // Options that conflict with each other are not required by others.
            let of_suite = [
                ("levels", arguments.levels.is_some()),
                ("level-scale", arguments.level_scale.is_some()),
                ("without", !arguments.without.is_empty()),
            ];
            if let Some((option, _)) = of_suite.iter().find(|(_, given)| *given) {
                return Err(Error::new(format!(
                    "--{option} is for a --suite; leave it out, or name a suite in the place of --with"
                )));
            }
            conditions::named(catalog, &arguments.perturbations)?
        }
    };
    let processors = std::thread::available_parallelism().map_or(1, usize::from);
    let options = Options {
        out: arguments.output.clone(),
        seed: arguments.seed,
        labels: match arguments.labels {
            Labels::Move => LabelsOption::Move,
            Labels::Keep => LabelsOption::Keep,
            Labels::Drop => LabelsOption::Drop,
        },
        visible: arguments.visible,
        outside: arguments.outside,
        masks: arguments.masks.clone(),
        format: match arguments.format {
            Pictures::Same => Format::Same,
            Pictures::Png => Format::Png,
            Pictures::Jpeg => Format::Jpeg,
        },
        quality: arguments.quality,
        plain: arguments.plain,
        workers: arguments.workers.map_or(processors.min(40), |workers| workers as usize),
    };
    let progress = pdk_terminal::progress(global.json, "{pos}/{len}, {eta} left");
    let begin = std::time::Instant::now();
    let done = corrupt::corrupt(&registry, &arguments.dataset, &conditions, &options, &progress)?;
    for warning in &done.warnings {
        eprintln!("pdk: warning: {warning}");
    }
    let Done { read_as, pictures, others, written, there, pictures_written, manifest, .. } = &done;
    let seconds = begin.elapsed().as_secs_f64();
    let rate = *pictures_written as f64 / seconds;
    if global.json {
        let others: serde_json::Map<_, _> =
            others.iter().map(|([_, name], count)| ((*name).to_owned(), (*count).into())).collect();
        return print_json(&json!({
            "output": arguments.output, "manifest": manifest, "read_as": read_as, "pictures": pictures, "others": others,
            "conditions": conditions.len(), "written": written, "there": there, "pictures_written": pictures_written,
            "seconds": seconds, "pictures_per_second": rate, "warnings": done.warnings,
        }));
    }
    let others: String =
        others.iter().map(|(names, count)| format!(", {}", counted(*count, *names))).collect();
    println!("{}: {read_as}, {}{others}", arguments.dataset, counted(*pictures, ["picture", "pictures"]));
    println!(
        "{}: {}, {} written, {} there; {rate:.0} pictures a second",
        arguments.output.display(),
        counted(conditions.len(), ["condition", "conditions"]),
        counted(*written, ["file", "files"]),
        counted(*there, ["was", "were"]),
    );
    Ok(())
}

/// A number with its noun.
fn counted(number: usize, [one, several]: [&str; 2]) -> String {
    format!("{number} {}", if number == 1 { one } else { several })
}
