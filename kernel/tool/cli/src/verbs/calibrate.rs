//! `pdk calibrate`: a scale on which a level means the same for every perturbation.

use std::num::NonZeroUsize;
use std::path::PathBuf;

use pdk_calibrate::cost;
use pdk_calibrate::costs::Costs;
use pdk_calibrate::measure;
use pdk_components::product;
use pdk_components::registry::Registry;
use pdk_model::level::{DEFAULT_LEVEL, LEVELS, MAX_INTENSITY};
use pdk_model::perturbation::AppliedPerturbation;
use pdk_model::scale_file::{self, MeasuredFrame, OfPerturbation, Scale, are_costs};
use pdk_model::scenario::parse_seed;
use pdk_notice::{eprintln, println};
use pdk_preview::{picture, preview};
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, Place, Result};
use pdk_sdk::prelude::FrameBuf;
use pdk_terminal::table::table;

use super::saliency::frames::Frames;
use super::{Global, check_writable, print_json};
use crate::supervised::Memory;

/// Arguments of `pdk calibrate`
#[derive(clap::Args)]
pub struct Arguments {
    /// Images, folders of images, records of runs with images, or datasets; all frames count the same
    #[arg(required = true)]
    frames: Vec<PathBuf>,
    /// The file for the scale, whose name is that of the scale
    #[arg(short, long = "out", alias = "output", value_name = "NAME.scale.json")]
    output: PathBuf,
    /// Only this perturbation; may be given several times [default: the default set]
    #[arg(long = "with", value_name = "NAME[,PARAMETER=VALUE]...")]
    perturbations: Vec<String>,
    /// Also the perturbations that are not in the default set
    #[arg(long, conflicts_with = "perturbations")]
    all: bool,
    /// What a perturbation costs at the levels 0, 1, 2, 3 and 4, in rising order [default: as on the scale that comes with pdk]
    #[arg(long, value_name = "COST,...", value_delimiter = ',')]
    costs: Option<Vec<f64>>,
    /// Only this many frames of each folder, spread evenly over it
    #[arg(long, value_name = "N")]
    count: Option<NonZeroUsize>,
    /// The width to which frames are brought, in pixels; perturbations have sizes in pixels
    #[arg(long, default_value_t = 320, value_parser = clap::value_parser!(u32).range(40..=4096))]
    width: u32,
    /// The seed that all random numbers come from
    #[arg(long, value_parser = parse_seed, default_value_t = 0, allow_negative_numbers = true)]
    seed: u64,
    #[command(flatten)]
    pub memory: Memory,
}

/// A frame has at most this many rows, as it has at most this many columns.
const MOST_ROWS: usize = 4096;

/// Measures the scale, writes it, and shows how far each perturbation reaches.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let name = scale_file::name_of(&arguments.output).ok_or_else(|| {
        Error::new(format!(
            "{} does not name a scale; write NAME{}, with a NAME of letters, digits, `_`, `-` and `.`",
            arguments.output.display(),
            scale_file::ENDING
        ))
    })?;
    if product::get().scales.iter().any(|scale| scale.name == name) {
        return Err(Error::new(format!("the scale `{name}` comes with pdk; write another name")));
    }
    check_writable(&arguments.output)?;
    let costs = costs(arguments.costs.as_deref())?;
    let registry = global.registry()?;
    let perturbations = chosen(&registry, arguments)?;
    let (mut names, mut frames) = (Vec::new(), Vec::new());
    for path in &arguments.frames {
        let mut opened = Frames::open(&registry, path, arguments.count.map(usize::from))?;
        for index in 0..opened.len() {
            let shown = opened.read(index)?;
            let [width, height] = [shown.frame.width(), shown.frame.height()];
            if height * arguments.width as usize / width > MOST_ROWS {
                return Err(Error::new(format!(
                    "frame `{}` has {width}x{height} pixels and would have more than {MOST_ROWS} rows at --width {}; leave it out",
                    shown.name, arguments.width
                )));
            }
            frames.push(picture::to_frame(picture::scaled(&shown.frame, arguments.width))?);
            names.push(shown.name);
        }
    }
    let progress = pdk_terminal::progress(global.json, "{pos}/{len} perturbations, {eta} left");
    progress.set_length(perturbations.len() as u64);
    let measured =
        measure::all(&registry, &perturbations, &frames, &costs, arguments.seed, &|| progress.inc(1));
    progress.finish_and_clear();
    let mut of_perturbations: Vec<OfPerturbation> = Vec::new();
    for measured in measured {
        match measured {
            Ok(of) => of_perturbations.push(of),
            // One that the user names is an error.
            Err(error) if !arguments.perturbations.is_empty() => return Err(error),
            Err(error) => eprintln!("pdk: warning: left out: {error}"),
        }
    }
    let idle: Vec<&str> =
        of_perturbations.iter().filter(|of| of.points.is_empty()).map(|of| of.name.as_str()).collect();
    if !idle.is_empty() {
        eprintln!(
            "pdk: warning: no level of the scale can be reached with {}: on these frames each costs less than level 0 or more than level {MAX_INTENSITY}, \
             at any intensity; use pictures of a camera, or set --costs",
            idle.join(", ")
        );
    }
    let measured_frame = |(name, frame): (String, &FrameBuf)| {
        let mut hash = blake3::Hasher::new();
        frame.as_ref().rows().for_each(|row| {
            hash.update(row);
        });
        MeasuredFrame {
            name,
            size: [frame.width(), frame.height()],
            blake3: hash.finalize().to_hex().to_string(),
        }
    };
    let scale = Scale {
        measure: cost::MEASURE.to_owned(),
        costs: costs.0.to_vec(),
        frames: names.into_iter().zip(&frames).map(measured_frame).collect(),
        perturbations: of_perturbations,
    };
    let place = || format!("cannot write {}", arguments.output.display());
    pdk_sdk::file::write(&arguments.output, scale.text()?.as_bytes()).place(place())?;
    if global.json {
        return print_json(&serde_json::to_value(&scale)?);
    }
    println!("{}\nWrote {}", shown(name, &scale), arguments.output.display());
    Ok(())
}

/// The costs that the user wants.
fn costs(given: Option<&[f64]>) -> Result<Costs> {
    let Some(given) = given else { return Ok(cost::COSTS) };
    match <[f64; LEVELS]>::try_from(given) {
        Ok(costs) if are_costs(&costs) => Ok(Costs(costs)),
        _ => Err(Error::new(format!(
            "--costs takes {LEVELS} numbers above 0 in rising order, such as 2,4,8,16,32"
        ))),
    }
}

/// The perturbations that are measured.
fn chosen(registry: &Registry, arguments: &Arguments) -> Result<Vec<AppliedPerturbation>> {
    let catalog = registry.catalog();
    if arguments.perturbations.is_empty() {
        let usable = preview::usable(catalog, arguments.all).into_iter();
        let of_frames = usable.filter(|found| found.acts_on.is_frame() && found.history == 0);
        // What has to be set stays out, as a scale goes by the parameters.
        let usable = of_frames
            .filter(|found| catalog.check(Kind::Perturbation, &found.name, &serde_json::Map::new()).is_ok());
        return Ok(usable.map(|found| AppliedPerturbation::new(&found.name, 0.0)).collect());
    }
    let mut chosen = Vec::new();
    for text in &arguments.perturbations {
        let applied = AppliedPerturbation::parse(text)?;
        let mistake = |sentence: &str| Error::new(format!("--with {text}: {sentence}"));
        if AppliedPerturbation::from_json_without_level(&text.as_str().into()).is_err() {
            return Err(mistake("all levels are measured; leave the level out"));
        }
        let bare = AppliedPerturbation {
            parameters: applied.parameters.clone(),
            ..AppliedPerturbation::new(&applied.name, DEFAULT_LEVEL)
        };
        if applied != bare {
            return Err(mistake("a scale is measured without modifiers; name parameters alone"));
        }
        if chosen.contains(&applied) {
            return Err(mistake("it is named twice; leave one out"));
        }
        catalog.check(Kind::Perturbation, &applied.name, &applied.parameters)?;
        chosen.push(applied);
    }
    Ok(chosen)
}

/// A table of the published levels at which perturbations cost what the levels of the scale stand for.
fn shown(name: &str, scale: &Scale) -> String {
    let levels = (0..LEVELS).map(|level| format!("level {level}"));
    let header: Vec<String> =
        ["published level for".to_owned()].into_iter().chain(levels).chain(["reaches".to_owned()]).collect();
    let mut rows = table(header.iter().map(String::as_str));
    for of in &scale.perturbations {
        let measured = of.measured(name);
        let applied = AppliedPerturbation {
            parameters: of.parameters.clone(),
            ..AppliedPerturbation::new(&of.name, 0.0)
        };
        let mut row = vec![applied.label()];
        let at = |level| measured.reached(level as f64).map_or("-".to_owned(), |at| format!("{at:.2}"));
        row.extend((0..LEVELS).map(at));
        row.push(match measured.reach() {
            None => "nothing".to_owned(),
            Some((low, high)) if low <= 0.0 && high >= MAX_INTENSITY => "all".to_owned(),
            Some((low, high)) => format!("{low} to {high}"),
        });
        rows.add_row(row);
    }
    rows.to_string()
}
