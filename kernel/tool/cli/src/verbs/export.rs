//! `pdk export`: the record of a run in the shape of other tools.

use std::path::PathBuf;

use pdk_notice::eprintln;
use pdk_record::directory::RunDirectory;
use pdk_report::published;
use pdk_sdk::error::Result;
use serde_json::json;

use super::{Global, print_json};

/// Arguments of `pdk export`
#[derive(clap::Args)]
pub struct Arguments {
    /// The folder of the record
    #[arg(value_name = "RUN")]
    record: PathBuf,
    /// Where to write the scenarios, in the JSON shape of the published tool; without it they go to standard output
    #[arg(short, long = "out", alias = "output", value_name = "FILE")]
    output: Option<PathBuf>,
}

/// Reads the scenarios of a run and writes them in the published shape.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let (outcomes, cut_off) = published::outcomes(&RunDirectory::open(&arguments.record)?)?;
    if cut_off {
        eprintln!("pdk: warning: the last line of scenarios.jsonl is cut off, so its scenario is left out");
    }
    match &arguments.output {
        None => print_json(&json!(outcomes)),
        Some(path) => {
            published::write(path, &outcomes)?;
            if global.json {
                print_json(&json!({ "output": path, "scenarios": outcomes.len() }))?;
            }
            Ok(())
        }
    }
}
