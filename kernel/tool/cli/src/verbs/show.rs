//! `pdk show`: a component with its parameters, or the network in a file.

use pdk_components::modifiers;
use pdk_components::suggest;
use pdk_notice::println;
use pdk_pipeline::table::table;
use pdk_preview::reference::{allowed, settings};
use pdk_sdk::describe::{Description, Kind, Parameter, Temporal};
use pdk_sdk::error::{Error, Result};
use serde_json::json;

use super::{Global, network, print_json};

/// Arguments of `pdk show`
#[derive(clap::Args)]
pub struct Arguments {
    /// The component's name, or an ONNX file
    name: String,
}

/// Shows every component of that name, whatever its kind.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    if network::is_file(&arguments.name) {
        return network::show(global, &arguments.name);
    }
    let registry = global.registry()?;
    let catalog = registry.catalog();
    let all = || Kind::ALL.into_iter().flat_map(|kind| catalog.of_kind(kind));
    let found: Vec<_> = all().filter(|component| component.description.name == arguments.name).collect();
    if found.is_empty() {
        let names: Vec<_> = all().map(|component| component.description.name.as_str()).collect();
        let hint = suggest::hint(&arguments.name, names.iter().copied());
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
        print(&component.description);
        if component.code() != component.file {
            println!("code      {}", component.code().display());
        }
        println!("file      {}\n", component.file.display());
    }
    Ok(())
}

fn print(description: &Description) {
    println!("{} - {}", description.name, description.doc);
    println!();
    let temporal = match description.temporal {
        Temporal::Static => "static",
        Temporal::Dynamic => "dynamic",
    };
    let set = if description.default { "in the default set" } else { "by name only" };
    match description.kind {
        Kind::Perturbation => {
            let family = match description.family.as_str() {
                "" => String::new(),
                family => format!(", family {family}"),
            };
            println!("kind      perturbation{family}, {temporal}, {set}");
        }
        kind => println!("kind      {kind}"),
    }
    println!("version   {}", description.version);
    for (label, text) in [
        ("computes ", &description.mathematics),
        ("once     ", &description.drawn_per_sequence),
        ("per frame", &description.drawn_per_frame),
        ("attention", &description.follows_attention),
    ] {
        if !text.is_empty() {
            println!("{label} {text}");
        }
    }
    for divergence in &description.divergences {
        println!("differs   {divergence}");
    }
    if !description.grows_with.is_empty() {
        println!("grows     with {}", settings(&description.grows_with));
    }
    if !description.source.is_empty() {
        println!("source    {}", description.source);
    }
    if !description.parameters.is_empty() {
        let mut table = table(["parameter", "type", "unit", "default", "what it is"]);
        for parameter in &description.parameters {
            table.add_row([
                parameter.name.clone(),
                allowed(&parameter.kind),
                parameter.unit.clone(),
                default_text(parameter),
                parameter.doc.clone(),
            ]);
        }
        println!("{table}");
    }
    if description.kind == Kind::Perturbation {
        println!("modifiers {}, as for every perturbation: `pdk perturb --help`", modifiers::names());
    }
}

fn default_text(parameter: &Parameter) -> String {
    match &parameter.levels {
        Some(levels) => {
            let levels: Vec<_> = levels.iter().map(f64::to_string).collect();
            format!("by level: {}", levels.join("  "))
        }
        None if parameter.is_required() => "required".to_owned(),
        None => match parameter.default.as_str() {
            Some("") => String::new(),
            Some(text) => text.to_owned(),
            None => parameter.default.to_string(),
        },
    }
}
