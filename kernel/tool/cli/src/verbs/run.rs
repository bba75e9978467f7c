//! `pdk run`: runs a pipeline.

use std::path::PathBuf;

use pdk_components::product;
use pdk_notice::eprintln;
use pdk_notice::println;
use pdk_pipeline::follow::Audience;
use pdk_pipeline::run;
use pdk_sdk::error::Result;
use serde_json::json;

use super::settings::Settings;
use super::{Global, print_json};

/// Arguments of `pdk run`
#[derive(clap::Args)]
pub struct Arguments {
    #[arg(value_name = "PIPELINE", help = pipeline_help())]
    pipeline: PathBuf,
    #[command(flatten)]
    settings: Settings,
}

/// What the pipeline on the command line may be.
fn pipeline_help() -> String {
    let names: Vec<_> = product::get().pipelines.iter().map(|script| script.name).collect();
    format!("The pipeline: a file, or one that comes with pdk by its name: {}", names.join(", "))
}

/// Runs a pipeline and says where its record is.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let audience = if global.json { Audience::None } else { Audience::Person };
    let options = arguments.settings.options(global, audience)?;
    let finished = run::run(&arguments.pipeline, options)?;
    for warning in &finished.warnings {
        eprintln!("pdk: warning: {warning}");
    }
    if global.json {
        print_json(&json!({ "record": finished.record, "summary": finished.summary }))?;
    } else {
        finished.speed.iter().for_each(|line| println!("{line}"));
        if let Some(record) = &finished.record {
            println!("Record: {}", record.display());
        }
    }
    finished.failure.map_or(Ok(()), Err)
}
