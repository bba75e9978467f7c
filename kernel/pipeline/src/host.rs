//! What a pipeline does through the global `pdk`: it collects settings, drives, evaluates, and keeps the record.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, SystemTime};

use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, Result};
use serde_json::{Map, Value, json};

use super::settings::{self, COMMON, Override};
use super::{report, road, speed, table};
use crate::chain::Spec;
use crate::component::ComponentSpec;
use crate::drive::{self, Cause, Outcome};
use crate::evaluate;
use crate::output;
use crate::record::manifest::{InUse, Machine, Manifest, Pipeline};
use crate::record::{MANIFEST, PERFORMANCE, Recorded, RunDirectory, SUMMARY};
use crate::registry::Registry;
use crate::watchdog::{self, Patience};

/// The folder for records where the user names none.
const RUNS: &str = "runs";

/// How a pipeline is run.
#[derive(Debug, Clone, Default)]
pub struct Options {
    /// What the command line sets, in order.
    pub overrides: Vec<Override>,
    /// Whether nobody reads along: then there are no progress bars and no tables.
    pub quiet: bool,
}

/// What a run came to.
#[derive(Debug, Clone)]
pub struct Finished {
    /// The folder of the record; none where the pipeline neither drove nor evaluated.
    pub record: Option<PathBuf>,
    /// The table at the end.
    pub summary: Value,
    /// What did not go well without ending the run, one sentence each.
    pub warnings: Vec<String>,
    /// Why the run counts as failed: an error of the script, or one that did not end it.
    pub failure: Option<Error>,
}

/// The state behind the global `pdk` of one pipeline.
pub struct Host {
    registry: Arc<Registry>,
    pipeline: Pipeline,
    options: Options,
    settings: Option<Value>,
    common: Common,
    directory: Option<RunDirectory>,
    /// What an earlier process left in the folder; its outcomes are taken out as the pipeline comes to them.
    recorded: Option<Recorded>,
    /// How many outcomes were taken from there.
    kept: usize,
    in_use: InUse,
    outcomes: Vec<Value>,
    evaluations: Vec<Value>,
    /// The number of the next scenario; it goes on where a drive failed, so that no trace is written twice.
    next_scenario: u64,
    /// The number of the next evaluation, for the same reason.
    next_evaluation: u64,
    performance: Vec<Value>,
    warnings: Vec<String>,
    failed_scenarios: Vec<String>,
    started: SystemTime,
}

/// The settings that every pipeline understands.
struct Common {
    seed: u64,
    threads: usize,
    out: Option<PathBuf>,
    patience: Duration,
}

impl Common {
    fn read(overrides: &[Override]) -> Result<Self> {
        let mut common = Self {
            seed: 0,
            threads: std::thread::available_parallelism().map_or(1, usize::from),
            out: None,
            patience: watchdog::DEFAULT_PATIENCE,
        };
        for Override { key, value } in overrides {
            let wrong = |expected: &str| Error::new(format!("--set {key}: `{value}` is no {expected}"));
            match key.as_str() {
                "seed" => common.seed = value.parse().map_err(|_| wrong("whole number of at least 0"))?,
                "threads" => {
                    common.threads = value
                        .parse()
                        .ok()
                        .filter(|&n| n > 0)
                        .ok_or_else(|| wrong("whole number of at least 1"))?;
                }
                "out" => common.out = Some(PathBuf::from(value)),
                "patience" => {
                    let seconds = value.parse().ok().filter(|&seconds: &f64| seconds > 0.0);
                    common.patience = seconds
                        .and_then(|seconds| Duration::try_from_secs_f64(seconds).ok())
                        .ok_or_else(|| wrong("positive number of seconds"))?;
                }
                _ => {}
            }
        }
        Ok(common)
    }
}

impl Host {
    /// The host for one pipeline.
    ///
    /// # Errors
    /// Where a setting that every pipeline understands has a wrong value.
    pub fn new(registry: Arc<Registry>, pipeline: Pipeline, options: Options) -> Result<Self> {
        let common = Common::read(&options.overrides)?;
        Ok(Self {
            registry,
            pipeline,
            options,
            settings: None,
            common,
            directory: None,
            recorded: None,
            kept: 0,
            in_use: InUse::default(),
            outcomes: Vec::new(),
            evaluations: Vec::new(),
            next_scenario: 0,
            next_evaluation: 0,
            performance: Vec::new(),
            warnings: Vec::new(),
            failed_scenarios: Vec::new(),
            started: SystemTime::now(),
        })
    }

    /// `pdk.settings`: the defaults with what the command line puts in their place.
    pub(super) fn settings(&mut self, defaults: Value) -> Result<Value> {
        if self.settings.is_some() {
            return Err(Error::new("pdk.settings may be called once; put all settings into one table"));
        }
        if let Some((name, meaning)) = COMMON.iter().find(|(name, _)| defaults.get(name).is_some()) {
            return Err(Error::new(format!(
                "`{name}` is a setting that every pipeline has ({meaning}); leave it out of pdk.settings"
            )));
        }
        if self.directory.is_some() {
            return Err(Error::new(
                "pdk.settings has to come before the first pdk.drive or pdk.evaluate, because the record begins there",
            ));
        }
        let settings = settings::apply(defaults, &self.own_overrides())?;
        self.settings = Some(settings.clone());
        Ok(settings)
    }

    /// The overrides that are not of the common settings.
    fn own_overrides(&self) -> Vec<Override> {
        let common = |o: &&Override| !COMMON.iter().any(|(name, _)| *name == o.key);
        self.options.overrides.iter().filter(common).cloned().collect()
    }

    /// `pdk.drive`: the closed loop.
    pub(super) fn drive(&mut self, request: Value) -> Result<Value> {
        let plan = drive::Plan::from_json(request)?;
        let registry = Arc::clone(&self.registry);
        let perturbations = plan.scenarios.iter().flat_map(|scenario| &scenario.perturbations);
        self.begin([(Kind::Simulator, &plan.simulator), (Kind::Driver, &plan.driver)], perturbations)?;
        let directory = self.directory()?;
        let settings = drive::Settings {
            seed: self.common.seed,
            threads: self.common.threads,
            patience: Patience::of_run(self.common.patience),
            run_id: drive::run_id(directory.path()),
        };
        let first_index = self.next_scenario;
        self.next_scenario += plan.scenarios.len() as u64;
        let recorded = self.take_recorded(&plan, first_index)?;
        let driven = plan.scenarios.len() - recorded.len();
        let progress = output::progress(self.options.quiet, "{pos}/{len} frames, {per_sec}, {eta} left");
        let (outcomes, performance) =
            drive::drive(&registry, &plan, &settings, first_index, &directory, recorded, &progress)?;
        let overruns = performance.stages.overruns;
        if overruns > 0 {
            self.warnings.push(format!(
                "{overruns} of {} steps took longer than a frame lasts; {PERFORMANCE} has the times of the stages",
                performance.stages.steps
            ));
        }
        let rows: Vec<Value> = outcomes.iter().map(outcome_row).collect();
        for outcome in outcomes.iter().filter(|outcome| outcome.cause == Cause::Error) {
            let error = outcome.error.as_deref().unwrap_or_default();
            self.failed_scenarios
                .push(format!("scenario {} `{}`: {error}", outcome.index, outcome.scenario.name));
        }
        self.outcomes.extend(rows.iter().cloned());
        if driven > 0 {
            self.say_speed(speed::of_drive(&performance));
            self.performance.push(json!({ "drive": performance }));
        }
        Ok(Value::Array(rows))
    }

    /// The outcomes of a plan that an earlier process recorded.
    fn take_recorded(&mut self, plan: &drive::Plan, first_index: u64) -> Result<Vec<Outcome>> {
        let Some(recorded) = &mut self.recorded else { return Ok(Vec::new()) };
        let mut taken = Vec::new();
        for (index, scenario) in (first_index..).zip(&plan.scenarios) {
            if let Some(outcome) = recorded.outcomes.remove(&index) {
                drive::check_recorded(plan, scenario, &outcome).inspect_err(|_| self.directory = None)?;
                taken.push(outcome);
            }
        }
        self.kept += taken.len();
        if !self.options.quiet && !taken.is_empty() {
            println!(
                "{} of {} scenarios are in the record already; {}",
                taken.len(),
                plan.scenarios.len(),
                match plan.scenarios.len() - taken.len() {
                    0 => "nothing is left to drive".to_owned(),
                    left => format!("driving the other {left}"),
                }
            );
        }
        Ok(taken)
    }

    /// `pdk.evaluate`: the offline loop.
    pub(super) fn evaluate(&mut self, request: Value) -> Result<Value> {
        let plan = evaluate::Plan::from_json(request)?;
        let registry = Arc::clone(&self.registry);
        let (reader, _) = evaluate::open_dataset(&registry, &plan.dataset, self.common.patience)?;
        self.begin([(Kind::Dataset, &reader), (Kind::Driver, &plan.driver)], &plan.cells)?;
        let directory = self.directory()?;
        let settings = evaluate::Settings {
            seed: self.common.seed,
            threads: self.common.threads,
            patience: self.common.patience,
            number: self.next_evaluation,
        };
        self.next_evaluation += 1;
        let progress = output::progress(self.options.quiet, "{pos}/{len} frames, {eta} left");
        let (summary, performance) = evaluate::evaluate(&registry, &plan, &settings, &directory, &progress)?;
        for bad in &summary.bad_frames {
            self.warnings.push(format!("{} was left out: {}", bad.frame, bad.error));
        }
        let summary = serde_json::to_value(summary)?;
        self.evaluations.push(summary.clone());
        self.say_speed(speed::of_evaluation(&performance));
        self.performance.push(json!({ "evaluate": performance }));
        Ok(summary)
    }

    /// One line for people, who should not have to look for the speed in the record.
    fn say_speed(&self, line: String) {
        if !self.options.quiet {
            println!("{line}");
        }
    }

    /// `pdk.show`: a table of what `pdk.drive` or `pdk.evaluate` returned.
    pub(super) fn show(&self, result: &Value) -> Result<()> {
        let text = table::render(result)?;
        if !self.options.quiet {
            println!("{text}");
        }
        Ok(())
    }

    /// `pdk.table`: a table of the pipeline's own making.
    pub(super) fn table(&self, request: &Value) -> Result<()> {
        let text = report::render(&request["first"], &request["second"])?;
        if !self.options.quiet {
            println!("{text}");
        }
        Ok(())
    }

    /// `pdk.save`: a file in the record.
    pub(super) fn save(&self, request: &Value) -> Result<()> {
        let name = report::checked_name(&request["first"])?;
        let directory = self.directory.as_ref().ok_or_else(|| {
            Error::new("pdk.save has to come after the first pdk.drive or pdk.evaluate, because the record begins there")
        })?;
        directory.write_json(name, &report::sorted(&request["second"]))
    }

    /// `pdk.road`: a road for scenarios.
    pub(super) fn road(&self, request: Value) -> Result<Value> {
        road::make(request, self.common.seed)
    }

    /// `pdk.perturbations`: the names of the perturbations, all or those of the default set.
    pub(super) fn perturbations(&self, all: bool) -> Vec<String> {
        let wanted = self.registry.of_kind(Kind::Perturbation).filter(|c| all || c.description.default);
        wanted.map(|component| component.description.name.clone()).collect()
    }

    /// `pdk.path`: a path that counts from the pipeline's folder.
    pub(super) fn path(&self, relative: &str) -> String {
        let folder = self.pipeline.path.parent().unwrap_or(Path::new(""));
        folder.join(relative).to_string_lossy().into_owned()
    }

    /// Where the command line sets something although the pipeline has no settings of its own.
    fn check_overrides(&self) -> Result<()> {
        match self.settings {
            Some(_) => Ok(()),
            // Says that the setting does not exist.
            None => settings::apply(Value::Object(Map::new()), &self.own_overrides()).map(drop),
        }
    }

    /// Completes the record after the pipeline has come to its end, or to an error. Of several failures the first in this
    /// order is reported: that of the script, that of the record, those of scenarios, a setting that the pipeline does not
    /// have.
    pub fn finish(&mut self, script: Result<()>) -> Finished {
        let summary = json!({ "outcomes": self.outcomes, "evaluations": self.evaluations });
        let written = self.directory.as_ref().map_or(Ok(()), |directory| {
            directory.write_json(SUMMARY, &summary)?;
            // The times of the process that drove are worth more than those of one that did not.
            if self.kept > 0 && self.performance.is_empty() && directory.path().join(PERFORMANCE).is_file() {
                return Ok(());
            }
            let started = self.started.duration_since(SystemTime::UNIX_EPOCH).unwrap_or_default().as_secs();
            let performance = json!({ "started_unix_seconds": started, "steps": self.performance });
            directory.write_json(PERFORMANCE, &performance)
        });
        let scenarios = self.failed_scenarios.first().map(|first| {
            Error::new(format!(
                "{} of {} scenarios could not be driven because a component failed; the first: {first}",
                self.failed_scenarios.len(),
                self.outcomes.len()
            ))
        });
        let left = self.recorded.as_ref().and_then(|recorded| recorded.outcomes.keys().next()).map(|index| {
            Error::new(format!(
                "the record holds scenario {index}, which the pipeline did not drive; choose another folder with --out"
            ))
        });
        let failures = [script.err(), written.err(), left, scenarios, self.check_overrides().err()];
        Finished {
            record: self.directory.as_ref().map(|directory| directory.path().to_owned()),
            summary,
            warnings: std::mem::take(&mut self.warnings),
            failure: failures.into_iter().flatten().next(),
        }
    }

    /// Notes what is used from here on, and writes it down before anything is computed.
    fn begin<'a>(
        &mut self,
        components: [(Kind, &ComponentSpec); 2],
        perturbations: impl IntoIterator<Item = &'a Spec>,
    ) -> Result<()> {
        self.check_overrides()?;
        let patience = Patience::of_run(self.common.patience);
        self.in_use.add_all(&self.registry, components, perturbations, patience)?;
        let manifest = Manifest {
            pdk: env!("CARGO_PKG_VERSION").to_owned(),
            seed: self.common.seed,
            pipeline: self.pipeline.clone(),
            settings: self.settings.clone().unwrap_or_default(),
            plugins: self.registry.given().plugins.clone(),
            overlays: self.registry.given().drop_ins.iter().map(|(_, folder)| folder.clone()).collect(),
            components: self.in_use.components(),
            files: self.in_use.files(),
            machine: Machine::this(),
        };
        let directory = self.directory()?;
        let manifest = match &self.recorded {
            None => manifest,
            Some(recorded) => manifest.continuing(&recorded.manifest).map_err(|difference| {
                // What another run recorded stays as it is.
                self.directory = None;
                Error::new(format!(
                    "the output folder {} holds the record of another run: {difference}; choose another with --out",
                    directory.path().display()
                ))
            })?,
        };
        directory.write_json(MANIFEST, &manifest)
    }

    /// The folder of the record, which is made when it is first needed.
    fn directory(&mut self) -> Result<RunDirectory> {
        if let Some(directory) = &self.directory {
            return Ok(directory.clone());
        }
        let directory = match &self.common.out {
            Some(path) => RunDirectory::create(path),
            None => RunDirectory::create_first(folders(&self.pipeline.path)),
        };
        let directory = directory?;
        self.recorded = directory.recorded()?;
        Ok(self.directory.insert(directory).clone())
    }
}

/// What a pipeline and the summary see of an outcome; the telemetry stays in the record.
fn outcome_row(outcome: &Outcome) -> Value {
    json!({
        "index": outcome.index,
        "name": outcome.scenario.name,
        "success": outcome.success,
        "cause": outcome.cause,
        "error": outcome.error,
        "time": outcome.time,
        "frames": outcome.frames,
        "skipped_frames": outcome.skipped_frames,
        "progress": outcome.progress,
        "mean_cross_track_error": outcome.mean_cross_track_error,
        "max_cross_track_error": outcome.max_cross_track_error,
    })
}

/// The folders `runs/NAME-N`, one after the other.
fn folders(pipeline: &Path) -> impl Iterator<Item = PathBuf> {
    let name = pipeline.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    (1..).map(move |number: u64| Path::new(RUNS).join(format!("{name}-{number}")))
}
