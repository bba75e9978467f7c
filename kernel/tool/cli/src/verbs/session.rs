//! `pdk session`: runs a pipeline for another program, which says line by line what to drive.

use std::path::PathBuf;

use pdk_notice::eprintln;
use pdk_pipeline::follow::{Audience, Told, tell};
use pdk_pipeline::{remote, run};
use pdk_sdk::error::Result;

use super::Global;
use super::settings::Settings;

/// Arguments of `pdk session`
#[derive(clap::Args)]
pub struct Arguments {
    /// A pipeline to run, as `pdk run` takes it; without it the program itself is the pipeline
    pipeline: Option<PathBuf>,
    /// The file with the program that calls, for the record
    #[arg(long, value_name = "FILE", conflicts_with = "pipeline")]
    program: Option<PathBuf>,
    #[command(flatten)]
    settings: Settings,
}

/// Runs it to its end, and tells the program on standard output what comes.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let options = arguments.settings.options(global, Audience::Program)?;
    let finished = match &arguments.pipeline {
        Some(pipeline) => {
            remote::follow()?;
            run::run(pipeline, options)?
        }
        None => remote::serve(arguments.program.clone(), options)?,
    };
    for warning in &finished.warnings {
        eprintln!("pdk: warning: {warning}");
    }
    tell(&Told::from(&finished));
    finished.failure.map_or(Ok(()), Err)
}
