//! `pdk verify`: checks the verdict of a gate.

use std::path::PathBuf;

use pdk_gate::loaded::Loaded;
use pdk_gate::verdict::Verdict;
use pdk_gate::verify::{self, Verified, Wanted};
use pdk_model::scenario::ScenarioId;
use pdk_notice::eprintln;
use pdk_notice::println;
use pdk_record::directory::VERDICT;
use pdk_sdk::error::{Error, Result};
use serde_json::json;

use super::gate::suite_help;
use super::workers::Workers;
use super::{Global, print_json};

/// Arguments of `pdk verify`
#[derive(clap::Args)]
pub struct Arguments {
    /// The verdict: the file that a gate wrote, or the folder of its record
    #[arg(value_name = "VERDICT")]
    verdict: PathBuf,
    /// How many drives are repeated: of 59, one shows with 95 % that 5 % of the verdict are false
    #[arg(long, value_name = "N", default_value_t = 59)]
    probes: usize,
    /// A text of your own that goes into the draw, so that the maker of the verdict could not foresee which drives are repeated
    #[arg(long, value_name = "TEXT", default_value = "")]
    draw: String,
    /// Repeat this one alone, by its id, instead of those that are drawn
    #[arg(long, value_name = "ID", conflicts_with_all = ["probes", "draw"])]
    scenario: Option<ScenarioId>,
    #[arg(long, value_name = "SUITE", help = suite_help() + " [default: what the verdict names]")]
    suite: Option<String>,
    /// A file, such as a network, that takes the place of the one that the verdict names and has its content; may be given several times
    #[arg(long = "file", value_name = "FILE")]
    files: Vec<PathBuf>,
    #[command(flatten)]
    workers: Workers,
    /// Start the programs that the verdict names. Without it they are listed, and nothing is run
    #[arg(long)]
    trust: bool,
}

/// Verifies; returns whether the verdict holds.
pub fn run(global: &Global, arguments: &Arguments) -> Result<bool> {
    let Arguments { verdict, probes, draw, scenario, suite, files, workers, trust } = arguments;
    let path = if verdict.is_dir() { verdict.join(VERDICT) } else { verdict.clone() };
    let verdict = Verdict::read(&path)?;
    let named = suite.as_ref().unwrap_or(&verdict.suite.named);
    let mut loaded = Loaded::find(named).map_err(|error| {
        let was = &verdict.suite;
        Error::of(
            error.kind(),
            format!(
                "{error}; the verdict is of the suite `{}` version {} (BLAKE3 {})",
                was.name, was.version, was.blake3
            ),
        )
    })?;
    verify::check_suite(&verdict, &loaded)?;
    let session = global.session("verify", workers.pool(), workers.limits()?, global.search_path())?;
    let wanted =
        Wanted { probes: *probes, draw: draw.clone(), only: *scenario, files: files.clone(), trust: *trust };
    let progress = pdk_terminal::progress(global.json, "{pos}/{len} repeated, {eta} left");
    let verified = verify::verify(&verdict, &mut loaded, session, &wanted, &progress)?;
    for change in &verified.changes {
        eprintln!("pdk: warning: since the verdict was made, {change}, so outcomes may be others");
    }
    let holds = verified.refuted.is_empty();
    match global.json {
        true => {
            print_json(&json!({ "holds": holds, "passed": verdict.decision.passed, "verified": verified }))?
        }
        false => print(&verdict, &verified),
    }
    Ok(holds)
}

fn print(verdict: &Verdict, verified: &Verified) {
    let Verified { entries, probes, refuted, chances, .. } = verified;
    for sentence in refuted {
        println!("{sentence}");
    }
    if !refuted.is_empty() {
        println!("refuted: the verdict does not hold ({} of its statements are wrong)", refuted.len());
        return;
    }
    println!("Its root, its scenarios and its decision agree with each other and with the suite.");
    let unit = verdict.unit();
    println!("{} of {entries} {unit} were repeated and came out the same, bit for bit.", probes.len());
    // Of all drives, nothing is left to chance.
    for (share, probability) in chances.iter().filter(|_| probes.len() < *entries) {
        println!(
            "If {:.0} % of its {unit} were false, this would have shown with a probability of {:.1} %.",
            100.0 * share,
            100.0 * probability
        );
    }
    let word = if verdict.decision.passed { "passed" } else { "failed" };
    println!("holds: {} {word} against {}", verdict.new.named, verdict.old.named);
}
