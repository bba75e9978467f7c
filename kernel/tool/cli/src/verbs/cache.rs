//! `pdk cache`: what components keep on this machine because it took long to prepare.

use clap::Subcommand;
use pdk_notice::println;
use pdk_sdk::cache::{self, Cache};
use pdk_sdk::error::Result;
use pdk_terminal::table::{Cell, CellAlignment, table};
use serde_json::json;

use super::{Global, print_json};

/// Arguments of `pdk cache`
#[derive(clap::Args)]
pub struct Arguments {
    #[command(subcommand)]
    verb: Option<Verb>,
}

#[derive(Subcommand)]
enum Verb {
    /// Remove everything that components have prepared; they make it again when they need it
    Clear,
}

/// Shows or clears the folder.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let cache = cache::cache()?;
    match arguments.verb {
        None => show(global, &cache),
        Some(Verb::Clear) => {
            let (files, bytes) = cache.clear()?;
            match global.json {
                true => print_json(&json!({ "folder": cache.folder, "files": files, "bytes": bytes }))?,
                false => {
                    println!("Removed {files} files of {} from {}.", size(bytes), cache.folder.display())
                }
            }
            Ok(())
        }
    }
}

fn show(global: &Global, cache: &Cache) -> Result<()> {
    let parts = cache.parts()?;
    if global.json {
        let parts: Vec<_> = parts
            .iter()
            .map(|part| json!({ "name": part.name, "files": part.files, "bytes": part.bytes }))
            .collect();
        return print_json(&json!({ "folder": cache.folder, "parts": parts }));
    }
    println!("{}", cache.folder.display());
    let mut rows = table(["part", "files", "size"]);
    for part in &parts {
        let right = |text: String| Cell::new(text).set_alignment(CellAlignment::Right);
        rows.add_row([Cell::new(&part.name), right(part.files.to_string()), right(size(part.bytes))]);
    }
    println!("{rows}");
    println!("Each part keeps itself below its own limit; `pdk cache clear` removes everything.");
    Ok(())
}

/// A number of bytes for people.
fn size(bytes: u64) -> String {
    indicatif::BinaryBytes(bytes).to_string()
}
