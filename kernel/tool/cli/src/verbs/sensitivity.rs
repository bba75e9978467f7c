//! `pdk sensitivity`: how the largest error of a drive changes with the level at each frame.

use std::ops::Range;
use std::path::{Path, PathBuf};

use indicatif::ProgressBar;
use pdk_components::registry::Registry;
use pdk_components::search_path::SearchPath;
use pdk_lua::LuaScripts;
use pdk_model::outcome::{Cause, Outcome};
use pdk_model::scenario::Scenario;
use pdk_notice::println;
use pdk_preview::picture::to_frame;
use pdk_record::ledger::Line;
use pdk_replay::drives;
use pdk_replay::shrink::script;
use pdk_sdk::error::{Error, Place, Result};
use pdk_sensitivity::analysis::{self, Analysis, OfPerturbation, SHARE};
use pdk_sensitivity::bends::{Bend, TURN, Turned, bends};
use pdk_sensitivity::course::{Course, STEP, on_courses};
use pdk_sensitivity::least::{self, Found, check_stayed};
use pdk_sensitivity::plot;
use pdk_sensitivity::rehearsal::{Driven, Rehearsal};
use pdk_session::connection::Pool;
use pdk_session::session::Session;
use pdk_supervise::supervisor::{DEFAULT_PATIENCE, Limits};
use pdk_terminal::table::table;
use serde_json::{Value, json};

use super::recorded::{self, Chosen, Driving};
use super::{Global, numbered, print_json};
use crate::supervised::Memory;

/// The pipeline with the smallest change.
const LEAST: &str = "least.lua";

/// Arguments of `pdk sensitivity`
#[derive(clap::Args)]
pub struct Arguments {
    #[command(flatten)]
    chosen: Chosen,
    /// The folder for the numbers, a plot of each perturbation, and a picture of where in the frames its level matters [default: sensitivity-N]
    #[arg(short, long = "out", alias = "output", value_name = "DIR")]
    output: Option<PathBuf>,
    /// Also search for the smallest change of the levels over time with which the drive leaves its lane, and write it as a pipeline. Takes about
    /// as long as thirty drives
    #[arg(long)]
    least: bool,
    /// Also drive with each angle of the road a degree further to the left and to the right, if the road is given by angles. Takes as long as two drives for
    /// each node
    #[arg(long)]
    road: bool,
    /// Load the libraries and scripts and start the programs that the record names, although they are not installed. Without it
    /// they are listed, and nothing of the record is run
    #[arg(long)]
    trust: bool,
    #[command(flatten)]
    pub memory: Memory,
}

/// The smallest change that was searched for.
struct Least {
    found: Found,
    /// The drive that proves it, and the pipeline that repeats that; none if there is no change.
    proof: Option<(Scenario, Outcome, PathBuf)>,
}

/// Differentiates the drive, and writes what was found.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    arguments.output.as_deref().map_or(Ok(()), super::check_folder)?;
    let Chosen { record, scenario } = &arguments.chosen;
    let limits = Limits { patience: DEFAULT_PATIENCE, memory: arguments.memory.of_worker() };
    let driving =
        Driving { verb: "sensitivity", record, pool: Pool::Here(1), limits, trust: arguments.trust };
    let (replay, mut session, search) = recorded::open(global, scenario, driving, "come out differently")?;
    let Some(line) = replay.lines().next() else {
        return Err(Error::new("there is no scenario to differentiate"));
    };
    let registry = Registry::discover(&search, Box::new(LuaScripts::new(&search)))?;
    let progress = pdk_terminal::progress(global.json, "{msg} {pos} frames {elapsed}");
    let place = |error: Error| error.at(format_args!("scenario {scenario}"));
    let mut count = |doing: &'static str| {
        progress.set_message(doing);
        progress.inc(1);
    };
    let mut rehearsal = Rehearsal::new(&registry, &line.scenario).map_err(place)?;
    let driven = analysis::driven(&mut rehearsal, &line.outcome.digest, &mut count).map_err(place)?;
    if arguments.least {
        check_stayed(&driven).map_err(place)?;
    }
    let found = Analysis::new(&mut rehearsal, driven, &mut count).map_err(place)?;
    let bends = match arguments.road {
        true => {
            Some(bends(&mut rehearsal, &found.driven, &mut || count("changing the road")).map_err(place)?)
        }
        false => None,
    };
    let output = arguments.output.clone().unwrap_or_else(|| format!("sensitivity-{scenario}").into());
    std::fs::create_dir_all(&output)
        .place(format_args!("cannot make the folder {}; choose another with -o", output.display()))?;
    let names = names(&line.scenario);
    write_numbers(&output.join("sensitivity.csv"), &found, &names)?;
    let mut files = write_pictures(&output, &found, &names)?;
    let mut least = None;
    if arguments.least {
        let Analysis { driven, sensitivity, .. } = &found;
        let searched = least::least(&mut rehearsal, driven, sensitivity, &mut || count("searching"));
        let searched = searched.map_err(place)?;
        let proof = prove(&mut session, &line.scenario, &searched, &output, &progress)?;
        let change = searched.change.as_ref();
        files.extend(write_plots(&output, &found, &names, change.map(|change| change.courses.as_slice()))?);
        least = Some(Least { found: searched, proof });
    } else {
        files.extend(write_plots(&output, &found, &names, None)?);
    }
    progress.finish_and_clear();
    if global.json {
        return print_json(&as_json(&found, &names, bends.as_deref(), least.as_ref(), &files));
    }
    print(&found, &names, bends.as_deref(), least.as_ref());
    println!("Numbers and pictures: {}", output.display());
    Ok(())
}

/// What is known of a recorded drive by its derivative, a sentence for each perturbation; or why that is not known.
pub(super) fn sentences(search: &SearchPath, line: &Line, progress: &ProgressBar) -> Result<Vec<String>> {
    let registry = Registry::discover(search, Box::new(LuaScripts::new(search)))?;
    let mut rehearsal = Rehearsal::new(&registry, &line.scenario)?;
    let mut count = |doing| progress.set_message(doing);
    let driven = analysis::driven(&mut rehearsal, &line.outcome.digest, &mut count)?;
    let found = Analysis::new(&mut rehearsal, driven, &mut count)?;
    let names = names(&line.scenario);
    Ok(names
        .iter()
        .enumerate()
        .map(|(number, name)| format!("{name}: {}", sentence(&found, number)))
        .collect())
}

/// Has a worker drive the smallest change, and writes it as a pipeline.
fn prove(
    session: &mut Session,
    scenario: &Scenario,
    found: &Found,
    folder: &Path,
    progress: &ProgressBar,
) -> Result<Option<(Scenario, Outcome, PathBuf)>> {
    let Some(change) = &found.change else { return Ok(None) };
    let perturbations = on_courses(&scenario.perturbations, &change.courses);
    let scenario = Scenario { perturbations, ..scenario.clone() };
    let outcome = drives::outcomes(session, vec![scenario.clone()], progress)?.remove(0);
    if outcome.cause != Cause::LaneDeparture {
        return Err(Error::new(format!(
            "the change with which the drive left its lane ended with {} when a worker drove it, so it proves nothing; `pdk replay` says what is different",
            outcome.cause.text()
        )));
    }
    let path = folder.join(LEAST);
    let text = script(&scenario, &outcome, "The smallest change of its levels that was found", LEAST)?;
    pdk_sdk::file::write(&path, text.as_bytes()).place(path.display())?;
    Ok(Some((scenario, outcome, path)))
}

/// The names of the perturbations, with a number behind those that are there several times.
fn names(scenario: &Scenario) -> Vec<String> {
    let all: Vec<&str> = scenario.perturbations.iter().map(|applied| applied.name.as_str()).collect();
    let name = |(place, name): (usize, &&str)| {
        numbered(name, all[..place].iter().filter(|other| other == &name).count())
    };
    all.iter().enumerate().map(name).collect()
}

/// Writes a table with a line for each frame.
fn write_numbers(path: &Path, found: &Analysis, names: &[String]) -> Result<()> {
    let Analysis { driven, rate, sensitivity, .. } = found;
    let mut writer = csv::Writer::from_writer(Vec::new());
    let columns = names.iter().flat_map(|name| [format!("{name}_level"), format!("{name}_m_per_level")]);
    let fixed = ["frame", "time_s", "cross_track_error_m"].map(str::to_owned);
    writer.write_record(fixed.into_iter().chain(columns)).map_err(std::io::Error::from)?;
    for (frame, place) in driven.places.iter().enumerate() {
        let levels =
            sensitivity.courses.iter().zip(&sensitivity.influence).flat_map(|(course, influence)| {
                [course.levels()[frame], influence.get(frame).copied().unwrap_or_default()]
            });
        let numbers = [frame as f64 / rate, place.state.cross_track_error].into_iter().chain(levels);
        let numbers = numbers.map(|number| number.to_string());
        let row = std::iter::once(frame.to_string()).chain(numbers);
        writer.write_record(row).map_err(std::io::Error::from)?;
    }
    let bytes = writer.into_inner().map_err(|error| error.into_error()).place("cannot write CSV")?;
    pdk_sdk::file::write(path, &bytes).place(path.display())
}

/// Writes a plot of each perturbation over time, and returns their names.
fn write_plots(
    folder: &Path,
    found: &Analysis,
    names: &[String],
    changed: Option<&[Course]>,
) -> Result<Vec<PathBuf>> {
    let Analysis { driven, rate, sensitivity, .. } = found;
    let mut written = Vec::new();
    for (number, name) in names.iter().enumerate() {
        let changed = changed.map(|courses| &courses[number]);
        let svg = plot::over_time(driven, sensitivity, number, *rate, changed)?;
        let path = folder.join(format!("{name}.svg"));
        pdk_sdk::file::write(&path, svg.as_bytes()).place(path.display())?;
        written.push(path);
    }
    Ok(written)
}

/// Writes pictures of where in the frames the levels matter, and returns their names.
fn write_pictures(folder: &Path, found: &Analysis, names: &[String]) -> Result<Vec<PathBuf>> {
    let mut written = Vec::new();
    for (number, name) in names.iter().enumerate() {
        let (Some(cells), Some(frame)) = (found.cells(number), &found.perturbations[number].frame) else {
            continue;
        };
        let path = folder.join(format!("{name}.png"));
        let picture = to_frame(plot::in_frame(frame, &cells))?;
        pdk_image::write(&path, picture.as_ref())?;
        written.push(path);
    }
    Ok(written)
}

fn print(found: &Analysis, names: &[String], bends: Option<&[Bend]>, least: Option<&Least>) {
    let Analysis { driven, rate, sensitivity, perturbations } = found;
    let seconds = |frame| seconds(*rate, frame);
    let side = if sensitivity.side > 0.0 { "right" } else { "left" };
    println!(
        "The drive ended with {}. Its largest cross-track error is {:.2} m to the {side}, at {}.",
        driven.cause.text(),
        sensitivity.error,
        seconds(sensitivity.worst)
    );
    for (number, (name, known)) in names.iter().zip(perturbations).enumerate() {
        println!("{name}: {}", sentence(found, number));
        let mut table = table(["level changed from", "m per level (derivative)", "by drives", ""]);
        for window in &known.windows {
            table.add_row([
                seconds(window.from),
                format!("{:+.4}", window.predicted),
                format!("{:+.4}", window.driven),
                if window.agrees() { "" } else { "disagrees" }.to_owned(),
            ]);
        }
        println!("{table}");
        if sensitivity.regions.is_ok() && known.decides.is_some() && found.cells(number).is_none() {
            println!(
                "No picture shows where in the frames that comes from: cells of the frame do not add up to it, as it also comes through the throttle \
                 or the control."
            );
        }
    }
    if let Err(reason) = &sensitivity.regions {
        println!("Where in the frames it comes from is not known: {reason}.");
    }
    if let Some(bends) = bends {
        print_bends(driven, bends);
    }
    let Some(Least { found, proof }) = least else { return };
    match (&found.change, proof) {
        (Some(change), Some((_, outcome, path))) => println!(
            "Smallest change found: {:.2} levels (root of the mean square up to the departure), with which the vehicle leaves its lane at {:.2} s: {}",
            change.size,
            outcome.time,
            path.display()
        ),
        _ => println!("No step by the derivative made the vehicle leave its lane."),
    }
    match found.uniform {
        Some(by) => println!("A uniform increase of {by:.2} levels makes it leave its lane as well."),
        None => println!("It stays in its lane with every uniform increase, tried in quarters of a level."),
    }
    println!("The search took {} drives and {} derivatives.", found.drives, found.sweeps);
}

/// What becomes of the drive with one angle of the road changed.
fn print_bends(driven: &Driven, bends: &[Bend]) {
    if bends.is_empty() {
        println!("The road is not given by angles, so none of them is changed.");
        return;
    }
    println!(
        "The largest cross-track error with one angle of the road changed by {TURN} degree; as driven: {}",
        ended(&Turned::of(driven))
    );
    let sides = ["left", "right"].map(|side| format!("{TURN} degree further {side}"));
    let mut table = table(["node", "degrees", &sides[0], &sides[1]]);
    for bend in bends {
        let [left, right] = bend.turned.each_ref().map(|turned| match turned {
            Ok(turned) => ended(turned),
            Err(_) => "refused".to_owned(),
        });
        table.add_row([bend.node.to_string(), format!("{:.1}", bend.degrees), left, right]);
    }
    println!("{table}");
    if let Some(error) = bends.iter().flat_map(|bend| &bend.turned).find_map(|turned| turned.as_ref().err()) {
        println!("Refused by the simulator: {error}");
    }
}

/// The largest error of a drive, or how it failed.
fn ended(turned: &Turned) -> String {
    match turned.cause {
        Cause::Finished | Cause::TimeOut => format!("{:.2} m", turned.error),
        cause => format!("{} at {:.2} s", cause.text(), turned.time),
    }
}

/// The time of a frame.
fn seconds(rate: f64, frame: usize) -> String {
    format!("{:.2} s", frame as f64 / rate)
}

/// What a level decides, in words.
fn sentence(found: &Analysis, number: usize) -> String {
    let OfPerturbation { holds, decides, .. } = &found.perturbations[number];
    let seconds = |frame| seconds(found.rate, frame);
    if holds.is_empty() {
        return "the derivative is not reliable here: drives at slightly different levels disagree with it"
            .to_owned();
    }
    let reach = match holds.start {
        0 => "back to the start".to_owned(),
        start => format!("back to {}", seconds(start)),
    };
    let Some(span) = decides else {
        return format!(
            "a little more or less of it does not change the largest error; derivative and drives agree {reach}."
        );
    };
    let by: f64 = found.sensitivity.influence[number][span.clone()].iter().sum();
    let more = if by >= 0.0 { "larger" } else { "smaller" };
    let since = match holds.start {
        0 => String::new(),
        start => format!(" since {}", seconds(start)),
    };
    format!(
        "{:.0} % of its influence{since} lies from {} to {}, where {STEP} levels more make the error {:.3} m {more}. Derivative and drives agree {reach}.",
        100.0 * SHARE,
        seconds(span.start),
        seconds(span.end),
        STEP * by.abs()
    )
}

fn as_json(
    found: &Analysis,
    names: &[String],
    bends: Option<&[Bend]>,
    least: Option<&Least>,
    files: &[PathBuf],
) -> Value {
    let Analysis { driven, rate, sensitivity, perturbations } = found;
    let time = |frame: usize| frame as f64 / rate;
    let span = |frames: &Range<usize>| json!([time(frames.start), time(frames.end)]);
    let one = |(number, (name, known)): (usize, (&String, &OfPerturbation))| {
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
            "influence": sensitivity.influence[number],
        })
    };
    json!({
        "cause": driven.cause,
        "largest_error": sensitivity.error,
        "time": time(sensitivity.worst),
        "side": sensitivity.side,
        "rate": rate,
        "perturbations": names.iter().zip(perturbations).enumerate().map(one).collect::<Vec<_>>(),
        "bends": bends.map(|bends| bends.iter().map(|bend| {
            let [left, right] = bend.turned.each_ref().map(|turned| match turned {
                Ok(Turned { cause, time, error }) => json!({ "cause": cause, "time": time, "largest_error": error }),
                Err(error) => json!({ "refused": error.to_string() }),
            });
            json!({ "node": bend.node, "degrees": bend.degrees, "left": left, "right": right })
        }).collect::<Vec<_>>()),
        "files": files,
        "least": least.map(|Least { found, proof }| json!({
            "size": found.change.as_ref().map(|change| change.size),
            "uniform": found.uniform,
            "drives": found.drives,
            "derivatives": found.sweeps,
            "scenario": proof.as_ref().map(|(scenario, ..)| scenario),
            "outcome": proof.as_ref().map(|(_, outcome, _)| outcome),
            "pipeline": proof.as_ref().map(|(.., path)| path),
        })),
    })
}
