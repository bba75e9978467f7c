//! `pdk list`: what components there are.

use pdk_components::catalog::Entry;
use pdk_notice::println;
use pdk_sdk::describe::{Description, Kind, Temporal};
use pdk_sdk::error::{Error, Result};
use pdk_terminal::table::table;
use serde_json::json;

use super::{Global, print_json};

/// Arguments of `pdk list`
#[derive(clap::Args)]
pub struct Arguments {
    /// Only components of this kind
    #[arg(value_parser = clap::builder::PossibleValuesParser::new(Kind::ALL.map(Kind::name)))]
    kind: Option<String>,
}

/// Lists components by kind, perturbations by family.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let registry = global.registry()?;
    let catalog = registry.catalog();
    let wanted = |kind: &Kind| arguments.kind.as_deref().is_none_or(|name| name == kind.name());
    let kinds: Vec<Kind> = Kind::ALL.into_iter().filter(wanted).collect();
    if global.json {
        let entries = kinds.iter().flat_map(|kind| catalog.of_kind(*kind));
        let list: Vec<_> = entries
            .map(
                |entry| json!({ "description": entry.description, "code": entry.code(), "file": entry.file }),
            )
            .collect();
        return print_json(&json!(list));
    }
    let mut empty = true;
    for kind in kinds {
        let mut components: Vec<&Entry> = catalog.of_kind(kind).collect();
        if components.is_empty() {
            continue;
        }
        empty = false;
        components.sort_by(|a, b| {
            (&a.description.family, &a.description.name).cmp(&(&b.description.family, &b.description.name))
        });
        match kind {
            Kind::Perturbation => print_perturbations(&components),
            _ => {
                let mut table = table([kind.name(), "what it does"]);
                for component in components {
                    let Description { name, doc, preferred, .. } = &component.description;
                    let used = if *preferred { "; the default" } else { "" };
                    table.add_row([name.clone(), format!("{doc}{used}")]);
                }
                println!("{table}\n");
            }
        }
    }
    if let (true, Some(kind)) = (empty, &arguments.kind) {
        println!("No {kind} is installed.");
    } else if empty {
        return Err(Error::new(
            "no components were found; plugins lie beside the executable, in a folder named with --plugins or in PDK_PLUGIN_PATH, \
             and `pdk doctor` says more",
        ));
    }
    Ok(())
}

fn print_perturbations(components: &[&Entry]) {
    let mut table = table(["family", "perturbation", "motion", "default", "what it does"]);
    let mut family = "";
    for component in components {
        let description = &component.description;
        let of = if description.family.is_empty() { "no family" } else { &description.family };
        let shown = if of == family { "" } else { of };
        family = of;
        let temporal = match description.temporal {
            Temporal::Static => "static",
            Temporal::Dynamic => "dynamic",
        };
        let default = if description.default { "yes" } else { "by name" };
        table.add_row([shown, &description.name, temporal, default, &description.doc]);
    }
    println!("{table}\n");
}
