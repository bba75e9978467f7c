//! `pdk run`: runs a pipeline.

use std::path::PathBuf;

use pdk_components::product;
use pdk_model::scenario::parse_seed;
use pdk_notice::eprintln;
use pdk_notice::println;
use pdk_pipeline::follow::Audience;
use pdk_pipeline::run::{self, Options};
use pdk_pipeline::settings::{Common, Override};
use pdk_record::shard::Shard;
use pdk_sdk::error::Result;
use serde_json::json;

use super::{Global, print_json};

/// Arguments of `pdk run`
#[derive(clap::Args)]
pub struct Arguments {
    #[arg(value_name = "PIPELINE", help = pipeline_help())]
    pipeline: PathBuf,
    #[command(flatten)]
    settings: Settings,
}

/// What is set for any pipeline.
#[derive(clap::Args)]
pub struct Settings {
    /// Put a value in the place of a setting's default; dots lead into tables
    #[arg(long = "set", value_name = "KEY=VALUE")]
    overrides: Vec<Override>,
    /// The seed that all random numbers come from [default: 0]
    #[arg(long, value_parser = parse_seed)]
    seed: Option<u64>,
    /// The folder of the record [default: runs/NAME-N]
    #[arg(short, long, alias = "output", value_name = "DIR")]
    out: Option<PathBuf>,
    /// How many scenarios or frames are computed at the same time [default: one a processor; one for a simulator that
    /// pdk does not start]
    #[arg(long, value_parser = clap::value_parser!(u64).range(1..=1024))]
    workers: Option<u64>,
    /// A command that provides workers, in the place of this machine's (see docs/worker-protocol.md)
    #[arg(long, value_name = "COMMAND")]
    pool: Option<String>,
    /// Compute only a part of the scenarios and of the frames of datasets, such as the third of eight; `pdk merge` puts the parts together
    #[arg(long, value_name = "3/8")]
    shard: Option<Shard>,
    /// Where a run is continued, keep the scenarios in which a component failed instead of driving them again
    #[arg(long)]
    keep_errors: bool,
}

impl Settings {
    /// How a pipeline is run with these settings.
    ///
    /// # Errors
    /// Where a value is not one that the setting can have.
    pub fn options(&self, global: &Global, audience: Audience) -> Result<Options> {
        let (mut common, overrides) = Common::read(self.overrides.clone())?;
        common.seed = self.seed.unwrap_or(common.seed);
        common.workers = self.workers.map(|workers| workers as usize).or(common.workers);
        common.out = self.out.clone().or(common.out);
        common.pool = self.pool.clone().or(common.pool).filter(|command| !command.is_empty());
        common.shard = self.shard.or(common.shard);
        common.keep_errors |= self.keep_errors;
        Ok(Options { common, overrides, search: global.search_path(), audience })
    }
}

/// What the pipeline on the command line may be.
fn pipeline_help() -> String {
    let names: Vec<_> = product::get().pipelines.iter().map(|script| script.name).collect();
    format!("The pipeline: a file, or one that comes with pdk by its name: {}", names.join(", "))
}

/// Runs a pipeline and says where its record is.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let audience = if global.json { Audience::Nobody } else { Audience::Person };
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
