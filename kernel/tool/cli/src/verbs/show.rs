//! `pdk show`: a component with its parameters, or the network in a file.

use std::path::{Path, PathBuf};

use pdk_components::catalog::Entry;
use pdk_model::level::LEVELS;
use pdk_notice::println;
use pdk_preview::modifiers;
use pdk_preview::reference::{allowed, settings};
use pdk_sdk::describe::{Description, Geometry, Kind, Parameter, Temporal};
use pdk_sdk::error::{Error, Result};
use pdk_sdk::level_scales::Measured;
use pdk_sdk::suggest;
use pdk_terminal::shell;
use pdk_terminal::text::wrapped;
use serde_json::json;

use super::{Global, network, print_json};

/// Arguments of `pdk show`
#[derive(clap::Args)]
pub struct Arguments {
    /// The component's name, or an ONNX file
    name: String,
    /// Write what the network in the ONNX file sees of this picture, instead of the text
    #[arg(long, value_name = "IMAGE", requires = "out")]
    image: Option<PathBuf>,
    /// Where to write that
    #[arg(short, long, alias = "output", value_name = "FILE", requires = "image")]
    out: Option<PathBuf>,
}

/// Shows every component of that name, whatever its kind.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    if network::is_file(&arguments.name) {
        let seen = arguments.image.as_deref().zip(arguments.out.as_deref());
        return network::show(global, &arguments.name, seen);
    }
    if arguments.image.is_some() {
        return Err(Error::new(format!(
            "--image is for networks, and `{}` is not an ONNX file; leave it out, or name a file that ends in .onnx",
            arguments.name
        )));
    }
    let registry = global.registry()?;
    let catalog = registry.catalog();
    let all = || Kind::ALL.into_iter().flat_map(|kind| catalog.of_kind(kind));
    let found: Vec<_> = all().filter(|component| component.description.name == arguments.name).collect();
    if found.is_empty() {
        let names: Vec<_> = all().map(|component| component.description.name.as_str()).collect();
        let hint = of_script(global, &arguments.name)
            .unwrap_or_else(|| suggest::hint(&arguments.name, names.iter().copied()));
        return Err(Error::new(format!("there is no component `{}`; {hint}", arguments.name)));
    }
    if global.json {
        let list: Vec<_> = found
            .iter()
            .map(|component| json!({ "description": component.description, "code": component.code(), "file": component.file }))
            .collect();
        return print_json(&json!(list));
    }
    for component in found {
        print(component);
    }
    Ok(())
}

/// What to do if the name is that of a script, with its ending or without, in a folder that is not searched, or that is searched in vain; none
/// if there is no such script.
fn of_script(global: &Global, name: &str) -> Option<String> {
    let script = PathBuf::from(if name.ends_with(".lua") { name.to_owned() } else { format!("{name}.lua") });
    let stem = script.file_stem().filter(|_| script.is_file())?;
    let folder = folder_of(&script);
    let [file, shown] = [&*script, folder].map(|path| shell::quoted(&path.to_string_lossy()));
    let place = folder.canonicalize().ok();
    if global.plugins.iter().any(|searched| place.is_some() && searched.canonicalize().ok() == place) {
        return Some(format!("`pdk check {file}` reports what is wrong with {file}"));
    }
    // The command as it was typed, with the folder.
    let typed = std::env::args_os().skip(1).map(|word| if word == name { stem.to_owned() } else { word });
    let typed: Vec<_> = typed.map(|word| shell::quoted(&word.to_string_lossy())).collect();
    Some(format!("for {file}, write `pdk --plugins {shown} {}`", typed.join(" ")))
}

/// The folder of a script, as `--plugins` takes it.
pub fn folder_of(script: &Path) -> &Path {
    script.parent().filter(|folder| !folder.as_os_str().is_empty()).unwrap_or(Path::new("."))
}

fn print(component: &Entry) {
    let description = &component.description;
    println!("{} - {}\n", description.name, description.doc);
    let fact = |label: &str, text: &str| {
        if !text.is_empty() {
            println!("{}", wrapped(&format!("{label:<10}"), text));
        }
    };
    fact("kind", &kind(description));
    fact("version", &description.version.to_string());
    if !description.acts_on.is_frame() {
        fact("acts on", description.acts_on.text());
    }
    fact("computes", &description.mathematics);
    fact("once", &description.drawn_per_sequence);
    fact("per frame", &description.drawn_per_frame);
    fact("attention", &description.follows_attention);
    if description.history > 0 {
        fact("history", &format!("needs up to {} frames before the one at hand", description.history));
    }
    if let Some(choice) = &description.depth {
        fact("depth", &format!("with {choice} it needs a simulator that knows how far away pixels are"));
    }
    match description.geometry {
        Geometry::Moved => fact("labels", "moved along, if there are any"),
        Geometry::Altered => fact("labels", "cannot be moved along: it cannot say where it shows things"),
        Geometry::Kept | Geometry::Undeclared => {}
    }
    for divergence in &description.divergences {
        fact("differs", divergence);
    }
    if !description.grows_with.is_empty() {
        fact("grows", &format!("with {}", settings(&description.grows_with)));
    }
    fact("source", &description.source);
    if description.kind == Kind::Perturbation {
        let names = modifiers::names();
        fact("modifiers", &format!("{names}, as for every perturbation: `pdk perturb --help`"));
    }
    for measured in &component.scales {
        fact("scale", &on_scale(measured));
    }
    if component.code() != component.file {
        fact("code", &component.code().display().to_string());
    }
    fact("file", &component.file.display().to_string());
    for parameter in &description.parameters {
        println!("\n  {}", signature(parameter));
        println!("{}", wrapped("      ", &parameter.doc));
    }
    println!();
}

/// How far a perturbation reaches on a scale, and where the levels of the scale are among the published ones.
fn on_scale(measured: &Measured) -> String {
    let Measured { parameters, scale } = measured;
    let with = match parameters.is_empty() {
        true => String::new(),
        false => format!(" with {}", settings(parameters)),
    };
    let Some((low, high)) = scale.reach() else {
        return format!("{}{with}: reaches no level of it", scale.name);
    };
    let (levels, published): (Vec<_>, Vec<_>) = (0..LEVELS)
        .filter_map(|level| Some((level.to_string(), format!("{:.2}", scale.reached(level as f64)?))))
        .unzip();
    let places = match levels.is_empty() {
        true => String::new(),
        false if levels.len() == 1 => format!("; its {} is the published {}", levels[0], published[0]),
        false => format!("; its {} are the published {}", levels.join(" "), published.join(" ")),
    };
    format!("{}{with}: reaches levels {low} to {high} of it{places}", scale.name)
}

/// The kind of a component, and of a perturbation also its family and when it is used.
fn kind(description: &Description) -> String {
    if description.kind != Kind::Perturbation {
        return description.kind.to_string();
    }
    let family = match description.family.as_str() {
        "" => String::new(),
        family => format!(", family {family}"),
    };
    let temporal = match description.temporal {
        Temporal::Static => "static",
        Temporal::Dynamic => "dynamic",
    };
    let set = if description.default { "in the default set" } else { "by name only" };
    format!("perturbation{family}, {temporal}, {set}")
}

/// A parameter with what it may be, as in `speed = 8.0 (number 0 to 100, in m/s)`.
fn signature(parameter: &Parameter) -> String {
    let Parameter { name, unit, .. } = parameter;
    let mut allowed = allowed(&parameter.kind);
    if !unit.is_empty() {
        allowed.push_str(", in ");
        allowed.push_str(unit);
    }
    match default_text(parameter) {
        _ if parameter.is_required() => format!("{name} ({allowed}, required)"),
        default if default.is_empty() => format!("{name} ({allowed})"),
        default => format!("{name} = {default} ({allowed})"),
    }
}

/// The default as a spec has it; of a parameter that follows the level, the value at each level.
fn default_text(parameter: &Parameter) -> String {
    match &parameter.levels {
        Some(levels) => {
            let levels: Vec<_> = levels.iter().map(f64::to_string).collect();
            format!("{} by level", levels.join(" "))
        }
        None => match parameter.default.as_str() {
            Some(text) => text.to_owned(),
            None => parameter.default.to_string(),
        },
    }
}
