//! `pdk preview`: what perturbations do to an image, to look at.

use std::collections::BTreeMap;
use std::path::PathBuf;

use pdk_model::component::ComponentSpec;
use pdk_model::scenario::parse_seed;
use pdk_notice::eprintln;
use pdk_notice::println;
use pdk_preview::preview::{self, Options};
use pdk_preview::{method, picture};
use pdk_sdk::describe::{Kind, Role, Temporal};
use pdk_sdk::error::{Error, Place, Result};
use serde_json::json;

use super::{Global, check_folder, print_json};
use crate::supervised::Memory;

/// Arguments of `pdk preview`
#[derive(clap::Args)]
pub struct Arguments {
    /// The image
    image: PathBuf,
    /// Only this perturbation, at this level alone if it has one; may be given several times [default: the default set and your clips]
    #[arg(long = "with", value_name = "NAME[@LEVEL][,PARAMETER=VALUE]...")]
    perturbations: Vec<String>,
    /// Also the perturbations that are not in the default set
    #[arg(long)]
    all: bool,
    /// The folder to write to
    #[arg(short, long = "out", alias = "output", value_name = "DIR", default_value = "preview")]
    output: PathBuf,
    /// Width of the frame that is perturbed, in pixels; perturbations have sizes in pixels
    #[arg(long, default_value_t = 320, value_parser = clap::value_parser!(u32).range(8..=4096))]
    width: u32,
    /// Width of a picture on the sheet, in pixels
    #[arg(long, default_value_t = 192, value_parser = clap::value_parser!(u32).range(8..=4096))]
    picture: u32,
    /// Columns of the sheet
    #[arg(long, default_value_t = 2, value_parser = clap::value_parser!(u32).range(1..=16))]
    columns: u32,
    /// A network whose view is shown below each picture: its ONNX file, or the name of one that is part of pdk
    #[arg(long, value_name = "MODEL")]
    model: Option<String>,
    /// The saliency method that shows it [default: the one that `pdk list saliency` marks as the default]
    #[arg(long, value_name = "NAME[,PARAMETER=VALUE]...", requires = "model")]
    method: Option<String>,
    /// The seed that all random numbers come from
    #[arg(long, value_parser = parse_seed, default_value_t = 0, allow_negative_numbers = true)]
    seed: u64,
    #[command(flatten)]
    pub memory: Memory,
}

/// The level at which dynamic perturbations are shown over time.
const STRIP_LEVEL: f64 = 3.0;
/// Pictures of a strip, and the seconds between them.
const STRIP: (usize, f64) = (6, 0.8);
/// Frames of a clip, and how many there are in a second.
const CLIP: (usize, u32) = (48, 12);

/// Writes the sheet, and for each dynamic perturbation a strip and a clip.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    check_folder(&arguments.output)?;
    let registry = global.registry()?;
    let chosen = preview::chosen(registry.catalog(), &arguments.perturbations, arguments.all)?;
    if chosen.is_empty() {
        return Err(Error::new("there are no perturbations to show; `pdk doctor` says what is installed"));
    }
    let image = pdk_image::read(&arguments.image)?;
    let source = picture::to_frame(picture::scaled(&image, arguments.width))?;
    std::fs::create_dir_all(&arguments.output).place(format_args!(
        "cannot make the folder {}; choose another with -o",
        arguments.output.display()
    ))?;
    let maps = match &arguments.model {
        None => None,
        Some(model) => {
            let catalog = registry.catalog();
            let mut method = method::named(catalog, arguments.method.as_deref().unwrap_or_default())?;
            if catalog.get(Kind::Driver, model).is_ok() {
                method = method::of_driver(catalog, &ComponentSpec::new(model.as_str()), &method)?;
            } else {
                let network = catalog.get(Kind::Saliency, &method.name)?.description.with_role(Role::Network);
                method
                    .parameters
                    .extend(network.map(|network| (network.name.clone(), model.as_str().into())));
            }
            // What is wrong with it shows here, and not at every perturbation.
            registry.saliency(&method.name, &method.parameters)?;
            Some(method)
        }
    };
    let options = Options {
        seed: arguments.seed,
        frame_width: arguments.width,
        picture_width: arguments.picture,
        maps,
    };
    let progress = pdk_terminal::progress(global.json, "{pos}/{len} perturbations");

    let mut shown = Vec::with_capacity(chosen.len());
    let mut blocks = Vec::with_capacity(chosen.len());
    let mut left_out = LeftOut { named: !arguments.perturbations.is_empty(), ..LeftOut::default() };
    let rows = preview::rows(&registry, &chosen, &source, &options, &progress);
    for (perturbation, block) in chosen.iter().zip(rows) {
        if let Some(block) = left_out.note(&perturbation.description.name, block)? {
            shown.push(perturbation);
            blocks.push(block);
        }
    }
    if let (true, Some(error)) = (blocks.is_empty(), left_out.first.take()) {
        return Err(error);
    }
    let heading = format!(
        "{}  -  levels 0 to 4 from left to right if none is named, frame {} x {}, seed {}",
        arguments.image.file_name().unwrap_or_default().to_string_lossy(),
        source.width(),
        source.height(),
        options.seed
    );
    let mut written = vec![arguments.output.join("sheet.png")];
    let sheet = picture::sheet(&heading, &blocks, arguments.columns)?;
    pdk_image::write(&written[0], picture::to_frame(sheet)?.as_ref())?;
    let mut seen = BTreeMap::new();
    for perturbation in shown.iter().filter(|shown| shown.description.temporal == Temporal::Dynamic) {
        let name = &perturbation.description.name;
        let number = *seen.entry(name).and_modify(|number| *number += 1).or_insert(1);
        let stem = if number == 1 { name.clone() } else { format!("{name}-{number}") };
        let frames = |(count, interval)| {
            let applied = perturbation.at(STRIP_LEVEL);
            preview::over_time(&registry, &applied, &source, &options, count, interval)
        };
        let (count, rate) = CLIP;
        let both = frames(STRIP).and_then(|strip| Ok((strip, frames((count, 1.0 / f64::from(rate)))?)));
        let Some((pictures, frames)) = left_out.note(name, both)? else { continue };
        let strip = arguments.output.join(format!("{stem}-strip.png"));
        pdk_image::write(&strip, picture::to_frame(picture::row(&pictures)?)?.as_ref())?;
        let clip = arguments.output.join(format!("{stem}.gif"));
        picture::write_clip(&clip, frames, rate)?;
        written.extend([strip, clip]);
    }
    if global.json {
        return print_json(&json!({ "written": written, "left_out": left_out.names }));
    }
    for file in &written {
        println!("{}", file.display());
    }
    let all = preview::chosen(registry.catalog(), &[], true)?.len();
    if !left_out.named && all > chosen.len() {
        println!("{} more are there by name only; --all shows them too", all - chosen.len());
    }
    Ok(())
}

/// Perturbations that fail: where all are shown one of them is left out, but one that the user names is an error.
#[derive(Default)]
struct LeftOut {
    named: bool,
    names: Vec<String>,
    first: Option<Error>,
}

impl LeftOut {
    fn note<T>(&mut self, name: &str, made: Result<T>) -> Result<Option<T>> {
        match made {
            Ok(made) => Ok(Some(made)),
            Err(error) if self.named => Err(error),
            Err(error) => {
                eprintln!("pdk: warning: `{name}` is left out: {error}");
                self.names.push(name.to_owned());
                self.first.get_or_insert(error);
                Ok(None)
            }
        }
    }
}
