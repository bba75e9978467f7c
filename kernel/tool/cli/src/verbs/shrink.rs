//! `pdk shrink`: the simplest scenario that still fails like a recorded one.

use std::path::PathBuf;

use pdk_notice::println;
use pdk_replay::shrink::{Limits, Shrunk, luck, script};
use pdk_sdk::error::{Error, Place, Result};
use serde_json::json;

use super::recorded::{self, Chosen, Driving};
use super::workers::Workers;
use super::{Global, print_json};

/// Arguments of `pdk shrink`
#[derive(clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    chosen: Chosen,
    /// Where the pipeline with what is left goes; the name ends in .lua
    #[arg(short, long = "out", alias = "output", value_name = "FILE.lua", default_value = "failure.lua")]
    output: PathBuf,
    /// Write a video of what is left: original and perturbed frames and what the driver did
    #[arg(long, value_name = "FILE.mp4")]
    clip: Option<PathBuf>,
    /// How near an intensity comes to the lowest that fails
    #[arg(long, value_name = "LEVELS", default_value_t = 0.1)]
    precision: f64,
    /// Under how many fresh seeds what is left is driven
    #[arg(long, value_name = "N", default_value_t = 20)]
    draws: usize,
    #[command(flatten)]
    workers: Workers,
    /// Load the libraries and scripts and start the programs that the record names, although they are not installed. Without it
    /// they are listed, and nothing of the record is run
    #[arg(long)]
    trust: bool,
}

/// Shrinks, and writes what is left as a pipeline.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let Chosen { record, scenario } = &arguments.chosen;
    let Arguments { output, clip, precision, draws, .. } = arguments;
    if precision.is_nan() || *precision <= 0.0 {
        return Err(Error::new(format!("--precision is {precision}, but has to be more than 0")));
    }
    if output.extension().is_none_or(|ending| ending != "lua") {
        return Err(Error::new(format!(
            "the name of the pipeline, {}, has to end in .lua",
            output.display()
        )));
    }
    if let Some(clip) = clip
        && !clip.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("mp4"))
    {
        return Err(Error::new(format!("the name of the clip, {}, has to end in .mp4", clip.display())));
    }
    let limits = arguments.workers.limits()?;
    let driving =
        Driving { verb: "shrink", record, pool: arguments.workers.pool(), limits, trust: arguments.trust };
    let (replay, session, _) = recorded::open(global, scenario, driving, "not fail any more")?;
    let progress = pdk_terminal::progress(global.json, "{msg} {elapsed}");
    let shrunk = replay.shrink(
        session,
        Limits { precision: *precision, draws: *draws },
        clip.as_deref(),
        &progress,
    )?;
    progress.finish_and_clear();
    let name = output.file_name().map(|name| name.to_string_lossy()).unwrap_or_default();
    pdk_sdk::file::write(
        output,
        script(&shrunk.scenario, &shrunk.outcome, &luck(&shrunk), &name)?.as_bytes(),
    )
    .place(output.display())?;
    match global.json {
        true => print_json(&json!({
            "scenario": shrunk.scenario,
            "outcome": shrunk.outcome,
            "steps": shrunk.steps,
            "attempts": shrunk.attempts,
            "failed": shrunk.failed.0,
            "draws": shrunk.failed.1,
            "pipeline": output,
            "clip": clip,
        })),
        false => {
            print(&shrunk, arguments);
            Ok(())
        }
    }
}

fn print(shrunk: &Shrunk, arguments: &Arguments) {
    let Shrunk { scenario, outcome, steps, attempts, .. } = shrunk;
    for step in steps {
        println!("{step}");
    }
    if steps.is_empty() {
        println!("Nothing of it can be left out.");
    }
    println!(
        "{}: {} after {:.2} s; found in {attempts} drives",
        scenario.default_name(),
        outcome.cause.text(),
        outcome.time
    );
    let luck = luck(shrunk);
    if !luck.is_empty() {
        println!("{luck}");
    }
    println!("Pipeline: {}", arguments.output.display());
    if let Some(clip) = &arguments.clip {
        println!("Clip: {}", clip.display());
    }
}
