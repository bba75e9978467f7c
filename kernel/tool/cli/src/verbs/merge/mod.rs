//! `pdk merge`: the records of the parts of a run as one.

mod parts;

use std::path::PathBuf;

use pdk_notice::println;
use pdk_sdk::error::Result;
use serde_json::json;

use self::parts::{Merged, merge};
use super::{Global, print_json};

/// Arguments of `pdk merge`
#[derive(clap::Args)]
pub struct Arguments {
    /// The folders of the records of all parts
    #[arg(value_name = "RUN", required = true)]
    parts: Vec<PathBuf>,
    /// The folder of the record of the whole
    #[arg(short, long, alias = "output", value_name = "DIR")]
    out: PathBuf,
}

/// Puts the records together.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let Merged { scenarios, frames } = merge(&arguments.parts, &arguments.out)?;
    if global.json {
        return print_json(&json!({ "record": arguments.out, "scenarios": scenarios, "frames": frames }));
    }
    let counts = [(scenarios, "scenarios"), (frames, "evaluated frames")];
    let counts = counts.iter().filter(|(count, _)| *count > 0).map(|(count, what)| format!("{count} {what}"));
    println!("{} of {} parts", counts.collect::<Vec<_>>().join(" and "), arguments.parts.len());
    println!("Record: {}", arguments.out.display());
    println!(
        "The command of the parts, without --shard and with --out and this folder, completes it: only scenarios in which a component failed are driven again."
    );
    Ok(())
}
