//! `pdk saliency`: which parts of frames matter to a driver.

mod curves;
mod files;
pub(super) mod frames;
mod patches;
mod recorded;
pub(super) mod shown;

use std::num::NonZeroUsize;
use std::path::PathBuf;

use indicatif::ProgressBar;
use pdk_chain::maps;
use pdk_chain::maps::Line;
use pdk_components::registry::Registry;
use pdk_model::component::ComponentSpec;
use pdk_model::scenario::parse_seed;
use pdk_notice::eprintln;
use pdk_notice::println;
use pdk_preview::method;
use pdk_sdk::describe::{Description, Kind, Role};
use pdk_sdk::error::{Error, Place, Result};
use pdk_sdk::prelude::{Frame, HeatmapMut, MapContext, Saliency};
use pdk_sdk::seed;
use pdk_supervise::calls::{self, Function};
use serde_json::{Value, json};

use super::{Global, numbered, print_json};
use crate::supervised::Memory;
use frames::Frames;
use shown::Shown;

/// What is explained unless something else is named.
const STEERING: &str = "steering";

/// Arguments of `pdk saliency`
#[derive(clap::Args)]
pub struct Arguments {
    /// The image, a folder of images, the record of a run with images, or the folder of a dataset
    frames: PathBuf,
    /// The driver whose view is shown, which runs a network, with its parameters
    #[arg(long, value_name = "NAME[,PARAMETER=VALUE]...")]
    driver: String,
    /// A saliency method; may be given several times [default: the one that `pdk list saliency` marks as the default]
    #[arg(long = "with", value_name = "NAME[,PARAMETER=VALUE]...")]
    methods: Vec<String>,
    /// The folder to write to
    #[arg(short, long = "out", value_name = "DIR", default_value = "saliency")]
    output: PathBuf,
    /// Write the numbers in the size of the frame instead of one for each cell of the layer
    #[arg(long)]
    full: bool,
    /// Which number of the network is explained, by methods that explain one: steering, throttle, or any other in the words of `pdk gradient
    /// --of`, such as scores[17] for a class or boxes[0,4,*] for the greatest of a row
    #[arg(long, value_name = "NUMBER", default_value = STEERING, value_parser = clap::builder::NonEmptyStringValueParser::new())]
    explain: String,
    /// The speed for a network with a speed input, in metres per second; frames of a record have their own, and those of a dataset if it was recorded
    #[arg(long, default_value_t = 8.0)]
    speed: f64,
    /// Only this many frames of a folder, spread evenly over it
    #[arg(long, value_name = "N")]
    count: Option<NonZeroUsize>,
    /// Also measure how faithful each method is, by deletion, insertion, sensitivity-n and infidelity: how the steering changes when parts of the
    /// frame are taken away, against the same maps in other places
    #[arg(long)]
    curves: bool,
    /// The seed that all random numbers come from
    #[arg(long, value_parser = parse_seed, default_value_t = 0, allow_negative_numbers = true)]
    seed: u64,
    #[command(flatten)]
    pub memory: Memory,
}

/// A method that is ready.
struct Method {
    /// Its name, with a number behind it if it is used several times.
    label: String,
    /// What messages call it.
    place: String,
    by: ComponentSpec,
    description: Description,
    /// Whether it was reported that its maps have a single line of cells.
    warned: bool,
    key: pdk_sdk::prelude::Key,
    /// One that gives a number for each cell, and one that covers the frame.
    cells: Option<Box<dyn Saliency>>,
    frame: Box<dyn Saliency>,
}

/// Writes a map for each frame and method, and a picture of each.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    super::check_folder(&arguments.output)?;
    if arguments.curves && arguments.explain != STEERING {
        return Err(Error::new(format!(
            "--curves measures how the steering changes, which says nothing about maps of `{}`; leave one of them out",
            arguments.explain
        )));
    }
    let registry = global.registry()?;
    let driver = ComponentSpec::parse("driver", &arguments.driver)?;
    registry.catalog().check(Kind::Driver, &driver.name, &driver.parameters)?;
    let texts = match arguments.methods.as_slice() {
        [] => vec![String::new()],
        given => given.to_vec(),
    };
    let mut methods = Vec::new();
    for text in &texts {
        methods.push(method(&registry, arguments, &driver, text, &methods)?);
    }
    let mut frames = Frames::open(&registry, &arguments.frames, arguments.count.map(usize::from))?;
    std::fs::create_dir_all(&arguments.output).place(format_args!(
        "cannot make the folder {}; choose another with -o",
        arguments.output.display()
    ))?;
    let mut curves = match arguments.curves {
        true => Some(curves::Curves::new(&registry, &driver, arguments.speed, arguments.seed, texts.len())?),
        false => None,
    };

    let progress = pdk_terminal::progress(global.json, "{pos}/{len} frames");
    progress.set_length(frames.len() as u64);
    let mut written = Vec::new();
    for index in 0..frames.len() {
        let shown = frames.read(index)?;
        let Shown { name, frame, speed, .. } = &shown;
        let at = format!("frame `{name}`");
        let seen = curves.as_mut().map(|curves| curves.see(&shown, index as u64)).transpose();
        let seen = seen.map_err(|error| error.at(&at))?;
        for (place, method) in methods.iter_mut().enumerate() {
            let map = method.map(frame.as_ref(), index as u64, *speed).map_err(|error| error.at(&at))?;
            if map.iter().all(|value| *value == map[0]) {
                note(
                    &progress,
                    &format!("{at}: the map of {} is the same everywhere, so it marks nothing", method.place),
                );
            }
            if let Some(line) = Line::of(&map, frame.width()).filter(|_| !method.warned) {
                method.warned = true;
                note(&progress, &line.noticed(&method.by, &method.description));
            }
            let (numbers, width) = match arguments.full {
                true => (map.clone(), frame.width()),
                false => {
                    method.map_by_cell(frame.as_ref(), index as u64, *speed).map_err(|error| error.at(&at))?
                }
            };
            let stem = arguments.output.join(format!("{name}.{}", method.label));
            let [file, picture] = ["npy", "png"].map(|ending| files::beside(&stem, ending));
            files::write_npy(&file, &numbers, width)?;
            files::write_picture(&picture, frame.as_ref(), &map)?;
            written.extend([file, picture]);
            if let (Some(curves), Some(seen)) = (&mut curves, &seen) {
                curves.add(place, seen, &map).map_err(|error| error.at(&at))?;
            }
        }
        progress.inc(1);
    }
    progress.finish_and_clear();
    let labels: Vec<&str> = methods.iter().map(|method| method.label.as_str()).collect();
    if global.json {
        let curves = curves.map(|curves| curves.to_json(&labels));
        return print_json(&json!({ "written": written, "curves": curves }));
    }
    let maps = match written.len() / 2 {
        1 => "1 map".to_owned(),
        maps => format!("{maps} maps"),
    };
    println!("{maps} in {}", arguments.output.display());
    if let Some(curves) = curves {
        println!("{}", curves.table(&labels));
    }
    Ok(())
}

fn note(progress: &ProgressBar, sentence: &str) {
    progress.suspend(|| eprintln!("pdk: warning: {sentence}"));
}

/// Makes a method for the network of the driver. What both take is what the driver has.
fn method(
    registry: &Registry,
    arguments: &Arguments,
    driver: &ComponentSpec,
    text: &str,
    before: &[Method],
) -> Result<Method> {
    let spec = method::named(registry.catalog(), text)?;
    let description = &registry.catalog().get(Kind::Saliency, &spec.name)?.description;
    let takes = |role| description.with_role(role).map(|parameter| parameter.name.as_str());
    let size = takes(Role::Resolution);
    if let Some(size) = size.filter(|size| spec.parameters.contains_key(*size)) {
        return Err(Error::new(format!(
            "`{size}` cannot be set for {} here: numbers are written for each cell, and with --full for each pixel",
            spec.name
        )));
    }
    if takes(Role::Explained).is_none() && arguments.explain != STEERING {
        return Err(Error::new(format!(
            "{} explains no single number, so it cannot explain `{}`; leave --explain out, or take another method",
            spec.name, arguments.explain
        )));
    }
    let mut parameters = method::of_driver(registry.catalog(), driver, &spec)?.parameters;
    let given = [
        (Role::Explained, Value::from(arguments.explain.as_str())),
        (Role::Speed, Value::from(arguments.speed)),
    ];
    for (role, value) in given {
        if let Some(name) = takes(role) {
            parameters.entry(name).or_insert(value);
        }
    }
    let make = |value: &str| {
        let mut parameters = parameters.clone();
        parameters.extend(size.map(|size| (size.to_owned(), value.into())));
        registry.saliency(&spec.name, &parameters).map(|(instance, _)| instance)
    };
    let same = before
        .iter()
        .filter(|other| other.label.trim_end_matches(|c: char| c.is_ascii_digit() || c == '-') == spec.name)
        .count();
    Ok(Method {
        label: numbered(&spec.name, same),
        place: format!("saliency `{}`", spec.name),
        key: seed::key(arguments.seed, &spec.name, same as u64),
        cells: if size.is_some() { Some(make("layer")?) } else { None },
        frame: make("frame")?,
        by: ComponentSpec { name: spec.name, parameters },
        description: description.clone(),
        warned: false,
    })
}

impl Method {
    /// The map of a frame, as large as the frame.
    fn map(&mut self, frame: Frame<'_>, index: u64, speed: Option<f64>) -> Result<Vec<f32>> {
        let cx = MapContext { speed, recorded: true, ..MapContext::new(index, 0.0, &self.key) };
        maps::map(&mut *self.frame, &self.place, frame, &cx)
    }

    /// The map of a frame, a number for each cell, with its width.
    fn map_by_cell(&mut self, frame: Frame<'_>, index: u64, speed: Option<f64>) -> Result<(Vec<f32>, usize)> {
        let cx = MapContext { speed, recorded: true, ..MapContext::new(index, 0.0, &self.key) };
        let method = self.cells.as_mut().unwrap_or(&mut self.frame);
        let work = || {
            let [width, height] = method.map_size(frame.width(), frame.height())?;
            let mut values = vec![0.0; width * height];
            method.map(frame, &cx, HeatmapMut::new(&mut values, width, height)?)?;
            Ok((values, width))
        };
        calls::call_at(&self.place, Function::Map, index, work).map_err(|error: Error| error.at(&self.place))
    }
}
