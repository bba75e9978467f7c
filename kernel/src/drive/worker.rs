//! One thread's loop: it drives one scenario after the other with its own instances and topics.

use std::time::{Duration, Instant};

use indicatif::ProgressBar;
use pdk_bus::{Bus, ControlMessage, Stamp, StateMessage, Topic};
use pdk_sdk::error::{Error, Result};
use pdk_sdk::prelude::{Camera, Control, DriveContext, Driver, Frame, FrameMut, Scenario, Simulator, State};
use twox_hash::XxHash3_64;

use super::outcome::{self, Cause, Outcome};
use super::plan::Mode;
use super::stages::{Stage, Stopwatch};
use super::{Numbered, Plan, ScenarioSpec, Settings, Witness, checked};
use crate::chain::Chain;
use crate::record::trace::Step;
use crate::registry::Registry;
use crate::watchdog::Watch;

/// Labels of the calls under watch; from `PERTURBATIONS` on there is one for each scenario.
const SIMULATOR: usize = 0;
const DRIVER: usize = 1;
pub const PERTURBATIONS: usize = 2;

/// What is said of a scenario's perturbations when one of them does not come back.
fn perturbations_label(scenario: &ScenarioSpec) -> String {
    let names: Vec<_> = scenario.perturbations.iter().map(ToString::to_string).collect();
    match names.as_slice() {
        [name] => format!("perturbation `{name}`"),
        names => format!("one of the perturbations `{}`", names.join("`, `")),
    }
}

/// A watch over the calls of one thread.
pub fn watch(plan: &Plan, scenarios: &[Numbered<'_>], settings: &Settings) -> Watch {
    let components =
        [format!("simulator `{}`", plan.simulator.name), format!("driver `{}`", plan.driver.name)];
    let perturbations = scenarios.iter().map(|(_, scenario)| perturbations_label(scenario));
    let labels = components.into_iter().chain(perturbations).collect();
    Watch::with_patience(labels, settings.patience)
}

/// A simulator may deliver so many times the frames that its rate and the time limit make, and so many more; a scenario
/// whose time does not go on would never end.
const PATIENT_FACTOR: u64 = 10;
const PATIENT_FRAMES: u64 = 1000;

/// About so many frames a scenario has at most.
pub fn expected_frames(scenario: &ScenarioSpec, rate: f64) -> u64 {
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
pub struct Worker<'a, W> {
    registry: &'a Registry,
    plan: &'a Plan,
    scenarios: &'a [Numbered<'a>],
    settings: &'a Settings,
    witness: W,
    simulator: Box<dyn Simulator>,
    driver: Box<dyn Driver>,
    camera: Camera,
    bus: Bus,
    watch: Watch,
    stopwatch: Stopwatch,
}

impl<'a, W: Witness> Worker<'a, W> {
    /// Makes the instances and topics; `lane` numbers the threads of a run.
    ///
    /// # Errors
    /// Where a component cannot be made, or there is no room for the topics.
    pub fn new(
        registry: &'a Registry,
        plan: &'a Plan,
        scenarios: &'a [Numbered<'a>],
        settings: &'a Settings,
        lane: u32,
        witness: W,
    ) -> Result<Self> {
        let watch = watch(plan, scenarios, settings);
        let (simulator, driver) = make_components(registry, plan, &watch)?;
        let camera = simulator.camera();
        let bus = Bus::create(&settings.run_id, lane, camera.width, camera.height)
            .map_err(|error| Error::new(error.to_string()))?;
        let steps: u64 = scenarios.iter().map(|(_, s)| expected_frames(s, camera.rate)).sum();
        let steps = usize::try_from(steps).unwrap_or(usize::MAX);
        let stopwatch = Stopwatch::new(Duration::from_secs_f64(1.0 / camera.rate), steps);
        Ok(Self {
            registry,
            plan,
            scenarios,
            settings,
            witness,
            simulator,
            driver,
            camera,
            bus,
            watch,
            stopwatch,
        })
    }

    /// The simulator's camera.
    pub fn camera(&self) -> Camera {
        self.camera
    }

    /// Drives the scenario at a position of the list, before the eyes of the witness.
    ///
    /// # Errors
    /// Where the witness or the routing fails, or new instances in the place of failed ones cannot be made.
    pub fn scenario(&mut self, position: usize, progress: &ProgressBar) -> Result<W::Verdict> {
        let (index, spec) = self.scenarios[position];
        let expected = expected_frames(spec, self.camera.rate);
        if let Some(verdict) = self.witness.start(index, self.camera)? {
            progress.inc(expected);
            return Ok(verdict);
        }
        let mut run = ScenarioRun::new(index, PERTURBATIONS + position, spec);
        let fault = run.drive(self, progress).err();
        let error = match fault {
            Some(Fault::Kernel(error)) => return Err(error),
            Some(Fault::Component(error)) => Some(error.to_string()),
            None => None,
        };
        progress.inc(expected.saturating_sub(run.frames));
        let text = error.as_deref().unwrap_or(run.cause.text());
        self.witness.event(run.state.time, run.cause != Cause::Finished, text);
        // Before its reset a simulator still has the road of the scenario before, if any.
        let waypoints = match run.on_the_road {
            true => outcome::waypoint_string(&self.simulator.waypoints()),
            false => String::new(),
        };
        let failed = error.is_some();
        let verdict = self.witness.finish(run.into_outcome(self.plan, error, waypoints));
        if failed {
            // What failed may be in any state.
            let (simulator, driver) = make_components(self.registry, self.plan, &self.watch)?;
            let simulator = std::mem::replace(&mut self.simulator, simulator);
            let driver = std::mem::replace(&mut self.driver, driver);
            drop_components(simulator, driver, &self.watch);
        }
        verdict
    }

    /// Ends the loop and returns the times of its steps.
    pub fn finish(self) -> Stopwatch {
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
    /// The number of the next frame: above `frames` by those that were skipped.
    sequence: u64,
    /// When frame 0 was due, in real time.
    began: Instant,
    /// Whether the simulator has built this scenario.
    on_the_road: bool,
    state: State,
    /// What the driver said last.
    control: Control,
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
            sequence: 0,
            began: Instant::now(),
            on_the_road: false,
            state: State::default(),
            control: Control::default(),
            cause: Cause::Error,
        }
    }

    fn drive<W: Witness>(&mut self, worker: &mut Worker<'_, W>, progress: &ProgressBar) -> Result<(), Fault> {
        let (registry, seed) = (worker.registry, worker.settings.seed);
        let make = || Chain::new(registry, &self.spec.perturbations, seed, self.index);
        let mut chain = worker.watch.call(self.label, make).map_err(Fault::Component)?;
        let result = self.drive_through(worker, &mut chain, progress);
        worker.watch.call(self.label, || drop(chain));
        result
    }

    fn drive_through<W: Witness>(
        &mut self,
        worker: &mut Worker<'_, W>,
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
        worker.witness.event(0.0, false, &self.spec.name);
        self.began = Instant::now();
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
    fn step<W: Witness>(
        &mut self,
        worker: &mut Worker<'_, W>,
        chain: &mut Chain,
    ) -> Result<Option<Cause>, Fault> {
        let Worker { plan, simulator, driver, camera, bus, witness, watch, stopwatch, .. } = worker;
        let (width, height) = (camera.width as usize, camera.height as usize);
        let sequence = self.sequence;
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
        witness.step(&Step { sequence, state, control, frame_hash }, raw_frame, perturbed_frame);
        self.frames += 1;
        self.sequence += 1;
        self.state = state;
        let end = self.observer.step(sequence, state, control);
        if end.is_none() {
            let period = Duration::from_secs_f64(1.0 / camera.rate);
            let skipped = match plan.mode {
                Mode::Lockstep => 0,
                Mode::Realtime => witness.skipped(sequence).unwrap_or_else(|| self.missed(sequence, period)),
            };
            let mut act = |control| {
                stopwatch
                    .measure(Stage::Simulator, || watch.call(SIMULATOR, || simulator.act(control)))
                    .map_err(simulator_fault)
            };
            // While the driver was thinking, what it had said before held.
            for _ in 0..skipped {
                act(self.control)?;
            }
            act(control)?;
            self.sequence += skipped;
            self.control = control;
            if plan.mode == Mode::Realtime && witness.skipped(sequence).is_none() {
                stopwatch.wait(self.due(self.sequence, period));
            }
        }
        Ok(end)
    }

    /// When a frame is due, in real time.
    fn due(&self, sequence: u64, period: Duration) -> Instant {
        self.began + period.mul_f64(sequence as f64)
    }

    /// How many frames went by since this one was due, besides the next.
    fn missed(&self, sequence: u64, period: Duration) -> u64 {
        let late = Instant::now().saturating_duration_since(self.due(sequence, period));
        (late.as_secs_f64() / period.as_secs_f64()) as u64
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
            mode: plan.mode,
            skipped_frames: (self.sequence - self.frames),
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
