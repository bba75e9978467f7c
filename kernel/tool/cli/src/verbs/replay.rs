//! `pdk replay`: drives recorded scenarios again and compares them with their record.

use std::path::{Path, PathBuf};

use pdk_notice::eprintln;
use pdk_notice::println;
use pdk_record::directory::SCENARIOS;
use pdk_replay::compare::{Compared, Finding};
use pdk_replay::replay::{Film, Replay, Replayed};
use pdk_report::record;
use pdk_sdk::error::{Error, Result};
use serde_json::{Value, json};

use super::recorded::{self, Driving};
use super::workers::Workers;
use super::{Global, print_json};

/// Arguments of `pdk replay`
#[derive(clap::Args)]
pub struct Arguments {
    /// The folder of the record
    #[arg(value_name = "RUN")]
    record: PathBuf,
    /// Only this scenario, by its number, its id or the beginning of that; may be given several times [default: all scenarios]
    #[arg(long = "scenario", value_name = "N|ID")]
    scenarios: Vec<String>,
    #[command(flatten)]
    workers: Workers,
    /// Write a video of the scenario: original and perturbed frames and what the driver did. Of two scenarios, such as those of two
    /// drivers, it shows what the drivers saw beside each other
    #[arg(long, value_name = "FILE.mp4")]
    clip: Option<PathBuf>,
    /// Show in the video what the driver's network looks at, by this saliency method [default: the one that `pdk list saliency` marks as the default]
    #[arg(long, value_name = "NAME[,PARAMETER=VALUE]...", requires = "clip", num_args = 0..=1, require_equals = true,
          default_missing_value = "")]
    saliency: Option<String>,
    /// Load the libraries and scripts and start the programs that the record names, although they are not installed. Without it
    /// they are listed, and nothing of the record is run
    #[arg(long)]
    trust: bool,
}

/// Replays and says for each scenario whether it is equal, or where it first differs.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let saliency = arguments.saliency.clone();
    let film = arguments.clip.clone().map(|path| Film { path, saliency });
    let replay = Replay::open(&arguments.record, &arguments.scenarios)?;
    if let Some(clip) = &arguments.clip {
        check_clip(clip, replay.count())?;
        if replay.count() == 2 && arguments.saliency.is_some() {
            return Err(Error::new(
                "--saliency is for the clip of one scenario, and these are 2; choose one with --scenario N",
            ));
        }
    }
    if replay.cut_off() {
        eprintln!("pdk: warning: {}", record::cut_off_warning(&arguments.record.join(SCENARIOS)));
    }
    let Arguments { record, trust, .. } = arguments;
    let driving = Driving {
        verb: "replay",
        record,
        pool: arguments.workers.pool(),
        limits: arguments.workers.limits()?,
        trust: *trust,
    };
    let (mut session, _) = recorded::session(global, &replay, driving)?;
    let changes = replay.changes(&mut session)?;
    for change in &changes {
        eprintln!(
            "pdk: warning: since the run was recorded, {change}, so the replay may come out differently"
        );
    }
    let progress = pdk_terminal::progress(global.json, "{pos}/{len} frames, {per_sec}, {eta} left");
    let replayed = replay.drive(session, film.as_ref(), &progress)?;
    for warning in &replayed.warnings {
        eprintln!("pdk: warning: {warning}");
    }
    match global.json {
        true => print_json(&as_json(arguments, &replayed, &changes))?,
        false => print(arguments, &replayed),
    }
    failure(&replayed).map_or(Ok(()), Err)
}

fn check_clip(clip: &Path, scenarios: usize) -> Result<()> {
    if !(1..=2).contains(&scenarios) {
        return Err(Error::new(format!(
            "--clip shows one scenario or two, and these are {scenarios}; choose one with --scenario N"
        )));
    }
    match clip.extension().is_some_and(|ending| ending.eq_ignore_ascii_case("mp4")) {
        true => Ok(()),
        false => Err(Error::new(format!("the name of the clip, {}, has to end in .mp4", clip.display()))),
    }
}

fn print(arguments: &Arguments, replayed: &Replayed) {
    for compared in &replayed.scenarios {
        println!("{compared}");
    }
    let equal = replayed.scenarios.iter().filter(|compared| matches!(compared.finding, Finding::Equal));
    let (equal, all) = (equal.count(), replayed.scenarios.len());
    let Replayed { frames, wall_seconds, .. } = replayed;
    let rate = *frames as f64 / wall_seconds.max(f64::MIN_POSITIVE);
    println!("{equal} of {all} equal: {frames} frames in {wall_seconds:.1} s, {rate:.0} a second");
    if let Some(clip) = &arguments.clip {
        println!("Clip: {}", clip.display());
    }
}

fn as_json(arguments: &Arguments, replayed: &Replayed, changes: &[String]) -> Value {
    let row = |compared: &Compared| {
        let (difference, error) = match &compared.finding {
            Finding::Equal => (Value::Null, Value::Null),
            Finding::Different(difference) => (json!(difference), Value::Null),
            Finding::Unreadable(error) => (Value::Null, json!(error.to_string())),
        };
        json!({
            "number": compared.number,
            "id": compared.id,
            "name": compared.name,
            "frames": compared.frames,
            "equal": matches!(compared.finding, Finding::Equal),
            "difference": difference,
            "error": error,
        })
    };
    json!({
        "record": arguments.record,
        "scenarios": replayed.scenarios.iter().map(row).collect::<Vec<_>>(),
        "frames": replayed.frames,
        "wall_seconds": replayed.wall_seconds,
        "changes": changes,
        "clip": arguments.clip,
    })
}

/// Why the replay counts as failed: scenarios that could not be compared, or ones that differ.
fn failure(replayed: &Replayed) -> Option<Error> {
    let all = replayed.scenarios.len();
    let unreadable = |compared: &Compared| match &compared.finding {
        Finding::Unreadable(error) => Some(error.to_string()),
        _ => None,
    };
    let different =
        |compared: &Compared| matches!(compared.finding, Finding::Different(_)).then(|| compared.to_string());
    let found = |what: fn(&Compared) -> Option<String>| -> Vec<String> {
        replayed.scenarios.iter().filter_map(what).collect()
    };
    let (unreadable, different) = (found(unreadable), found(different));
    let sentence = match (unreadable.as_slice(), different.as_slice()) {
        ([], []) => return None,
        ([], [one]) if all == 1 => format!("it differs from the record: {one}"),
        ([], [first, ..]) => {
            format!("{} of {all} scenarios differ from the record; the first: {first}", different.len())
        }
        ([one], []) if all == 1 => one.clone(),
        ([first, ..], []) => {
            format!("{} of {all} scenarios could not be compared; the first: {first}", unreadable.len())
        }
        ([first, ..], [other, ..]) => format!(
            "{} of {all} scenarios differ from the record and {} could not be compared; the first of these: {other}; {first}",
            different.len(),
            unreadable.len()
        ),
    };
    Some(Error::new(sentence))
}
