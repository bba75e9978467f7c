//! `pdk attack drives`: trains the picture that recorded drives show, by the derivative of the drives.

use std::path::{Path, PathBuf};
use std::sync::Mutex;

use pdk_components::catalog::Catalog;
use pdk_components::registry::Registry;
use pdk_lua::LuaScripts;
use pdk_model::outcome::Outcome;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_model::scenario::Scenario;
use pdk_notice::{eprintln, println};
use pdk_record::ledger::Line;
use pdk_replay::drives;
use pdk_replay::replay::Replay;
use pdk_sdk::describe::{Kind, Role};
use pdk_sdk::error::{Error, Place, Result};
use pdk_sdk::prelude::FrameBuf;
use pdk_sensitivity::momentum::Momentum;
use pdk_sensitivity::picture::{left_to, mean_error, slopes};
use pdk_sensitivity::rehearsal::{Driven, Rehearsal};
use pdk_session::connection::Pool;
use pdk_supervise::supervisor::{DEFAULT_PATIENCE, Limits};
use pdk_terminal::table::table;
use serde_json::json;
use tempfile::NamedTempFile;

use super::Goal;
use crate::supervised::Memory;
use crate::verbs::recorded::{self, Driving};
use crate::verbs::{Global, print_json};

/// The first step, in grey levels; later ones are shorter, down to none.
const STEP: f32 = 25.0;

/// Arguments of `pdk attack drives`
#[derive(clap::Args)]
#[command(after_help = AFTER)]
pub struct Arguments {
    /// The folder of the record
    #[arg(value_name = "RUN")]
    record: PathBuf,
    /// A scenario, by its number, its id or the beginning of that; may be given several times [default: all]
    #[arg(long = "scenario", value_name = "N|ID")]
    scenarios: Vec<String>,
    /// The picture to write
    #[arg(short, long = "out", alias = "output", value_name = "FILE.png")]
    output: PathBuf,
    /// To which side the vehicle is to leave its lane
    #[arg(long, default_value = "left")]
    goal: Goal,
    /// How often the picture is changed at most
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    steps: u32,
    /// Load the libraries and scripts and start the programs that the record names, although they are not installed. Without it
    /// they are listed, and nothing of the record is run
    #[arg(long)]
    trust: bool,
    #[command(flatten)]
    pub memory: Memory,
}

const AFTER: &str = "The last perturbation of frames in each drive has to show the same picture, such as a patch on the road. The training begins with that picture. A step takes about \
fifteen times as long as driving all of the drives. Each picture that moves the vehicle further than those before is written. At the end a worker drives with the best one.";

/// A drive that shows the picture.
struct Drive<'a> {
    line: &'a Line,
    shown: ShownPicture,
    rehearsal: Rehearsal<'a>,
}

/// Where a scenario shows a picture.
struct ShownPicture {
    /// The place of the perturbation that shows it.
    place: usize,
    /// The perturbation's parameter.
    parameter: String,
    /// The file.
    path: PathBuf,
}

/// What came of all drives with a picture.
struct Came {
    /// How many changes the picture has seen.
    steps: u32,
    /// For each drive its digest, its mean error to the side of the goal in metres, and whether it left its lane there.
    drives: Vec<(String, f64, bool)>,
}

impl Came {
    fn of(steps: u32, driven: &[Driven], side: f64) -> Self {
        let one = |driven: &Driven| (driven.digest.clone(), mean_error(driven, side), left_to(driven, side));
        Self { steps, drives: driven.iter().map(one).collect() }
    }

    /// How many left their lane.
    fn left(&self) -> usize {
        self.drives.iter().filter(|(.., left)| *left).count()
    }

    /// Whether the vehicle got further to the side than with another picture.
    fn is_better_than(&self, other: &Self) -> bool {
        let mean = |came: &Self| came.drives.iter().map(|(_, error, _)| error).sum::<f64>();
        (self.left(), mean(self)) > (other.left(), mean(other))
    }
}

/// Trains the picture, writes it, and shows what becomes of the drives.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let Arguments { record, scenarios, output, goal, trust, .. } = arguments;
    let limits = Limits { patience: DEFAULT_PATIENCE, memory: arguments.memory.of_worker() };
    let replay = Replay::open(record, scenarios)?;
    check_output(&replay, output)?;
    let driving = Driving { verb: "attack", record, pool: Pool::Here(1), limits, trust: *trust };
    let (mut session, search) = recorded::session(global, &replay, driving)?;
    for change in replay.changes(&mut session)? {
        eprintln!("pdk: warning: since the run was recorded, {change}, so it may come out differently");
    }
    let registry = Registry::discover(&search, Box::new(LuaScripts::new(&search)))?;
    let drive = |line| Drive::new(&registry, line).map_err(|error| of_scenario(line, error));
    let drives = replay.lines().map(drive).collect::<Result<Vec<_>>>()?;
    let path = same_picture(&drives)?.to_owned();
    let lines: Vec<&Line> = drives.iter().map(|drive| drive.line).collect();
    let places: Vec<_> =
        drives.iter().map(|drive| (drive.shown.place, drive.shown.parameter.clone())).collect();
    let progress = pdk_terminal::progress(global.json, "{pos}/{len} steps {msg} {elapsed}");
    progress.set_length(arguments.steps.into());
    let [before, best] = train(drives, &pdk_image::read(&path)?, arguments, &mut |came: &Came| {
        progress.set_position(came.steps.into());
        let error = came.drives.iter().map(|(_, error, _)| error).sum::<f64>() / came.drives.len() as f64;
        progress.set_message(format!("mean error to the {} {error:+.2} m", goal.text()));
    })?;
    progress.finish_and_clear();
    let written = std::path::absolute(output).place(output.display())?;
    let with_it = lines.iter().zip(&places).map(|(line, (place, parameter))| {
        let perturbations = with(&line.scenario.perturbations, *place, parameter, &written);
        Scenario { perturbations, files: Default::default(), ..line.scenario.clone() }
    });
    let after = drives::outcomes(&mut session, with_it.collect(), &progress)?;
    for ((line, outcome), (digest, ..)) in lines.iter().zip(&after).zip(&best.drives) {
        if outcome.digest != *digest {
            let sentence = "it came out differently when a worker drove it, so the picture proves nothing; `pdk replay` says what is different";
            return Err(of_scenario(line, Error::new(sentence)));
        }
    }
    show(global, arguments, &lines, &after, [&before, &best])
}

/// Trains the picture and writes it whenever it is better. What came of the drives before, and with the best picture.
fn train(
    drives: Vec<Drive<'_>>,
    picture: &FrameBuf,
    arguments: &Arguments,
    tick: &mut dyn FnMut(&Came),
) -> Result<[Came; 2]> {
    let Arguments { output, goal, steps, .. } = arguments;
    let side = goal.side();
    let mut values: Vec<f32> = picture.data().iter().map(|byte| f32::from(*byte)).collect();
    let mut momentum = Momentum::new(values.len());
    let file = NamedTempFile::with_suffix(".png").place("cannot make a file for the picture in training")?;
    let drives: Vec<Mutex<Drive<'_>>> = drives.into_iter().map(Mutex::new).collect();
    let (mut first, mut best): (Option<Came>, Option<Came>) = (None, None);
    for step in 0..=*steps {
        let bytes = values.iter().map(|value| value.round_ties_even() as u8).collect();
        let current = FrameBuf::from_vec(bytes, picture.width(), picture.height()).map_err(Error::new)?;
        // The first drives are those of the record, with the picture of the record.
        let shown = if step == 0 { None } else { Some(file.path()) };
        if let Some(path) = shown {
            pdk_image::write(path, current.as_ref())?;
        }
        // No step follows the last drives, so their derivative is not needed.
        let of_values = if step < *steps { values.len() } else { 0 };
        let results = pdk_parallel::map(&drives, |drive| {
            let mut drive = drive.lock().unwrap_or_else(|poisoned| poisoned.into_inner());
            drive.drive_and_differentiate(shown, side, of_values)
        });
        let (driven, slopes): (Vec<Driven>, Vec<Vec<f64>>) =
            results.into_iter().collect::<Result<Vec<_>>>()?.into_iter().unzip();
        let came = Came::of(step, &driven, side);
        tick(&came);
        let all_left = came.left() == came.drives.len();
        let known = best.as_ref().or(first.as_ref());
        if known.is_some_and(|known| came.is_better_than(known)) {
            pdk_image::write(output, current.as_ref())?;
            best = Some(came);
        } else if first.is_none() {
            first = Some(came);
        }
        if all_left || step == *steps {
            break;
        }
        if step == 0 {
            check_influence(&drives, &driven, &slopes, side)?;
        }
        let mut sums = vec![0.0f32; values.len()];
        for slopes in &slopes {
            sums.iter_mut().zip(slopes).for_each(|(sum, slope)| *sum += *slope as f32);
        }
        if sums.iter().all(|slope| *slope == 0.0) {
            break;
        }
        momentum.step(&mut values, &sums, STEP * (1.0 - step as f32 / *steps as f32), [0.0, 255.0]);
    }
    match (first, best) {
        (Some(first), Some(best)) => Ok([first, best]),
        (Some(first), None) if first.left() == first.drives.len() => Err(Error::new(format!(
            "the vehicle leaves its lane on the {} in all of these drives already; name drives in which it does not",
            goal.text()
        ))),
        _ => Err(Error::new(format!(
            "no step moved the vehicle further to the {}; try the other --goal, more --steps, or a larger picture",
            goal.text()
        ))),
    }
}

/// Checks that the picture has an influence on each drive in which the vehicle has not left its lane.
fn check_influence(
    drives: &[Mutex<Drive<'_>>],
    driven: &[Driven],
    slopes: &[Vec<f64>],
    side: f64,
) -> Result<()> {
    for ((drive, driven), slopes) in drives.iter().zip(driven).zip(slopes) {
        if !left_to(driven, side) && slopes.iter().all(|slope| *slope == 0.0) {
            let line = drive.lock().unwrap_or_else(|poisoned| poisoned.into_inner()).line;
            let sentence = "the picture has no influence on this drive; name drives that show it, and in which no perturbation holds the steering";
            return Err(of_scenario(line, Error::new(sentence)));
        }
    }
    Ok(())
}

/// Checks that the picture may be written there before any drive.
fn check_output(replay: &Replay, output: &Path) -> Result<()> {
    let shown = output.display();
    if output.extension().is_none_or(|ending| !ending.eq_ignore_ascii_case("png")) {
        return Err(Error::new(format!(
            "the picture {shown} is not a PNG file; give a name that ends in .png"
        )));
    }
    if output.is_dir() {
        return Err(Error::new(format!("{shown} is a folder; name a file with -o")));
    }
    let Ok(place) = output.canonicalize() else { return Ok(()) };
    let named = replay.manifest().files.iter().map(|file| &file.path);
    match named.clone().any(|path| path.canonicalize().is_ok_and(|path| path == place)) {
        false => Ok(()),
        true => Err(Error::new(format!(
            "{shown} is a file that the record was made with, and would be replaced; name another file with -o"
        ))),
    }
}

/// The error with its scenario.
fn of_scenario(line: &Line, error: Error) -> Error {
    error.at(format_args!("scenario `{}`", line.name))
}

/// The file of the picture, which all drives show.
fn same_picture<'a>(drives: &'a [Drive<'_>]) -> Result<&'a Path> {
    let Some(first) = drives.first() else {
        return Err(Error::new("there is no scenario whose picture could be trained"));
    };
    match drives.iter().find(|other| other.shown.path != first.shown.path) {
        None => Ok(&first.shown.path),
        Some(other) => Err(Error::new(format!(
            "some of the drives show {} and others {}; name those of one picture with --scenario",
            first.shown.path.display(),
            other.shown.path.display()
        ))),
    }
}

impl<'a> Drive<'a> {
    fn new(registry: &'a Registry, line: &'a Line) -> Result<Self> {
        let shown = ShownPicture::of(registry.catalog(), &line.scenario)?;
        Ok(Self { line, shown, rehearsal: Rehearsal::new(registry, &line.scenario)? })
    }

    /// Drives with the picture in a file, or with that of the record, and says how the mean error to a side changes with each of its `count` values: not
    /// at all if the vehicle left its lane there. With a count of 0 it drives alone.
    fn drive_and_differentiate(
        &mut self,
        picture: Option<&Path>,
        side: f64,
        count: usize,
    ) -> Result<(Driven, Vec<f64>)> {
        let Self { line, shown, rehearsal } = self;
        let recorded = &line.scenario.perturbations;
        let perturbations = match picture {
            Some(path) => with(recorded, shown.place, &shown.parameter, path),
            None => recorded.clone(),
        };
        let nothing = &mut || {};
        let mut work = || -> Result<(Driven, Vec<f64>)> {
            let mut chain = rehearsal.chain(&perturbations)?;
            let driven = rehearsal.drive(&mut chain, nothing)?;
            if picture.is_none() {
                Rehearsal::check_same(&driven, &line.outcome.digest)?;
            }
            let slopes = match count == 0 || left_to(&driven, side) {
                true => vec![0.0; count],
                false => slopes(rehearsal, &perturbations, &driven, side, count, nothing)?,
            };
            Ok((driven, slopes))
        };
        work().map_err(|error| of_scenario(line, error))
    }
}

impl ShownPicture {
    /// The picture that a scenario shows.
    fn of(catalog: &Catalog, scenario: &Scenario) -> Result<Self> {
        let none = || {
            Error::new(
                "none of its perturbations shows a picture that can be trained; drive with one that does, such as a patch on the road",
            )
        };
        let mut of_frames = Vec::new();
        for (place, applied) in scenario.perturbations.iter().enumerate() {
            let description = &catalog.get(Kind::Perturbation, &applied.name)?.description;
            if description.acts_on.is_frame() {
                of_frames.push((place, applied, description.with_role(Role::Picture)));
            }
        }
        let Some((place, applied, parameter)) = of_frames.pop() else { return Err(none()) };
        let is_earlier = of_frames.iter().any(|(.., parameter)| parameter.is_some());
        let Some(parameter) = parameter else {
            return Err(match is_earlier {
                true => Error::new(format!(
                    "`{}` changes the frame after the picture is shown, and how the picture passes through that is not known; put it before the picture, or \
                     leave it out",
                    applied.name
                )),
                false => none(),
            });
        };
        if is_earlier {
            return Err(Error::new(
                "it shows two pictures, and one is trained at a time; drive with one of them",
            ));
        }
        let named = applied.parameters.get(&parameter.name).and_then(|value| value.as_str());
        match named.and_then(|name| Path::new(name).canonicalize().ok()).filter(|path| path.is_file()) {
            Some(path) => Ok(Self { place, parameter: parameter.name.clone(), path }),
            None => Err(Error::new(format!(
                "the picture `{}` is not a file; drive with one in a file, such as `pdk attack patch` writes",
                named.unwrap_or_default()
            ))),
        }
    }
}

/// The perturbations with the picture of one of them in another file.
fn with(
    perturbations: &[AppliedPerturbation],
    place: usize,
    parameter: &str,
    file: &Path,
) -> Vec<AppliedPerturbation> {
    let mut perturbations = perturbations.to_vec();
    perturbations[place].parameters.insert(parameter.to_owned(), json!(file));
    perturbations
}

/// Prints what became of the drives.
fn show(
    global: &Global,
    arguments: &Arguments,
    lines: &[&Line],
    after: &[Outcome],
    [before, best]: [&Came; 2],
) -> Result<()> {
    let Arguments { output, goal, .. } = arguments;
    let count = lines.len();
    let drives = lines.iter().zip(after).zip(before.drives.iter().zip(&best.drives));
    if global.json {
        let drives = drives.map(|((line, after), ((_, error, left), (_, error_after, left_after)))| {
            let one = |outcome, error, left| json!({ "outcome": outcome, "mean_error_to_goal": error, "left_to_goal": left });
            json!({
                "scenario": line.id,
                "name": line.name,
                "before": one(&line.outcome, error, left),
                "after": one(after, error_after, left_after),
            })
        });
        return print_json(&json!({
            "file": output,
            "goal": goal.text(),
            "steps": best.steps,
            "drives": drives.collect::<Vec<_>>(),
        }));
    }
    let error = format!("mean error to the {}", goal.text());
    let mut rows = table(["scenario", "before", &error, "with the new picture", &error]);
    for ((line, after), ((_, error, _), (_, error_after, _))) in drives {
        rows.add_row([
            line.name.clone(),
            line.outcome.cause.text().to_owned(),
            format!("{error:+.2} m"),
            after.cause.text().to_owned(),
            format!("{error_after:+.2} m"),
        ]);
    }
    println!(
        "{rows}\nThe vehicle left its lane on the {} in {} of {count} drives before, and in {} with the picture after {} {}. Wrote {}",
        goal.text(),
        before.left(),
        best.left(),
        best.steps,
        if best.steps == 1 { "change" } else { "changes" },
        output.display()
    );
    Ok(())
}
