//! `pdk attack drives`: trains the picture that recorded drives show, by the derivative of the drives.

use std::path::{Path, PathBuf};

use pdk_components::catalog::Catalog;
use pdk_components::registry::Registry;
use pdk_lua::LuaScripts;
use pdk_model::outcome::{Cause, Outcome};
use pdk_model::scenario::Scenario;
use pdk_notice::{eprintln, println};
use pdk_record::ledger::Line;
use pdk_replay::drives;
use pdk_replay::replay::Replay;
use pdk_sdk::describe::{Kind, Role};
use pdk_sdk::error::{Error, Place, Result};
use pdk_sensitivity::picture::Training;
use pdk_sensitivity::rehearsal::Rehearsal;
use pdk_session::connection::Pool;
use pdk_supervise::supervisor::{DEFAULT_MEMORY, DEFAULT_PATIENCE, Limits};
use pdk_terminal::table::table;
use serde_json::json;

use super::Goal;
use crate::verbs::perturb::check_output;
use crate::verbs::recorded::{self, Driving};
use crate::verbs::{Global, print_json};

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
    /// How often the picture is changed at most; the drives take turns
    #[arg(long, default_value_t = 40, value_parser = clap::value_parser!(u32).range(1..=100_000))]
    steps: u32,
    /// Load the libraries and scripts and start the programs that the record names, although they are not installed. Without it
    /// they are listed, and nothing of the record is run
    #[arg(long)]
    trust: bool,
}

const AFTER: &str = "The drives have to show the same picture by their last perturbation, such as a patch on the road. It is where the training begins. A step takes as long as about \
fifteen drives. Afterwards a worker drives all of them with the new picture, and the table says what became of them.";

/// The picture that a drive shows.
struct Shown {
    /// The place of the perturbation that shows it.
    place: usize,
    /// The perturbation's parameter.
    parameter: String,
    /// The file.
    path: PathBuf,
}

/// Trains the picture, writes it, and shows what becomes of the drives.
pub fn run(global: &Global, arguments: &Arguments) -> Result<()> {
    let Arguments { record, scenarios, output, goal, steps, trust } = arguments;
    let limits = Limits { patience: DEFAULT_PATIENCE, memory: DEFAULT_MEMORY };
    let replay = Replay::open(record, scenarios)?;
    let driving = Driving { verb: "attack", record, pool: Pool::Here(1), limits, trust: *trust };
    let (mut session, search) = recorded::session(global, &replay, driving)?;
    for change in replay.changes(&mut session)? {
        eprintln!("pdk: warning: since the run was recorded, {change}, so it may come out differently");
    }
    let lines: Vec<&Line> = replay.lines().collect();
    let registry = Registry::discover(&search, Box::new(LuaScripts::new(&search)))?;
    let shown = lines
        .iter()
        .map(|line| Shown::of(registry.catalog(), &line.scenario).map_err(|error| of_scenario(line, error)))
        .collect::<Result<Vec<_>>>()?;
    let path = same_picture(&shown)?;
    check_output(path, output)?;
    let mut training = Training::new(&pdk_image::read(path)?);
    // The first step drives with the picture of the record, the others with the one that is written.
    let written = std::path::absolute(output).place(output.display())?;
    let with_it: Vec<Scenario> =
        lines.iter().zip(&shown).map(|(line, shown)| shown.with(&line.scenario, &written)).collect();
    let mut rehearsals = lines
        .iter()
        .map(|line| Rehearsal::new(&registry, &line.scenario).map_err(|error| of_scenario(line, error)))
        .collect::<Result<Vec<_>>>()?;
    let progress = pdk_terminal::progress(global.json, "{pos}/{len} steps {msg} {elapsed}");
    progress.set_length((*steps).into());
    let (mut left, mut taken) = (0, 0);
    while taken < *steps && left < lines.len() {
        let number = taken as usize % lines.len();
        let scenario = if taken == 0 { &lines[number].scenario } else { &with_it[number] };
        let share = 1.0 - taken as f32 / *steps as f32;
        let driven = training
            .step(&mut rehearsals[number], &scenario.perturbations, goal.side(), share, &mut || {
                progress.tick()
            })
            .map_err(|error| of_scenario(lines[number], error))?;
        left = if driven.cause == Cause::LaneDeparture { left + 1 } else { 0 };
        pdk_image::write(output, training.picture()?.as_ref())?;
        taken += 1;
        progress.set_message(format!("{}, largest error {:.2} m", driven.cause.text(), driven.worst().1));
        progress.inc(1);
    }
    progress.finish_and_clear();
    let after = drives::outcomes(&mut session, with_it, &progress)?;
    show(global, arguments, &lines, &after, taken)
}

/// The error with its scenario.
fn of_scenario(line: &Line, error: Error) -> Error {
    error.at(format_args!("scenario {}", line.id))
}

/// The file of the picture, which all drives show.
fn same_picture(shown: &[Shown]) -> Result<&Path> {
    let Some(first) = shown.first() else {
        return Err(Error::new("there is no scenario whose picture could be trained"));
    };
    match shown.iter().find(|other| other.path != first.path) {
        None => Ok(&first.path),
        Some(other) => Err(Error::new(format!(
            "some of the drives show {} and others {}; name those of one picture with --scenario",
            first.path.display(),
            other.path.display()
        ))),
    }
}

impl Shown {
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
        let Some(parameter) = parameter else {
            return Err(match of_frames.iter().any(|(.., parameter)| parameter.is_some()) {
                true => Error::new(format!(
                    "`{}` changes the frame after the picture is shown, and how the picture passes through that is not known; put it before the picture, or \
                     leave it out",
                    applied.name
                )),
                false => none(),
            });
        };
        let path = applied.parameters.get(&parameter.name).and_then(|value| value.as_str());
        match path.map(PathBuf::from).filter(|path| path.is_file()) {
            Some(path) => Ok(Self { place, parameter: parameter.name.clone(), path }),
            None => Err(Error::new(format!(
                "the picture `{}` is not a file; drive with one in a file, such as `pdk attack patch` writes",
                path.unwrap_or_default()
            ))),
        }
    }

    /// The scenario with the picture in another file.
    fn with(&self, scenario: &Scenario, file: &Path) -> Scenario {
        let mut scenario = scenario.clone();
        scenario.files.clear();
        let parameters = &mut scenario.perturbations[self.place].parameters;
        parameters.insert(self.parameter.clone(), json!(file));
        scenario
    }
}

/// Prints what became of the drives.
fn show(
    global: &Global,
    arguments: &Arguments,
    lines: &[&Line],
    after: &[Outcome],
    steps: u32,
) -> Result<()> {
    let failed = |outcome: &Outcome| outcome.cause == Cause::LaneDeparture;
    let before: Vec<&Outcome> = lines.iter().map(|line| &line.outcome).collect();
    if global.json {
        let drives = lines
            .iter()
            .zip(after)
            .map(|(line, after)| json!({ "scenario": line.id, "before": line.outcome, "after": after }));
        return print_json(&json!({
            "file": arguments.output,
            "steps": steps,
            "drives": drives.collect::<Vec<_>>(),
        }));
    }
    let mut rows = table(["scenario", "before", "", "with the new picture", ""]);
    for (line, after) in lines.iter().zip(after) {
        let error = |outcome: &Outcome| format!("{:.2} m", outcome.max_cross_track_error);
        rows.add_row([
            line.name.clone(),
            line.outcome.cause.text().to_owned(),
            error(&line.outcome),
            after.cause.text().to_owned(),
            error(after),
        ]);
    }
    println!(
        "{rows}\nThe vehicle left its lane in {} of {} drives before, and in {} after {steps} {}. Wrote {}",
        before.iter().filter(|outcome| failed(outcome)).count(),
        before.len(),
        after.iter().filter(|outcome| failed(outcome)).count(),
        if steps == 1 { "step" } else { "steps" },
        arguments.output.display()
    );
    Ok(())
}
