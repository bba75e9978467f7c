//! `pdk show`: a component with its parameters.

use pdk::pipeline::table::table;
use pdk::suggest;
use pdk_sdk::describe::{Description, Kind, Parameter, ParameterType, Temporal};
use pdk_sdk::error::{Error, Result};
use serde_json::json;

use super::{Global, print_json};

/// Arguments of `pdk show`
#[derive(clap::Args)]
pub struct Arguments {
    /// The component's name
    name: String,
}

/// Shows every component of that name, whatever its kind.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let registry = global.registry()?;
    let all = || Kind::ALL.into_iter().flat_map(|kind| registry.of_kind(kind));
    let found: Vec<_> = all().filter(|component| component.description.name == arguments.name).collect();
    if found.is_empty() {
        let names: Vec<_> = all().map(|component| component.description.name.as_str()).collect();
        let hint = suggest::hint(&arguments.name, names.iter().copied());
        return Err(Error::new(format!("there is no component `{}`; {hint}", arguments.name)));
    }
    if global.json {
        let list: Vec<_> = found
            .iter()
            .map(|component| json!({ "description": component.description, "file": registry.file_of(component) }))
            .collect();
        return print_json(&json!(list));
    }
    for component in found {
        print(&component.description);
        println!("file      {}\n", registry.file_of(component).display());
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
            println!("kind      perturbation, family {}, {temporal}, {set}", description.family);
        }
        kind => println!("kind      {kind}"),
    }
    println!("version   {}", description.version);
    if !description.source.is_empty() {
        println!("source    {}", description.source);
    }
    if !description.parameters.is_empty() {
        let mut table = table(["parameter", "type", "unit", "default", "what it is"]);
        for parameter in &description.parameters {
            table.add_row([
                parameter.name.clone(),
                type_text(&parameter.kind),
                parameter.unit.clone(),
                default_text(parameter),
                parameter.doc.clone(),
            ]);
        }
        println!("{table}");
    }
}

fn type_text(kind: &ParameterType) -> String {
    match kind {
        ParameterType::Number { min, max } if *min > f64::MIN || *max < f64::MAX => {
            format!("number {}", range(*min > f64::MIN, min, *max < f64::MAX, max))
        }
        ParameterType::Integer { min, max } if *min > i64::MIN || *max < i64::MAX => {
            format!("integer {}", range(*min > i64::MIN, min, *max < i64::MAX, max))
        }
        ParameterType::Number { .. } => "number".to_owned(),
        ParameterType::Integer { .. } => "integer".to_owned(),
        ParameterType::Boolean => "true or false".to_owned(),
        ParameterType::Choice { options } => options.join(" | "),
        ParameterType::Text => "text".to_owned(),
        ParameterType::Path => "path".to_owned(),
        ParameterType::Json => "any".to_owned(),
    }
}

fn range<T: std::fmt::Display>(has_min: bool, min: T, has_max: bool, max: T) -> String {
    match (has_min, has_max) {
        (true, true) => format!("{min} to {max}"),
        (true, false) => format!("from {min}"),
        _ => format!("up to {max}"),
    }
}

fn default_text(parameter: &Parameter) -> String {
    match &parameter.levels {
        Some(levels) => {
            let levels: Vec<_> = levels.iter().map(f64::to_string).collect();
            format!("by level: {}", levels.join("  "))
        }
        None if parameter.default.is_null() => "required".to_owned(),
        None => match parameter.default.as_str() {
            Some("") => String::new(),
            Some(text) => text.to_owned(),
            None => parameter.default.to_string(),
        },
    }
}
