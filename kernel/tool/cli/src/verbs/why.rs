//! `pdk why`: the smallest parts of a failed drive that are proven to matter.

use std::path::{Path, PathBuf};

use pdk_notice::println;
use pdk_replay::shrink::script;
use pdk_replay::why::{Proof, Why, words};
use pdk_sdk::error::{Error, Place, Result};
use serde_json::{Value, json};

use super::recorded::{self, Chosen, Driving};
use super::workers::Workers;
use super::{Global, print_json, sensitivity};

/// The two drives that prove a cause, as their files are called.
const SUFFICIENT: &str = "sufficient";
const NECESSARY: &str = "necessary";

/// Arguments of `pdk why`
#[derive(clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    chosen: Chosen,
    /// The folder for sufficient.lua and necessary.lua, which repeat the two drives that prove the cause
    #[arg(short, long = "out", alias = "output", value_name = "DIR", default_value = "why")]
    output: PathBuf,
    /// Write videos of the two drives as well: original and perturbed frames and what the driver did
    #[arg(long)]
    clips: bool,
    #[command(flatten)]
    workers: Workers,
    /// Load the libraries and scripts and start the programs that the record names, although they are not installed. Without it
    /// they are listed, and nothing of the record is run
    #[arg(long)]
    trust: bool,
}

/// Searches, and writes both drives as pipelines.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let Chosen { record, scenario } = &arguments.chosen;
    let Arguments { output, clips, .. } = arguments;
    super::check_folder(output)?;
    let limits = arguments.workers.limits()?;
    let driving =
        Driving { verb: "why", record, pool: arguments.workers.pool(), limits, trust: arguments.trust };
    let (replay, session, search) = recorded::open(global, scenario, driving, "not fail any more")?;
    let Some(line) = replay.lines().next().cloned() else {
        return Err(Error::new("there is no scenario to explain"));
    };
    std::fs::create_dir_all(output).place(output.display())?;
    let films = [SUFFICIENT, NECESSARY].map(|name| output.join(format!("{name}.mp4")));
    let progress = pdk_terminal::progress(global.json, "{msg} {elapsed}");
    let why = replay.why(session, clips.then(|| films.each_ref().map(PathBuf::as_path)), &progress)?;
    progress.finish_and_clear();
    let sentences = sentences(&why);
    for (name, proof, sentence) in
        [(SUFFICIENT, &why.sufficient, &sentences[0]), (NECESSARY, &why.necessary, &sentences[1])]
    {
        let file = format!("{name}.lua");
        let text = script(&proof.scenario, &proof.outcome, sentence.trim_end_matches('.'), &file)?;
        let path = output.join(file);
        pdk_sdk::file::write(&path, text.as_bytes()).place(path.display())?;
    }
    if !global.json {
        for name in &why.not_needed {
            println!("{name} is not needed.");
        }
        for sentence in &sentences {
            println!("{sentence}");
        }
        println!("Proven by {} drives; {} repeats two of them", why.probes, output.join("*.lua").display());
        if *clips {
            println!("Clips: {}", films.each_ref().map(|film| film.display().to_string()).join(" "));
        }
    }
    // Last, since it runs the components in this process: what is proven is written by now.
    let progress = pdk_terminal::progress(global.json, "{msg} {elapsed}");
    let derivative = sensitivity::sentences(&search, &line, &progress);
    progress.finish_and_clear();
    if global.json {
        let (known, unknown) = match derivative {
            Ok(sentences) => (sentences, None),
            Err(reason) => (Vec::new(), Some(reason.to_string())),
        };
        return print_json(&json!({
            "sufficient": proof(&why.sufficient, why.interval, output, SUFFICIENT),
            "necessary": proof(&why.necessary, why.interval, output, NECESSARY),
            "not_needed": why.not_needed,
            "probes": why.probes,
            "derivative": {"sentences": known, "unknown": unknown},
        }));
    }
    match derivative {
        Ok(sentences) => sentences.iter().for_each(|sentence| println!("Derivative: {sentence}")),
        Err(reason) => println!("Derivative: not known, because {reason}."),
    }
    Ok(())
}

/// A proof for other programs.
fn proof(proof: &Proof, interval: f64, output: &Path, name: &str) -> Value {
    let Proof { part, scenario, outcome } = proof;
    json!({
        "frames": [part.frames.start, part.frames.end - 1],
        "seconds": [f64::from(part.frames.start) * interval, f64::from(part.frames.end - 1) * interval],
        "box": part.area(),
        "scenario": scenario,
        "outcome": outcome,
        "pipeline": output.join(format!("{name}.lua")),
    })
}

/// What was found, a sentence for each direction.
fn sentences(why: &Why) -> [String; 2] {
    let Why { sufficient, necessary, within, interval, .. } = why;
    let names: Vec<String> =
        sufficient.scenario.perturbations.iter().map(|applied| applied.name.clone()).collect();
    let names = names.join(" and ");
    let elsewhere =
        if *within { "" } else { "; it is not within what suffices, so there is more than one cause" };
    [
        format!(
            "Sufficient: {names} in {} alone; the drive ends with {} at {:.2} s.",
            words(&sufficient.part, *interval),
            sufficient.outcome.cause.text(),
            sufficient.outcome.time
        ),
        format!(
            "Necessary: {names} in {}; with everything else up to the failure perturbed the drive reaches the end{elsewhere}.",
            words(&necessary.part, *interval)
        ),
    ]
}
