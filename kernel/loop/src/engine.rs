//! Does jobs, one after the other, with instances and topics that it keeps as long as the next job needs the same.

use std::path::PathBuf;
use std::sync::Mutex;

use pdk_bus::Bus;
use pdk_chain::chain::Chain;
use pdk_chain::view::View;
use pdk_components::held::{Held, keep};
use pdk_components::registry::Registry;
use pdk_model::component::ComponentSpec;
use pdk_model::outcome::Outcome;
use pdk_sdk::describe::{Description, Kind};
use pdk_sdk::error::{Error, ErrorKind, Result};
use pdk_sdk::prelude::{Camera, Candidate, Dataset, Driver, Key, Search, Simulator};
use pdk_supervise::calls::Function;

use crate::drive::{Instances, Run, Witnesses};
use crate::environment::Environment;
use crate::evaluate::{self, Evaluator};
use crate::fault::Fault;
use crate::protocol::{Answer, Drive, Driven, Hello, Job, Made, Make, SearchStep, StartSearch, Work};
use crate::recent::Recent;
use crate::recorder::Recorder;
use crate::sequences;
use crate::stages::Stopwatch;

/// The folder of this process's topics, for the thread that takes them off the machine when the process has to end at once.
pub static BUS_ROOT: Mutex<Option<PathBuf>> = Mutex::new(None);

/// How often a scenario is driven whose simulator, a program of its own, is lost or late in the middle of it.
const TRIES: u32 = 3;

/// The camera of a simulator that has not told of it.
const NO_CAMERA: Camera = Camera { width: 0, height: 0, rate: 0.0 };

/// A worker's instances and topics.
pub struct Engine<'a> {
    registry: &'a Registry,
    run: String,
    simulator: Option<Held<dyn Simulator>>,
    camera: Camera,
    driver: Option<Held<dyn Driver>>,
    evaluator: Option<Evaluator>,
    strategy: Option<Held<dyn Search>>,
    bus: Option<(Bus, u32, u32)>,
    recorder: Option<Recorder>,
    recent: Recent,
    stopwatch: Stopwatch,
    /// What a user should know about the maps of the last drive.
    noticed: Vec<String>,
    environment: Environment,
}

impl<'a> Engine<'a> {
    /// An engine for the run that sent `hello`. `environment` is the process's environment before components were loaded.
    pub fn new(registry: &'a Registry, hello: &Hello, environment: Environment) -> Self {
        Self {
            registry,
            run: hello.run.clone(),
            simulator: None,
            camera: NO_CAMERA,
            driver: None,
            evaluator: None,
            strategy: None,
            bus: None,
            recorder: None,
            recent: Recent::default(),
            stopwatch: Stopwatch::new(),
            noticed: Vec::new(),
            environment,
        }
    }

    /// Whether this process can do another job; else it has to make room for a new one.
    pub fn is_usable(&self) -> bool {
        self.environment.has_standard_files()
    }

    /// Does a job. `progress` is called for every frame.
    pub fn work(&mut self, job: &Job, progress: &mut dyn FnMut(u64)) -> Answer {
        if let Err(error) = check(job) {
            return Answer::Broken(error.into());
        }
        let answer = match &job.work {
            Work::Drive(drive) => {
                // One program serves one instance at a time.
                self.evaluator = None;
                match self.drive(drive, job, progress) {
                    Ok(driven) => Answer::Driven(driven),
                    Err(error) => Answer::Broken(error.into()),
                }
            }
            Work::Evaluate(frames) => {
                // As above.
                self.driver = None;
                match evaluate::frames(&mut self.evaluator, self.registry, frames, progress) {
                    Ok(evaluated) => Answer::Evaluated(evaluated),
                    // It says nothing about the frames.
                    Err(error) if error.kind() == ErrorKind::Configuration => Answer::Broken(error.into()),
                    Err(error) => Answer::Failed(error.into()),
                }
            }
            Work::Make(make) => {
                self.make(make).map_or_else(|error| Answer::Failed(error.into()), Answer::Made)
            }
            Work::InputFiles(Make { kind, component: ComponentSpec { name, parameters } }) => {
                let listed = self.registry.input_files(*kind, name, parameters);
                listed.map_or_else(|error| Answer::Failed(error.into()), Answer::InputFiles)
            }
            Work::Search(step) => {
                let proposed = self.search(step);
                if proposed.as_ref().is_err_and(|error| error.kind() == ErrorKind::Panic) {
                    // What panicked may be in any state.
                    self.strategy = None;
                }
                proposed.map_or_else(|error| Answer::Failed(error.into()), Answer::Proposed)
            }
        };
        let changed = self.environment.restore();
        match answer {
            Answer::Driven(mut driven) => {
                driven.warnings.extend(changed);
                Answer::Driven(driven)
            }
            other => other,
        }
    }

    fn make(&self, make: &Make) -> Result<Made> {
        let Make { kind, component: ComponentSpec { name, parameters } } = make;
        let component = make.component.clone();
        let mut made = Made::default();
        match kind {
            Kind::Simulator => {
                let instance = self.registry.simulator(name, parameters)?.0;
                let mut held = Held::new(*kind, component, instance);
                made.camera = Some(held.call(Function::Camera, None, |simulator| Ok(simulator.camera()))?);
            }
            Kind::Driver => {
                let instance = self.registry.driver(name, parameters)?.0;
                let mut held = Held::new(*kind, component, instance);
                made.info = held.call(Function::Info, None, |driver| Ok(driver.info()))?;
            }
            Kind::Predictor => {
                let instance = self.registry.predictor(name, parameters)?.0;
                let mut held = Held::new(*kind, component, instance);
                made.info = held.call(Function::Info, None, |predictor| Ok(predictor.info()))?;
            }
            Kind::Dataset => {
                let instance: Box<dyn Dataset> = self.registry.dataset(name, parameters)?.0;
                let mut held = Held::new(*kind, component, instance);
                let frames = held.call(Function::Len, None, |dataset| Ok(dataset.len()))?;
                let position = |index| {
                    held.call(Function::Position, Some(index as u64), |dataset| Ok(dataset.position(index)))
                };
                let positions: Vec<_> = (0..frames).map(position).collect::<Result<_>>()?;
                (made.frames, made.sequences) = (Some(frames), sequences::starts(&positions));
                made.info = held.call(Function::Info, None, |dataset| Ok(dataset.info()))?;
            }
            // Nothing is asked of the others.
            kind => {
                let (instance, _) = self.registry.create(*kind, name, parameters)?;
                drop(Held::new(*kind, component, Box::new(instance)));
            }
        }
        Ok(made)
    }

    /// Takes a step of a search.
    fn search(&mut self, step: &SearchStep) -> Result<Vec<Candidate>> {
        if let Some(StartSearch { strategy, problem, key }) = &step.start {
            self.strategy = None;
            let instance = self.registry.search(&strategy.name, &strategy.parameters)?.0;
            let mut held = Held::new(Kind::Search, strategy.clone(), instance);
            held.call(Function::Start, None, |strategy| strategy.start(problem, &Key(*key)))?;
            self.strategy = Some(held);
        }
        let Some(strategy) = &mut self.strategy else {
            return Err(Error::of(
                ErrorKind::Lost,
                "the process of the search strategy was ended from outside, and what it had learnt with it; continue the run \
                 with --out and its folder",
            ));
        };
        if !step.tell.is_empty() {
            strategy.call(Function::Tell, None, |strategy| strategy.tell(&step.tell))?;
        }
        match step.ask {
            0 => Ok(Vec::new()),
            n => strategy.call(Function::Ask, None, |strategy| strategy.ask(n)),
        }
    }

    /// Drives a scenario. A component that fails is its outcome.
    ///
    /// # Errors
    /// If the record or the routing fails, or the machine or its set-up, which says nothing about the scenario.
    fn drive(&mut self, drive: &Drive, job: &Job, progress: &mut dyn FnMut(u64)) -> Result<Driven> {
        let external = self.simulator_of(drive).is_ok_and(|description| description.external);
        let mut warnings = Vec::new();
        let (run, error) = loop {
            if let Some(path) = &drive.trace {
                let recorder = match self.recorder.take() {
                    Some(recorder) => recorder,
                    None => Recorder::new()?,
                };
                recorder.start(path, &job.id(drive));
                self.recorder = Some(recorder);
            }
            let mut run = Run::new(drive, job.number, job.slot);
            let error = match self.drive_through(drive, &mut run, job.slot, progress) {
                Ok(()) => break (run, None),
                Err(Fault::Kernel(error)) => return Err(error),
                Err(Fault::Component(error) | Fault::Simulator(error))
                    if error.kind() == ErrorKind::Configuration =>
                {
                    (self.simulator, self.driver, self.bus) = (None, None, None);
                    return Err(error);
                }
                Err(Fault::Component(error)) => break (run, Some(error)),
                Err(Fault::Simulator(error)) => error,
            };
            if !external || !matches!(error.kind(), ErrorKind::Lost | ErrorKind::Late) {
                break (run, Some(error));
            }
            // The program is gone or does not answer, which says nothing about the scenario.
            (self.simulator, self.driver, self.bus) = (None, None, None);
            if !run.is_under_way() {
                // The wait for it failed, so the next scenario would wait just as long.
                return Err(error);
            }
            if warnings.len() + 1 == TRIES as usize {
                break (run, Some(error));
            }
            warnings
                .push(format!("{}, so that a scenario was driven again from its beginning", error.message()));
        };
        let recorder = self.recorder.as_ref().filter(|_| drive.trace.is_some());
        let witnesses = Witnesses {
            recorder,
            recent: &mut self.recent,
            stopwatch: &mut self.stopwatch,
            progress: &mut |_| {},
        };
        let outcome: Outcome = run.into_outcome(error.as_ref(), self.camera, &witnesses);
        let recorded = recorder.map_or(Ok(()), Recorder::finish);
        if error.is_some() {
            // What failed may be in any state, the topics among it.
            (self.simulator, self.driver, self.bus) = (None, None, None);
        }
        recorded?;
        warnings.append(&mut self.noticed);
        Ok(Driven { outcome, rate: self.camera.rate, times: self.stopwatch.times(), warnings })
    }

    /// What the simulator of a scenario says of itself.
    fn simulator_of(&self, drive: &Drive) -> Result<&'a Description> {
        Ok(&self.registry.catalog().get(Kind::Simulator, &drive.scenario.simulator.name)?.description)
    }

    fn drive_through(
        &mut self,
        drive: &Drive,
        run: &mut Run<'_>,
        slot: u32,
        progress: &mut dyn FnMut(u64),
    ) -> Result<(), Fault> {
        let scenario = &drive.scenario;
        let registry = self.registry;
        let clock = self.simulator_of(drive).map_err(Fault::Component)?.clock;
        let held = self.simulator.as_ref().is_some_and(|held| *held.component() == scenario.simulator);
        self.stopwatch.start(None);
        if !held {
            self.camera = NO_CAMERA;
        }
        let simulator = keep(&mut self.simulator, Kind::Simulator, &scenario.simulator, || {
            Ok(registry.simulator(&scenario.simulator.name, &scenario.simulator.parameters)?.0)
        })
        .map_err(Fault::Component)?;
        if !held {
            self.camera = simulator
                .call(Function::Camera, None, |simulator| Ok(simulator.camera()))
                .map_err(Fault::Component)?;
        }
        let camera = self.camera;
        let driver = keep(&mut self.driver, Kind::Driver, &scenario.driver, || {
            Ok(registry.driver(&scenario.driver.name, &scenario.driver.parameters)?.0)
        })
        .map_err(Fault::Component)?;
        let mut chain = Chain::of_scenario(registry, scenario).map_err(Fault::Component)?;
        let by = drive.view.as_ref();
        let mut view =
            by.map(|by| View::new(registry, by, scenario.seed)).transpose().map_err(Fault::Component)?;
        let bus = topics(&mut self.bus, &self.run, slot, camera)?;
        let recorder = self.recorder.as_ref().filter(|_| drive.trace.is_some());
        let driven = run.drive(
            &mut Instances { simulator, camera, clock, chain: &mut chain, driver, bus, view: view.as_mut() },
            &mut Witnesses { recorder, recent: &mut self.recent, stopwatch: &mut self.stopwatch, progress },
        );
        self.noticed = chain.noticed();
        driven
    }
}

/// The topics for frames of this size, which are kept as long as the size is the same.
fn topics<'a>(
    kept: &'a mut Option<(Bus, u32, u32)>,
    run: &str,
    slot: u32,
    camera: Camera,
) -> Result<&'a Bus, Fault> {
    let size = (camera.width, camera.height);
    if kept.as_ref().is_some_and(|(_, width, height)| (*width, *height) != size) {
        *kept = None;
    }
    let (bus, ..) = match kept {
        Some(bus) => bus,
        None => {
            let bus = Bus::create(run, slot, size.0, size.1)
                .map_err(|error| Fault::Kernel(Error::new(error.to_string())))?;
            if let Ok(mut root) = BUS_ROOT.lock() {
                *root = Some(bus.root().to_owned());
            }
            kept.insert((bus, size.0, size.1))
        }
    };
    Ok(bus)
}

/// Refuses what no session of this pdk asks for: a scenario with fields that are not known here, levels that are not on the scale, and
/// criteria of failure that nothing can meet.
fn check(job: &Job) -> Result<()> {
    let perturbations = match &job.work {
        Work::Drive(drive) => {
            let id = drive.scenario.id();
            if let Some(asked) = job.scenario.filter(|asked| !job.moved && *asked != id) {
                return Err(Error::of(
                    ErrorKind::Configuration,
                    format!(
                        "the session's scenario {asked} is {id} for this worker, whose pdk {} does not know all of its fields; use the same pdk at \
                         both ends",
                        env!("CARGO_PKG_VERSION")
                    ),
                ));
            }
            drive.scenario.failure.check()?;
            &drive.scenario.perturbations
        }
        Work::Evaluate(frames) => {
            return frames.perturbation.iter().try_for_each(|applied| applied.level.check(&applied.name));
        }
        Work::Make(_) | Work::InputFiles(_) | Work::Search(_) => return Ok(()),
    };
    perturbations.iter().try_for_each(|applied| applied.level.check(&applied.name))
}
