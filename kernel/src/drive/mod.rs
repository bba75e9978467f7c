//! The closed loop: simulator, perturbations, driver, and back to the simulator, frame by frame.

use std::collections::BTreeSet;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError, mpsc};
use std::thread::ScopedJoinHandle;
use std::time::{Duration, Instant};

use indicatif::ProgressBar;
use pdk_bus::{Bus, ControlMessage, Stamp, StateMessage, Topic};
use pdk_sdk::error::{Error, Result};
use pdk_sdk::prelude::{Camera, Control, DriveContext, Driver, Frame, FrameMut, Scenario, Simulator, State};
use serde::Serialize;
use twox_hash::XxHash3_64;

use crate::chain::Chain;
use crate::record::trace::ImageTopic;
use crate::record::{self, RunDirectory, SCENARIOS};
use crate::registry::Registry;
use crate::watchdog::Watch;

pub mod outcome;
pub mod plan;
mod recorder;
pub mod stages;

pub use outcome::{Cause, Outcome};
pub use plan::{Plan, ScenarioSpec};
use recorder::Recorder;
use stages::{LoopTimes, Stage, Stopwatch};

/// How scenarios are driven.
#[derive(Debug, Clone)]
pub struct Settings {
    /// The seed of the run.
    pub seed: u64,
    /// The number of scenarios that are driven at the same time.
    pub threads: usize,
    /// How long one call of a component may take.
    pub patience: Duration,
    /// The name of the run on the topics.
    pub run_id: String,
    /// The number of the first scenario.
    pub first_index: u64,
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

/// Labels of the calls under watch; from `PERTURBATIONS` on there is one for each scenario of the plan.
const SIMULATOR: usize = 0;
const DRIVER: usize = 1;
const PERTURBATIONS: usize = 2;

/// What is said of a scenario's perturbations when one of them does not come back.
fn perturbations_label(scenario: &ScenarioSpec) -> String {
    let names: Vec<_> = scenario.perturbations.iter().map(ToString::to_string).collect();
    match names.as_slice() {
        [name] => format!("perturbation `{name}`"),
        names => format!("one of the perturbations `{}`", names.join("`, `")),
    }
}

fn watch(plan: &Plan, patience: Duration) -> Watch {
    let components =
        [format!("simulator `{}`", plan.simulator.name), format!("driver `{}`", plan.driver.name)];
    Watch::new(
        components.into_iter().chain(plan.scenarios.iter().map(perturbations_label)).collect(),
        patience,
    )
}

/// Drives all scenarios of a plan but those that were `recorded` by an earlier process, and writes a line and a trace for
/// each. The outcomes, with those recorded, are the same for any number of threads.
///
/// # Errors
/// Where a component cannot be made, or the record cannot be written. A component that fails within a scenario is that
/// scenario's outcome, and the next scenario gets new instances.
pub fn drive(
    registry: &Registry,
    plan: &Plan,
    settings: &Settings,
    directory: &RunDirectory,
    recorded: Vec<Outcome>,
    progress: &ProgressBar,
) -> Result<(Vec<Outcome>, Performance)> {
    // A wrong name or parameter shows before the first scenario rather than in the middle of the night.
    let watch = watch(plan, settings.patience);
    let done: BTreeSet<u64> = recorded.iter().map(|outcome| outcome.index).collect();
    let open: Vec<(usize, &ScenarioSpec)> = (settings.first_index..)
        .zip(plan.scenarios.iter().enumerate())
        .filter_map(|(index, scenario)| (!done.contains(&index)).then_some(scenario))
        .collect();
    for &(position, scenario) in &open {
        watch.call(PERTURBATIONS + position, || {
            Chain::new(registry, &scenario.perturbations, settings.seed, 0).map(drop)
        })?;
    }
    let threads = settings.threads.clamp(1, open.len().max(1));
    let workers = (0..threads)
        .map(|lane| Worker::new(registry, plan, settings, directory, lane as u32))
        .collect::<Result<Vec<_>>>()?;
    let rate = workers.first().map_or(0.0, |worker| worker.camera.rate);
    progress.set_length(open.iter().map(|(_, scenario)| expected_frames(scenario, rate)).sum());

    let started = Instant::now();
    let lines = Mutex::new(directory.lines(SCENARIOS)?);
    // Written before the next scenario begins, so that a run that ends there loses only what was in flight.
    let write = |outcome: &Outcome| {
        let mut lines = lines.lock().unwrap_or_else(PoisonError::into_inner);
        lines.write(outcome)?;
        lines.sync()
    };
    let next = AtomicUsize::new(0);
    let stop = AtomicBool::new(false);
    let mut outcomes = recorded;
    let before: u64 = outcomes.iter().map(|outcome| outcome.frames).sum();
    let stopwatches = std::thread::scope(|scope| {
        let (sender, receiver) = mpsc::channel();
        let threads: Vec<_> = workers
            .into_iter()
            .map(|mut worker| {
                let (sender, next, stop, write, open) = (sender.clone(), &next, &stop, &write, &open);
                scope.spawn(move || {
                    while !stop.load(Ordering::Relaxed) {
                        let index = next.fetch_add(1, Ordering::Relaxed);
                        let Some(&(position, scenario)) = open.get(index) else { break };
                        let outcome = worker.scenario(position as u64, scenario, progress);
                        let outcome = outcome.and_then(|outcome| write(&outcome).map(|()| outcome));
                        if outcome.is_err() {
                            stop.store(true, Ordering::Relaxed);
                        }
                        if sender.send(outcome).is_err() {
                            break;
                        }
                    }
                    worker.finish()
                })
            })
            .collect();
        drop(sender);
        let mut failure = None;
        for outcome in receiver {
            match outcome {
                Ok(outcome) => outcomes.push(outcome),
                Err(error) => {
                    failure.get_or_insert(error);
                }
            }
        }
        // A panic in the kernel ends the run rather than leaving scenarios out.
        let join = |thread: ScopedJoinHandle<'_, Stopwatch>| {
            thread.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic))
        };
        let stopwatches: Vec<_> = threads.into_iter().map(join).collect();
        failure.map_or(Ok(stopwatches), Err)
    });
    progress.finish_and_clear();
    // What was recorded before a failure stays, and in order; the failure is the one to report.
    let sorted = record::sort_lines(directory, SCENARIOS, "index");
    let stopwatches = stopwatches?;
    sorted?;
    outcomes.sort_by_key(|outcome| outcome.index);

    let wall = started.elapsed().as_secs_f64();
    let stages = stopwatches.into_iter().reduce(|mut sum, next| {
        sum.merge(next);
        sum
    });
    let frames = outcomes.iter().map(|outcome| outcome.frames).sum::<u64>() - before;
    let performance = Performance {
        threads,
        wall_seconds: wall,
        frames_per_second: frames as f64 / wall,
        real_time_factor: frames as f64 / rate / wall,
        stages: stages.map(|stopwatch| stopwatch.times()).unwrap_or_default(),
    };
    Ok((outcomes, performance))
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
        ..outcome.clone()
    };
    // As it comes out of the file.
    let asked: Outcome = serde_json::from_str(&serde_json::to_string(&asked)?)?;
    let same = [
        ("its road, perturbations, duration, name or seed", asked.scenario == outcome.scenario),
        ("its simulator", asked.simulator == outcome.simulator),
        ("its driver", asked.driver == outcome.driver),
        ("images_every", asked.images_every == outcome.images_every),
    ];
    match same.into_iter().find(|(_, same)| !same) {
        None => Ok(()),
        Some((what, _)) => Err(Error::new(format!(
            "scenario {} `{}` was recorded as another one ({what} is different); choose another folder with --out",
            outcome.index, outcome.scenario.name
        ))),
    }
}

/// A simulator may deliver so many times the frames that its rate and the time limit make, and so many more; a scenario
/// whose time does not go on would never end.
const PATIENT_FACTOR: u64 = 10;
const PATIENT_FRAMES: u64 = 1000;

fn expected_frames(scenario: &ScenarioSpec, rate: f64) -> u64 {
    (scenario.duration * rate).ceil() as u64 + 1
}

/// Why a scenario could not be driven to its end.
enum Fault {
    /// A component failed: the outcome of this scenario.
    Component(Error),
    /// The kernel itself failed: the end of the run.
    Kernel(Error),
}

impl From<pdk_bus::Error> for Fault {
    fn from(error: pdk_bus::Error) -> Self {
        Fault::Kernel(Error::new(error.to_string()))
    }
}

/// One thread's loop with its instances and topics.
struct Worker<'a> {
    registry: &'a Registry,
    plan: &'a Plan,
    settings: &'a Settings,
    directory: &'a RunDirectory,
    simulator: Box<dyn Simulator>,
    driver: Box<dyn Driver>,
    camera: Camera,
    bus: Bus,
    recorder: Recorder,
    watch: Watch,
    stopwatch: Stopwatch,
}

impl<'a> Worker<'a> {
    fn new(
        registry: &'a Registry,
        plan: &'a Plan,
        settings: &'a Settings,
        directory: &'a RunDirectory,
        lane: u32,
    ) -> Result<Self> {
        let watch = watch(plan, settings.patience);
        let (simulator, driver) = make_components(registry, plan, &watch)?;
        let camera = simulator.camera();
        let bus = Bus::create(&settings.run_id, lane, camera.width, camera.height)
            .map_err(|error| Error::new(error.to_string()))?;
        let steps: u64 = plan.scenarios.iter().map(|s| expected_frames(s, camera.rate)).sum();
        let steps = usize::try_from(steps).unwrap_or(usize::MAX);
        let stopwatch = Stopwatch::new(Duration::from_secs_f64(1.0 / camera.rate), steps);
        let recorder = Recorder::new()?;
        Ok(Self {
            registry,
            plan,
            settings,
            directory,
            simulator,
            driver,
            camera,
            bus,
            recorder,
            watch,
            stopwatch,
        })
    }

    /// Drives one scenario and completes its trace.
    fn scenario(&mut self, position: u64, spec: &ScenarioSpec, progress: &ProgressBar) -> Result<Outcome> {
        let index = self.settings.first_index + position;
        self.recorder.start(self.directory.trace(index)?);
        let mut run = ScenarioRun::new(index, PERTURBATIONS + position as usize, spec);
        let fault = run.drive(self, progress).err();
        let error = match fault {
            Some(Fault::Kernel(error)) => return Err(error),
            Some(Fault::Component(error)) => Some(error.to_string()),
            None => None,
        };
        progress.inc(expected_frames(spec, self.camera.rate).saturating_sub(run.frames));
        let text = error.as_deref().unwrap_or(run.cause.text());
        self.recorder.event(run.state.time, run.cause != Cause::Finished, text);
        self.recorder.finish()?;
        // Before its reset a simulator still has the road of the scenario before, if any.
        let waypoints = match run.on_the_road {
            true => outcome::waypoint_string(&self.simulator.waypoints()),
            false => String::new(),
        };
        if error.is_some() {
            // What failed may be in any state.
            let (simulator, driver) = make_components(self.registry, self.plan, &self.watch)?;
            let simulator = std::mem::replace(&mut self.simulator, simulator);
            let driver = std::mem::replace(&mut self.driver, driver);
            drop_components(simulator, driver, &self.watch);
        }
        Ok(run.into_outcome(self.plan, error, waypoints))
    }

    /// Ends the loop and returns the times of its steps.
    fn finish(self) -> Stopwatch {
        drop_components(self.simulator, self.driver, &self.watch);
        self.stopwatch
    }
}

fn make_components(
    registry: &Registry,
    plan: &Plan,
    watch: &Watch,
) -> Result<(Box<dyn Simulator>, Box<dyn Driver>)> {
    let (simulator, _) =
        watch.call(SIMULATOR, || registry.simulator(&plan.simulator.name, &plan.simulator.parameters))?;
    let (driver, _) = watch.call(DRIVER, || registry.driver(&plan.driver.name, &plan.driver.parameters))?;
    Ok((simulator, driver))
}

/// What a component does at its end is under watch as well.
fn drop_components(simulator: Box<dyn Simulator>, driver: Box<dyn Driver>, watch: &Watch) {
    watch.call(SIMULATOR, || drop(simulator));
    watch.call(DRIVER, || drop(driver));
}

/// A scenario while it is driven.
struct ScenarioRun<'a> {
    index: u64,
    /// The label of its perturbations.
    label: usize,
    spec: &'a ScenarioSpec,
    observer: outcome::Observer,
    digest: blake3::Hasher,
    frames: u64,
    /// Whether the simulator has built this scenario.
    on_the_road: bool,
    state: State,
    cause: Cause,
}

impl<'a> ScenarioRun<'a> {
    fn new(index: u64, label: usize, spec: &'a ScenarioSpec) -> Self {
        Self {
            index,
            label,
            spec,
            observer: outcome::Observer::new(spec.duration),
            digest: blake3::Hasher::new(),
            frames: 0,
            on_the_road: false,
            state: State::default(),
            cause: Cause::Error,
        }
    }

    fn drive(&mut self, worker: &mut Worker<'_>, progress: &ProgressBar) -> Result<(), Fault> {
        let (registry, seed) = (worker.registry, worker.settings.seed);
        let make = || Chain::new(registry, &self.spec.perturbations, seed, self.index);
        let mut chain = worker.watch.call(self.label, make).map_err(Fault::Component)?;
        let result = self.drive_through(worker, &mut chain, progress);
        worker.watch.call(self.label, || drop(chain));
        result
    }

    fn drive_through(
        &mut self,
        worker: &mut Worker<'_>,
        chain: &mut Chain,
        progress: &ProgressBar,
    ) -> Result<(), Fault> {
        let scenario = Scenario {
            index: self.index,
            seed: self.spec.seed.unwrap_or(worker.settings.seed),
            road: self.spec.road.clone(),
            duration: self.spec.duration,
        };
        let simulator = format!("simulator `{}`", worker.plan.simulator.name);
        worker
            .watch
            .call(SIMULATOR, || worker.simulator.reset(&scenario))
            .map_err(|error| Fault::Component(error.at(simulator)))?;
        self.on_the_road = true;
        worker
            .watch
            .call(DRIVER, || worker.driver.reset())
            .map_err(|error| driver_fault(worker.plan, error))?;
        worker.recorder.event(0.0, false, &self.spec.name);
        loop {
            worker.stopwatch.start_step();
            let end = self.step(worker, chain)?;
            worker.stopwatch.end_step();
            progress.inc(1);
            if let Some(cause) = end {
                self.cause = cause;
                return Ok(());
            }
        }
    }

    /// One frame around the loop.
    fn step(&mut self, worker: &mut Worker<'_>, chain: &mut Chain) -> Result<Option<Cause>, Fault> {
        let Worker { plan, simulator, driver, camera, bus, recorder, watch, stopwatch, .. } = worker;
        let (width, height) = (camera.width as usize, camera.height as usize);
        let sequence = self.frames;
        let stamp = Stamp { scenario: self.index, sequence, time: sequence as f64 / camera.rate };
        let simulator_fault =
            |error: Error| Fault::Component(error.at(format_args!("simulator `{}`", plan.simulator.name)));
        let wrong_size = |error: pdk_sdk::ops::FrameError| Fault::Kernel(error.into());

        let mut loan = bus.loan_frame(Topic::Raw, stamp)?;
        let target = FrameMut::new(&mut loan, width, height).map_err(wrong_size)?;
        let state = stopwatch
            .measure(Stage::Simulator, || watch.call(SIMULATOR, || simulator.frame(target)))
            .and_then(|state| self.plausible(state, camera.rate))
            .map_err(simulator_fault)?;
        let raw = loan.publish()?;
        let raw_frame = Frame::new(&raw, width, height).map_err(wrong_size)?;
        bus.publish_state(stamp, state_message(&state))?;

        let mut loan = bus.loan_frame(Topic::Perturbed, stamp)?;
        let target = FrameMut::new(&mut loan, width, height).map_err(wrong_size)?;
        stopwatch
            .measure(Stage::Perturbation, || {
                watch.call(self.label, || chain.apply(raw_frame, target, sequence, state.time))
            })
            .map_err(Fault::Component)?;
        let perturbed = loan.publish()?;
        let perturbed_frame = Frame::new(&perturbed, width, height).map_err(wrong_size)?;

        let cx = DriveContext { frame_index: sequence, time: state.time, speed: state.speed };
        let control = stopwatch
            .measure(Stage::Driver, || watch.call(DRIVER, || driver.drive(perturbed_frame, &cx)))
            .and_then(checked)
            .map_err(|error| driver_fault(plan, error))?;
        bus.publish_control(
            stamp,
            ControlMessage { steering: control.steering, throttle: control.throttle },
        )?;

        let frame_hash = XxHash3_64::oneshot(&perturbed);
        for part in [frame_hash, control.steering.to_bits(), control.throttle.to_bits()] {
            self.digest.update(&part.to_le_bytes());
        }
        recorder.step(sequence, state, control, frame_hash);
        if plan.images_every > 0 && sequence.is_multiple_of(plan.images_every) {
            recorder.image(ImageTopic::Raw, sequence, state.time, raw_frame);
            recorder.image(ImageTopic::Perturbed, sequence, state.time, perturbed_frame);
        }
        self.frames += 1;
        self.state = state;
        let end = self.observer.step(sequence, state, control);
        if end.is_none() {
            stopwatch
                .measure(Stage::Simulator, || watch.call(SIMULATOR, || simulator.act(control)))
                .map_err(simulator_fault)?;
        }
        Ok(end)
    }

    /// A state that a scenario can be judged by: numbers throughout, and a time that goes on.
    fn plausible(&self, state: State, rate: f64) -> Result<State> {
        let State { time, position: [x, height, z], heading, speed, cross_track_error, progress, .. } = state;
        let numbers = [time, x, height, z, heading, speed, cross_track_error, progress];
        if !numbers.iter().all(|v| v.is_finite()) || state.vehicle_ahead.is_nan() {
            return Err(Error::new(format!(
                "its state in frame {} holds numbers that are not finite",
                self.frames
            )));
        }
        let limit = PATIENT_FRAMES + PATIENT_FACTOR * expected_frames(self.spec, rate);
        if self.frames > limit {
            return Err(Error::new(format!(
                "after {limit} frames it says that {time} s have passed of {} s, so its time does not go on",
                self.spec.duration
            )));
        }
        Ok(state)
    }

    fn into_outcome(self, plan: &Plan, error: Option<String>, waypoints: String) -> Outcome {
        let (mean_cross_track_error, max_cross_track_error) = self.observer.cross_track_error();
        Outcome {
            index: self.index,
            scenario: self.spec.clone(),
            simulator: Some(plan.simulator.clone()),
            driver: Some(plan.driver.clone()),
            images_every: Some(plan.images_every),
            success: self.cause == Cause::Finished,
            cause: self.cause,
            error,
            time: self.state.time,
            frames: self.frames,
            progress: self.state.progress,
            mean_cross_track_error,
            max_cross_track_error,
            digest: self.digest.finalize().to_hex()[..32].to_owned(),
            telemetry: self.observer.into_samples(),
            waypoints,
        }
    }
}

fn driver_fault(plan: &Plan, error: Error) -> Fault {
    Fault::Component(error.at(format_args!("driver `{}`", plan.driver.name)))
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

fn state_message(state: &State) -> StateMessage {
    let flag = |set: bool, flag: u32| if set { flag } else { 0 };
    StateMessage {
        position: state.position,
        heading: state.heading,
        speed: state.speed,
        cross_track_error: state.cross_track_error,
        progress: state.progress,
        vehicle_ahead: state.vehicle_ahead,
        flags: flag(state.lane_departure, StateMessage::LANE_DEPARTURE)
            | flag(state.collision, StateMessage::COLLISION)
            | flag(state.finished, StateMessage::FINISHED),
        reserved: 0,
    }
}
