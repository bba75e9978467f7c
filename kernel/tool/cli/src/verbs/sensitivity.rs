//! `pdk sensitivity`: how the largest error of a drive changes with the level at each frame.

use std::ops::Range;
use std::path::{Path, PathBuf};

use pdk_components::registry::Registry;
use pdk_lua::LuaScripts;
use pdk_model::outcome::Outcome;
use pdk_model::scenario::Scenario;
use pdk_notice::{eprintln, println};
use pdk_preview::picture::to_frame;
use pdk_replay::drives;
use pdk_replay::replay::Replay;
use pdk_replay::shrink::script;
use pdk_sdk::error::{Error, Place, Result};
use pdk_sensitivity::analysis::{Analysis, OfPerturbation, SHARE};
use pdk_sensitivity::plot;
use pdk_terminal::table::table;
use serde_json::{Value, json};

use super::recorded::{self, Driving};
use super::workers::Workers;
use super::{Global, print_json};

/// The pipeline with the least change.
const LEAST: &str = "least.lua";

/// Arguments of `pdk sensitivity`
#[derive(clap::Args)]
pub struct Arguments {
    /// The folder of the record
    #[arg(value_name = "RUN")]
    record: PathBuf,
    /// The scenario, by its number, its id or the beginning of that
    #[arg(long, value_name = "N|ID")]
    scenario: String,
    /// The folder for the numbers, a plot of each perturbation, and a picture of where in the frames its level matters
    #[arg(short, long = "out", alias = "output", value_name = "DIR", default_value = "sensitivity")]
    output: PathBuf,
    /// Also search for the least change of the levels over time with which the drive leaves its lane, and write it as a pipeline
    #[arg(long)]
    least: bool,
    #[command(flatten)]
    workers: Workers,
    /// Load the libraries and scripts and start the programs that the record names, although they are not installed. Without it
    /// they are listed, and nothing of the record is run
    #[arg(long)]
    trust: bool,
}

/// The least change, and the drive that proves it.
struct Proof {
    scenario: Scenario,
    outcome: Outcome,
    path: PathBuf,
}

/// Differentiates the drive, and writes what was found.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let Arguments { record, scenario, output, .. } = arguments;
    let limits = arguments.workers.limits()?;
    let replay = Replay::open(record, std::slice::from_ref(scenario))?;
    let driving = Driving {
        verb: "sensitivity",
        record,
        pool: arguments.workers.pool(),
        limits,
        trust: arguments.trust,
    };
    let (mut session, search) = recorded::session(global, &replay, driving)?;
    for change in replay.changes(&mut session)? {
        eprintln!("pdk: warning: since the run was recorded, {change}, so it may come out differently");
    }
    let Some(line) = replay.lines().next() else {
        return Err(Error::new("there is no scenario to differentiate"));
    };
    std::fs::create_dir_all(output).place(output.display())?;
    let registry = Registry::discover(&search, Box::new(LuaScripts::new(&search)))?;
    let progress = pdk_terminal::progress(global.json, "{msg} {pos} frames {elapsed}");
    let digest = &line.outcome.digest;
    let analysis = Analysis::new(&registry, &line.scenario, digest, arguments.least, &mut |doing| {
        progress.set_message(doing);
        progress.inc(1);
    })
    .map_err(|error| error.at(format_args!("scenario {}", line.id)))?;
    let change = analysis.least.as_ref().and_then(|found| found.change.as_ref());
    let proof = match change {
        None => None,
        Some(change) => {
            let scenario = analysis.with_courses(&line.scenario, &change.courses);
            let outcome = drives::outcomes(&mut session, vec![scenario.clone()], &progress)?.remove(0);
            let path = output.join(LEAST);
            let text = script(&scenario, &outcome, "The least change of its levels that was found", LEAST)?;
            pdk_sdk::file::write(&path, text.as_bytes()).place(path.display())?;
            Some(Proof { scenario, outcome, path })
        }
    };
    progress.finish_and_clear();
    let names = names(&line.scenario);
    write_numbers(&output.join("sensitivity.csv"), &analysis, &names)?;
    let pictures = write_pictures(output, &analysis, &names)?;
    if global.json {
        return print_json(&as_json(&analysis, &names, proof.as_ref(), &pictures));
    }
    print(&analysis, &names, proof.as_ref());
    println!("Numbers and pictures: {}", output.display());
    Ok(())
}

/// The names of the perturbations, with a number behind those that are there several times.
fn names(scenario: &Scenario) -> Vec<String> {
    let all: Vec<&str> = scenario.perturbations.iter().map(|applied| applied.name.as_str()).collect();
    let name = |(place, name): (usize, &&str)| {
        let before = all[..place].iter().filter(|other| other == &name).count();
        match before {
            0 => (*name).to_owned(),
            _ => format!("{name}-{}", before + 1),
        }
    };
    all.iter().enumerate().map(name).collect()
}

/// Writes a table with a line for each frame.
fn write_numbers(path: &Path, analysis: &Analysis, names: &[String]) -> Result<()> {
    let Analysis { driven, rate, sensitivity, .. } = analysis;
    let mut text = String::from("frame,time_s,cross_track_error_m");
    for name in names {
        text += &format!(",{name}_level,{name}_m_per_level");
    }
    text.push('\n');
    for (frame, place) in driven.places.iter().enumerate() {
        text += &format!("{frame},{},{}", frame as f64 / rate, place.state.cross_track_error);
        for (course, influence) in sensitivity.courses.iter().zip(&sensitivity.influence) {
            let by = influence.get(frame).copied().unwrap_or_default();
            text += &format!(",{},{by}", course.levels()[frame]);
        }
        text.push('\n');
    }
    pdk_sdk::file::write(path, text.as_bytes()).place(path.display())
}

/// Writes the pictures, and returns their names.
fn write_pictures(folder: &Path, analysis: &Analysis, names: &[String]) -> Result<Vec<PathBuf>> {
    let Analysis { driven, rate, sensitivity, perturbations, least } = analysis;
    let change = least.as_ref().and_then(|found| found.change.as_ref());
    let mut written = Vec::new();
    for (place, (name, known)) in names.iter().zip(perturbations).enumerate() {
        let changed = change.map(|change| &change.courses[place]);
        let svg = plot::over_time(driven, sensitivity, place, *rate, changed)?;
        let path = folder.join(format!("{name}.svg"));
        pdk_sdk::file::write(&path, svg.as_bytes()).place(path.display())?;
        written.push(path);
        let (Ok(regions), Some(span), Some(frame)) = (&sensitivity.regions, &known.decides, &known.frame)
        else {
            continue;
        };
        let cells = regions[place].over(span.clone());
        // What acts on no pixels has no place in the frames.
        if cells.iter().all(|cell| *cell == 0.0) {
            continue;
        }
        let path = folder.join(format!("{name}.png"));
        let picture = to_frame(plot::in_frame(frame, &cells))?;
        pdk_image::write(&path, picture.as_ref())?;
        written.push(path);
    }
    Ok(written)
}

fn print(analysis: &Analysis, names: &[String], proof: Option<&Proof>) {
    let Analysis { rate, sensitivity, perturbations, least, .. } = analysis;
    let seconds = |frame: usize| format!("{:.2} s", frame as f64 / rate);
    let side = if sensitivity.side > 0.0 { "right" } else { "left" };
    println!(
        "The largest cross-track error is {:.2} m to the {side}, at {}.",
        sensitivity.error,
        seconds(sensitivity.worst)
    );
    for (place, (name, known)) in names.iter().zip(perturbations).enumerate() {
        println!("{name}: {}", sentence(analysis, place, known, &seconds));
        let mut table = table(["level changed from", "m a level, by the derivative", "by drives", ""]);
        for window in &known.windows {
            table.add_row([
                seconds(window.from),
                format!("{:+.3}", window.predicted),
                format!("{:+.3}", window.driven),
                if window.agrees() { "" } else { "differs" }.to_owned(),
            ]);
        }
        println!("{table}");
    }
    if let Err(reason) = &sensitivity.regions {
        println!("Where in the frames it comes from is not known: {reason}.");
    }
    let Some(found) = least else { return };
    match proof {
        None => println!("No step by the derivative made the drive leave its lane."),
        Some(proof) => {
            let size = found.change.as_ref().map_or(0.0, |change| change.size);
            println!(
                "Least change: {size:.2} levels (root of the mean square over time); the drive ends with {} at {:.2} s. Found with {} drives and {} \
                 sweeps: {}",
                proof.outcome.cause.text(),
                proof.outcome.time,
                found.drives,
                found.sweeps,
                proof.path.display()
            );
        }
    }
    match found.alike {
        Some(by) => println!("Raised alike at all times, the levels have to be {by:.2} higher for that."),
        None => println!("Raised alike at all times, even the highest levels leave it in its lane."),
    }
}

/// What a level decides, in words.
fn sentence(
    analysis: &Analysis,
    place: usize,
    known: &OfPerturbation,
    seconds: &dyn Fn(usize) -> String,
) -> String {
    let OfPerturbation { holds, decides, .. } = known;
    if holds.is_empty() {
        return "the derivative does not hold here: drives with other levels come out otherwise than it says"
            .to_owned();
    }
    let Some(span) = decides else {
        return "its level has no influence on the largest error".to_owned();
    };
    let by: f64 = analysis.sensitivity.influence[place][span.clone()].iter().sum();
    let more = if by >= 0.0 { "larger" } else { "smaller" };
    let reach = match holds.start {
        0 => "it holds for the whole drive".to_owned(),
        start => format!("it holds from {} on", seconds(start)),
    };
    format!(
        "{:.0} % of its influence lies from {} to {}, where one level more makes the error {:.2} m {more}; {reach}.",
        100.0 * SHARE,
        seconds(span.start),
        seconds(span.end),
        by.abs()
    )
}

fn as_json(analysis: &Analysis, names: &[String], proof: Option<&Proof>, pictures: &[PathBuf]) -> Value {
    let Analysis { rate, sensitivity, perturbations, least, .. } = analysis;
    let time = |frame: usize| frame as f64 / rate;
    let span = |frames: &Range<usize>| json!([time(frames.start), time(frames.end)]);
    let one = |(place, (name, known)): (usize, (&String, &OfPerturbation))| {
        let windows: Vec<Value> = known
            .windows
            .iter()
            .map(|window| {
                json!({
                    "from": time(window.from), "derivative": window.predicted, "drives": window.driven, "agrees": window.agrees()
                })
            })
            .collect();
        json!({
            "name": name,
            "holds": span(&known.holds),
            "decides": known.decides.as_ref().map(span),
            "windows": windows,
            "influence": sensitivity.influence[place],
        })
    };
    json!({
        "largest_error": sensitivity.error,
        "time": time(sensitivity.worst),
        "side": sensitivity.side,
        "rate": rate,
        "perturbations": names.iter().zip(perturbations).enumerate().map(one).collect::<Vec<_>>(),
        "files": pictures,
        "least": least.as_ref().map(|found| json!({
            "size": found.change.as_ref().map(|change| change.size),
            "alike": found.alike,
            "drives": found.drives,
            "sweeps": found.sweeps,
            "scenario": proof.map(|proof| &proof.scenario),
            "outcome": proof.map(|proof| &proof.outcome),
            "pipeline": proof.map(|proof| &proof.path),
        })),
    })
}
