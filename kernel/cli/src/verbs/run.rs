//! `pdk run`: runs a pipeline.

use std::path::PathBuf;
use std::sync::Arc;

use pdk::pipeline::{self, Options, settings::Override};
use pdk_sdk::error::Result;
use serde_json::json;

use super::{Global, print_json};

/// Arguments of `pdk run`
#[derive(clap::Args)]
pub struct Arguments {
    /// The pipeline
    #[arg(value_name = "PIPELINE.lua")]
    pipeline: PathBuf,
    /// Put a value in the place of a setting's default; dots lead into tables
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<Override>,
    /// The seed that all random numbers come from [default: 0]
    #[arg(long)]
    seed: Option<u64>,
    /// The folder of the record [default: runs/NAME-N]
    #[arg(short, long, alias = "output", value_name = "DIR")]
    out: Option<PathBuf>,
    /// How many frames or scenarios are computed at the same time [default: all processors]
    #[arg(long)]
    threads: Option<usize>,
}

/// Runs a pipeline and says where its record is.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let mut overrides = arguments.overrides.clone();
    let common = [
        ("seed", arguments.seed.map(|seed| seed.to_string())),
        ("out", arguments.out.as_ref().map(|out| out.to_string_lossy().into_owned())),
        ("threads", arguments.threads.map(|threads| threads.to_string())),
    ];
    for (key, value) in common {
        overrides.extend(value.map(|value| Override { key: key.to_owned(), value }));
    }
    let registry = Arc::new(global.registry()?);
    let finished = pipeline::run(registry, &arguments.pipeline, Options { overrides, quiet: global.json })?;
    for warning in &finished.warnings {
        eprintln!("pdk: warning: {warning}");
    }
    if global.json {
        print_json(&json!({ "record": finished.record, "summary": finished.summary }))?;
    } else if let Some(record) = &finished.record {
        println!("Record: {}", record.display());
    }
    finished.failure.map_or(Ok(()), Err)
}
