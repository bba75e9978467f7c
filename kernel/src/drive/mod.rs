//! The closed loop: simulator, perturbations, driver, and back to the simulator, frame by frame.

use std::collections::BTreeSet;
use std::path::Path;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, mpsc};
use std::thread::ScopedJoinHandle;
use std::time::Instant;

use indicatif::ProgressBar;
use pdk_sdk::error::{Error, Result};
use pdk_sdk::prelude::Control;
use serde::Serialize;

use crate::chain::Chain;
use crate::record::{self, RunDirectory, SCENARIOS};
use crate::registry::Registry;
use crate::watchdog::Patience;

pub mod outcome;
pub mod plan;
pub mod recent;
mod recorder;
pub mod stages;
pub mod witness;
mod worker;

pub use outcome::{Cause, Outcome};
pub use plan::{Plan, ScenarioSpec};
use stages::LoopTimes;
pub use witness::Witness;
use witness::WriteRecord;
use worker::{Worker, expected_frames, watch};

/// How scenarios are driven.
#[derive(Debug, Clone)]
pub struct Settings {
    /// The seed of the run.
    pub seed: u64,
    /// The number of scenarios that are driven at the same time.
    pub threads: usize,
    /// How long one call of a component may take.
    pub patience: Patience,
    /// The name of the run on the topics.
    pub run_id: String,
}

/// How long it took: the part of the result that differs from run to run.
#[derive(Debug, Clone, Serialize)]
pub struct Performance {
    /// Threads that were used.
    pub threads: usize,
    /// Wall time in seconds.
    pub wall_seconds: f64,
    /// Frames driven per second of wall time.
    pub frames_per_second: f64,
    /// Simulated seconds per second of wall time.
    pub real_time_factor: f64,
    /// The stages of a step.
    pub stages: LoopTimes,
}

/// A scenario to drive, under its number in the run.
pub type Numbered<'a> = (u64, &'a ScenarioSpec);

/// Drives all scenarios of a plan but those that were `recorded` by an earlier process, and writes a line and a trace for
/// each; the first of the plan has the number `first_index`. The outcomes, with those recorded, are the same for any number
/// of threads.
///
/// # Errors
/// As for [`drive_all`], and where the record cannot be written.
pub fn drive(
    registry: &Registry,
    plan: &Plan,
    settings: &Settings,
    first_index: u64,
    directory: &RunDirectory,
    recorded: Vec<Outcome>,
    progress: &ProgressBar,
) -> Result<(Vec<Outcome>, Performance)> {
    let done: BTreeSet<u64> = recorded.iter().map(|outcome| outcome.index).collect();
    let open: Vec<Numbered> =
        (first_index..).zip(&plan.scenarios).filter(|(index, _)| !done.contains(index)).collect();
    let lines = Mutex::new(directory.lines(SCENARIOS)?);
    let witness = || WriteRecord::new(directory, &lines, plan.images_every);
    let driven = drive_all(registry, plan, &open, settings, witness, progress);
    // What was recorded before a failure stays, and in order; the failure is the one to report.
    let sorted = record::sort_lines(directory, SCENARIOS, "index");
    let (new, performance) = driven?;
    sorted?;
    let mut outcomes = recorded;
    outcomes.extend(new);
    outcomes.sort_by_key(|outcome| outcome.index);
    Ok((outcomes, performance))
}

/// Drives scenarios with the simulator and the driver of a plan, each thread with a witness of its own, and returns what
/// the witnesses say, in no particular order.
///
/// # Errors
/// Where a component cannot be made, or a witness fails. A component that fails within a scenario is that scenario's
/// outcome, and the next scenario gets new instances.
pub fn drive_all<W: Witness>(
    registry: &Registry,
    plan: &Plan,
    scenarios: &[Numbered<'_>],
    settings: &Settings,
    witness: impl Fn() -> Result<W>,
    progress: &ProgressBar,
) -> Result<(Vec<W::Verdict>, Performance)> {
    // A wrong name or parameter shows before the first scenario rather than in the middle of the night.
    let watch = watch(plan, scenarios, settings);
    for (position, (_, scenario)) in scenarios.iter().enumerate() {
        watch.call(worker::PERTURBATIONS + position, || {
            Chain::new(registry, &scenario.perturbations, settings.seed, 0).map(drop)
        })?;
    }
    let threads = settings.threads.clamp(1, scenarios.len().max(1));
    let workers = (0..threads)
        .map(|lane| Worker::new(registry, plan, scenarios, settings, lane as u32, witness()?))
        .collect::<Result<Vec<_>>>()?;
    let rate = workers.first().map_or(0.0, |worker| worker.camera().rate);
    let frames: u64 = scenarios.iter().map(|(_, scenario)| expected_frames(scenario, rate)).sum();
    progress.set_length(progress.length().unwrap_or(0) + frames);

    let started = Instant::now();
    let next = AtomicUsize::new(0);
    let stop = AtomicBool::new(false);
    let driven = std::thread::scope(|scope| {
        let (sender, receiver) = mpsc::channel();
        let threads: Vec<_> = workers
            .into_iter()
            .map(|mut worker| {
                let (sender, next, stop) = (sender.clone(), &next, &stop);
                scope.spawn(move || {
                    while !stop.load(Ordering::Relaxed) {
                        let position = next.fetch_add(1, Ordering::Relaxed);
                        if position >= scenarios.len() {
                            break;
                        }
                        let verdict = worker.scenario(position, progress);
                        if verdict.is_err() {
                            stop.store(true, Ordering::Relaxed);
                        }
                        if sender.send(verdict).is_err() {
                            break;
                        }
                    }
                    worker.finish()
                })
            })
            .collect();
        drop(sender);
        let mut verdicts = Vec::with_capacity(scenarios.len());
        let mut failure = None;
        for verdict in receiver {
            match verdict {
                Ok(verdict) => verdicts.push(verdict),
                Err(error) => {
                    failure.get_or_insert(error);
                }
            }
        }
        // A panic in the kernel ends the run rather than leaving scenarios out.
        let join = |thread: ScopedJoinHandle<'_, stages::Stopwatch>| {
            thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        };
        let stopwatches: Vec<_> = threads.into_iter().map(join).collect();
        failure.map_or(Ok((verdicts, stopwatches)), Err)
    });
    progress.finish_and_clear();
    let (verdicts, stopwatches) = driven?;

    let wall = started.elapsed().as_secs_f64();
    let stages = stopwatches.into_iter().reduce(|mut sum, next| {
        sum.merge(next);
        sum
    });
    let stages = stages.map(|stopwatch| stopwatch.times()).unwrap_or_default();
    let performance = Performance {
        threads,
        wall_seconds: wall,
        frames_per_second: stages.steps as f64 / wall,
        real_time_factor: stages.steps as f64 / rate / wall,
        stages,
    };
    Ok((verdicts, performance))
}

/// The name of a run on its topics: letters, digits, dashes and underscores, unique on this machine.
pub fn run_id(folder: &Path) -> String {
    let name = folder.file_name().unwrap_or_default().to_string_lossy();
    let fits = |c: char| if c.is_ascii_alphanumeric() || c == '-' { c } else { '_' };
    let name: String = name.chars().map(fits).take(40).collect();
    format!("{name}-{}", std::process::id())
}

/// Says what an outcome that was recorded earlier has in common with what the plan asks for under its number: everything.
///
/// # Errors
/// Names what differs.
pub fn check_recorded(plan: &Plan, scenario: &ScenarioSpec, outcome: &Outcome) -> Result<()> {
    let asked = Outcome {
        scenario: scenario.clone(),
        simulator: Some(plan.simulator.clone()),
        driver: Some(plan.driver.clone()),
        images_every: Some(plan.images_every),
        mode: plan.mode,
        ..outcome.clone()
    };
    // As it comes out of the file.
    let asked: Outcome = serde_json::from_str(&serde_json::to_string(&asked)?)?;
    let same = [
        ("its road, perturbations, duration, name or seed", asked.scenario == outcome.scenario),
        ("its simulator", asked.simulator == outcome.simulator),
        ("its driver", asked.driver == outcome.driver),
        ("images_every", asked.images_every == outcome.images_every),
        ("its mode", asked.mode == outcome.mode),
    ];
    match same.into_iter().find(|(_, same)| !same) {
        None => Ok(()),
        Some((what, _)) => Err(Error::new(format!(
            "scenario {} `{}` was recorded as another one ({what} is different); choose another folder with --out",
            outcome.index, outcome.scenario.name
        ))),
    }
}

/// A driver's control within its range.
///
/// # Errors
/// Where it is no number.
pub fn checked(control: Control) -> Result<Control> {
    if !control.steering.is_finite() || !control.throttle.is_finite() {
        return Err(Error::new(format!(
            "it steers {} with throttle {}, which is no control; look at its output layer",
            control.steering, control.throttle
        )));
    }
    Ok(Control { steering: control.steering.clamp(-1.0, 1.0), throttle: control.throttle.clamp(-1.0, 1.0) })
}
