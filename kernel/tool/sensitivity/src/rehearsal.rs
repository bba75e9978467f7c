//! A drive in this process, which can be put back to any of its frames.

use pdk_chain::chain::Chain;
use pdk_chain::moment::{Labels, Moment};
use pdk_components::held::Held;
use pdk_components::registry::Registry;
use pdk_loop::drive::expected_frames;
use pdk_loop::judge::Judge;
use pdk_loop::way::Way;
use pdk_model::component::ComponentSpec;
use pdk_model::outcome::Cause;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_model::scenario::{Mode, Scenario};
use pdk_record::trace::step::Digest;
use pdk_sdk::describe::{ActsOn, Kind};
use pdk_sdk::error::{Error, ErrorKind, Result};
use pdk_sdk::prelude::{
    Annotations, Camera, Control, DriveContext, Driver, FrameBuf, SavedNumber, Simulator, State,
};
use pdk_sdk::signals::Numbers;
use pdk_supervise::calls::Function;
use serde_json::Value;
use twox_hash::XxHash3_64;

/// The only slot there is here.
const SLOT: u32 = 0;

/// A frame of a drive: all that decides what follows.
#[derive(Debug, Clone)]
pub struct Place {
    /// Its number, from 0.
    pub frame: u64,
    /// What the simulator saved.
    pub saved: Vec<f64>,
    /// The state.
    pub state: State,
    /// How far the vehicle has driven.
    way: Way,
    travelled: f64,
}

impl Place {
    /// The same frame, in another state.
    pub fn in_state(&self, state: State) -> Self {
        Self { state, ..self.clone() }
    }
}

/// What was decided at a frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Decision {
    /// The control of the driver.
    pub control: Control,
    /// The control as it was applied.
    pub applied: Control,
    /// What the driver got besides the frame, if a perturbation acts on that.
    pub observed: Option<Numbers>,
    /// Hash of the frame that the driver saw.
    pub frame_hash: u64,
}

/// A drive from its start to its end.
pub struct Driven {
    /// Its frames.
    pub places: Vec<Place>,
    /// What was decided in each of them.
    pub decisions: Vec<Decision>,
    /// How it ended.
    pub cause: Cause,
    /// As in the outcome of a scenario.
    pub digest: String,
}

impl Driven {
    /// The frame with the largest cross-track error, and that error in metres.
    pub fn worst(&self) -> (usize, f64) {
        let mut worst = (0, 0.0);
        for (frame, place) in self.places.iter().enumerate() {
            let error = place.state.cross_track_error.abs();
            if error > worst.1 {
                worst = (frame, error);
            }
        }
        worst
    }
}

/// What a scenario is driven with.
pub struct Rehearsal<'a> {
    registry: &'a Registry,
    scenario: Scenario,
    simulator: Held<dyn Simulator>,
    driver: Held<dyn Driver>,
    camera: Camera,
    numbers: Vec<SavedNumber>,
    /// What the camera saw last, and what the driver saw of it.
    raw: FrameBuf,
    perturbed: FrameBuf,
    labels: Option<(Vec<String>, Vec<u8>)>,
    depth: Option<Vec<f32>>,
}

impl<'a> Rehearsal<'a> {
    /// Makes what a scenario is driven with.
    ///
    /// # Errors
    /// If a component cannot be made, the scenario is driven in real time, or the simulator cannot be put back.
    pub fn new(registry: &'a Registry, scenario: &Scenario) -> Result<Self> {
        if scenario.mode == Mode::Realtime {
            return Err(Error::new(
                "it is driven in real time, where a drive depends on how fast the machine is; ask about a drive in lockstep",
            ));
        }
        let ComponentSpec { name, parameters } = &scenario.simulator;
        let simulator = registry.simulator(name, parameters)?.0;
        let mut simulator = Held::new(Kind::Simulator, scenario.simulator.clone(), simulator);
        let camera = simulator.call(Function::Camera, None, |simulator| Ok(simulator.camera()))?;
        let numbers = simulator.call(Function::Restore, None, |simulator| Ok(simulator.saved_numbers()))?;
        if numbers.is_empty() {
            return Err(Error::new(format!(
                "the simulator `{name}` cannot be put back to a frame, without which a drive has no derivative; use one that can, such as the \
                 embedded one"
            )));
        }
        let ComponentSpec { name, parameters } = &scenario.driver;
        let driver = registry.driver(name, parameters)?.0;
        let driver = Held::new(Kind::Driver, scenario.driver.clone(), driver);
        let size = [camera.width as usize, camera.height as usize];
        let frame = || FrameBuf::new(size[0], size[1]);
        let (raw, perturbed) = (frame(), frame());
        let mut rehearsal = Self {
            registry,
            scenario: scenario.clone(),
            simulator,
            driver,
            camera,
            numbers,
            raw,
            perturbed,
            labels: None,
            depth: None,
        };
        let Annotations { labels, depth } = rehearsal.chain(&scenario.perturbations)?.annotations();
        let pixels = size[0] * size[1];
        if labels {
            let names =
                rehearsal.simulator.call(Function::Labels, None, |simulator| Ok(simulator.label_names()))?;
            rehearsal.labels = Some((names, vec![0; pixels]));
        }
        rehearsal.depth = depth.then(|| vec![0.0; pixels]);
        Ok(rehearsal)
    }

    /// The scenario.
    pub fn scenario(&self) -> &Scenario {
        &self.scenario
    }

    /// The camera.
    pub fn camera(&self) -> Camera {
        self.camera
    }

    /// About this many frames the scenario has at most.
    pub fn frames(&self) -> usize {
        expected_frames(&self.scenario, self.camera.rate) as usize
    }

    /// The names of the scenario's perturbations that act on this.
    pub fn acting_on(&self, what: ActsOn) -> Vec<String> {
        let acts = |name: &&String| {
            let entry = self.registry.catalog().get(Kind::Perturbation, name);
            entry.is_ok_and(|entry| entry.description.acts_on == what)
        };
        let names = self.scenario.perturbations.iter().map(|applied| &applied.name);
        names.filter(acts).map(|name| format!("`{name}`")).collect()
    }

    /// What the simulator saves.
    pub fn numbers(&self) -> &[SavedNumber] {
        &self.numbers
    }

    /// The frame that the camera saw last.
    pub fn raw(&self) -> &FrameBuf {
        &self.raw
    }

    /// What the driver saw of it.
    pub fn perturbed(&self) -> &FrameBuf {
        &self.perturbed
    }

    /// The scenario's chain with other courses of levels.
    ///
    /// # Errors
    /// If a perturbation cannot be made, or shows something of earlier frames.
    pub fn chain(&self, perturbations: &[AppliedPerturbation]) -> Result<Chain> {
        let scenario = Scenario { perturbations: perturbations.to_vec(), ..self.scenario.clone() };
        let chain = Chain::of_scenario(self.registry, &scenario)?;
        match chain.history() {
            0 => Ok(chain),
            _ => Err(Error::new(format!(
                "what {} does to a frame depends on earlier frames, and the derivative of a drive is for perturbations that do without",
                scenario.default_name()
            ))),
        }
    }

    /// Drives from the start until the scenario is over. The driver keeps what it knows of earlier frames, as in any drive.
    ///
    /// # Errors
    /// If a component fails.
    pub fn drive(&mut self, chain: &mut Chain, frame_done: &mut dyn FnMut()) -> Result<Driven> {
        let start = self.start()?;
        self.drive_from(start, chain, frame_done)
    }

    /// Drives from a start where the simulation is.
    ///
    /// # Errors
    /// If a component fails.
    pub fn drive_from(
        &mut self,
        mut place: Place,
        chain: &mut Chain,
        frame_done: &mut dyn FnMut(),
    ) -> Result<Driven> {
        let mut judge = Judge::new(&self.scenario);
        let (mut places, mut decisions) = (Vec::new(), Vec::new());
        let mut digest = Digest::default();
        self.driver.call(Function::Reset, None, |driver| driver.reset())?;
        loop {
            self.render(&place)?;
            let decision = self.decide(chain, &place)?;
            digest.add(decision.frame_hash, &decision.control);
            let end = judge.look(&place.state);
            frame_done();
            let next = match end {
                None => Some(self.act(&place, decision.applied)?),
                Some(_) => None,
            };
            places.push(place);
            decisions.push(decision);
            match (next, end) {
                (Some(next), _) => place = next,
                (None, Some(cause)) => return Ok(Driven { places, decisions, cause, digest: digest.text() }),
                (None, None) => return Err(Error::new("a drive has no end, which is a defect in pdk")),
            }
        }
    }

    /// Puts the simulation to the start of another road.
    ///
    /// # Errors
    /// If the simulator fails, or refuses the road.
    pub fn start_on(&mut self, road: Value) -> Result<Place> {
        self.scenario.road = road;
        self.start()
    }

    fn start(&mut self) -> Result<Place> {
        let Self { simulator, scenario, labels, depth, numbers, .. } = self;
        let annotations = Annotations { labels: labels.is_some(), depth: depth.is_some() };
        simulator.call(Function::Annotate, None, |simulator| {
            simulator.annotate(annotations);
            Ok(())
        })?;
        let state = simulator.call(Function::Reset, None, |simulator| simulator.reset(scenario, SLOT))?;
        let mut way = Way::default();
        let travelled = way.reach(state.time, state.speed);
        let mut saved = vec![0.0; numbers.len()];
        simulator.call(Function::Save, Some(0), |simulator| simulator.save(&mut saved))?;
        Ok(Place { frame: 0, saved, state, way, travelled })
    }

    /// Puts the simulation to a frame with these numbers, and returns the state there.
    ///
    /// # Errors
    /// If the simulator fails.
    pub fn restore(&mut self, frame: u64, saved: &[f64]) -> Result<State> {
        self.simulator.call(Function::Restore, Some(frame), |simulator| simulator.restore(frame, saved))
    }

    /// Renders what the camera sees where the simulation is, which is at `place` or near it.
    ///
    /// # Errors
    /// If the simulator fails.
    pub fn render(&mut self, place: &Place) -> Result<State> {
        let Self { simulator, raw, labels, depth, .. } = self;
        let at = Some(place.frame);
        let state = simulator.call(Function::Frame, at, |simulator| simulator.frame(raw.as_mut()))?;
        if let Some((_, pixels)) = labels.as_mut().filter(|(names, _)| !names.is_empty()) {
            simulator.call(Function::Labels, at, |simulator| simulator.labels(pixels))?;
        }
        if let Some(depth) = depth {
            simulator.call(Function::Depth, at, |simulator| simulator.depth(depth))?;
        }
        Ok(state)
    }

    /// Perturbs the frame that was rendered last and lets the driver decide, for the frame `place`.
    ///
    /// # Errors
    /// If a component fails.
    pub fn decide(&mut self, chain: &mut Chain, place: &Place) -> Result<Decision> {
        let Self { driver, raw, perturbed, labels, depth, camera, .. } = self;
        let Place { frame, state, .. } = *place;
        let moment = moment(place, labels, depth, camera);
        chain.apply(raw.as_ref(), perturbed.as_mut(), &moment)?;
        let told = DriveContext { frame_index: frame, time: state.time, speed: state.speed };
        let observed = chain.pass(ActsOn::Observation, told.numbers(), &moment)?;
        let cx = observed.map_or(told, |[time, speed]| DriveContext { time, speed, ..told });
        let control = driver
            .call(Function::Drive, Some(frame), |driver| driver.drive(perturbed.as_ref(), &cx)?.checked())?;
        let applied = applied(chain, control, &moment)?;
        let frame_hash = XxHash3_64::oneshot(perturbed.as_ref().data());
        Ok(Decision { control, applied, observed, frame_hash })
    }

    /// What is applied to the vehicle at `place` if this is the driver's control.
    ///
    /// # Errors
    /// If a perturbation fails.
    pub fn applied(&self, chain: &mut Chain, place: &Place, control: Control) -> Result<Control> {
        applied(chain, control, &moment(place, &self.labels, &self.depth, &self.camera))
    }

    /// The same for a driver that has seen nothing yet.
    ///
    /// # Errors
    /// If a component fails.
    pub fn decide_alone(&mut self, chain: &mut Chain, place: &Place) -> Result<Decision> {
        self.driver.call(Function::Reset, Some(place.frame), |driver| driver.reset())?;
        self.decide(chain, place)
    }

    /// How the steering at a frame changes with each byte of what the driver saw last.
    ///
    /// # Errors
    /// If the driver cannot say.
    pub fn gradient(&mut self, place: &Place, decision: &Decision, into: &mut [f32]) -> Result<f64> {
        let Self { driver, perturbed, .. } = self;
        let State { time, speed, .. } = place.state;
        let [time, speed] = decision.observed.unwrap_or([time, speed]);
        let cx = DriveContext { frame_index: place.frame, time, speed };
        driver.call(Function::Gradient, Some(place.frame), |driver| {
            driver.gradient(perturbed.as_ref(), &cx, into)
        })
    }

    /// Takes a gradient back from the frame that the driver saw at `place` to the picture that the last perturbation shows, and adds it to `into`.
    ///
    /// # Errors
    /// If no perturbation shows one, or it cannot say.
    pub fn picture_gradient(
        &mut self,
        chain: &mut Chain,
        place: &Place,
        of_frame: &[f32],
        into: &mut [f32],
    ) -> Result<()> {
        let Self { perturbed, labels, depth, camera, .. } = self;
        let size = [perturbed.width(), perturbed.height()];
        chain.picture_gradient(of_frame, size, &moment(place, labels, depth, camera), into)
    }

    /// Applies a control where the simulation is, which is at `place` or near it, and returns the next frame.
    ///
    /// # Errors
    /// If the simulator fails, or a state is none that a vehicle can be in.
    pub fn act(&mut self, place: &Place, applied: Control) -> Result<Place> {
        let Self { simulator, numbers, .. } = self;
        let state = simulator.call(Function::Act, Some(place.frame), |simulator| simulator.act(applied))?;
        state.check().map_err(|error| error.at(simulator.label()))?;
        let frame = place.frame + 1;
        let mut saved = vec![0.0; numbers.len()];
        simulator.call(Function::Save, Some(frame), |simulator| simulator.save(&mut saved))?;
        let mut way = place.way;
        let travelled = way.reach(state.time, state.speed);
        Ok(Place { frame, saved, state, way, travelled })
    }

    /// Checks that a drive is the recorded one.
    ///
    /// # Errors
    /// If it is not.
    pub fn check_same(driven: &Driven, digest: &str) -> Result<()> {
        match driven.digest == digest {
            true => Ok(()),
            false => Err(Error::of(
                ErrorKind::Nonsense,
                "the drive is not the recorded one; `pdk replay` says where they differ",
            )),
        }
    }
}

/// What becomes of a control on its way to the vehicle.
fn applied(chain: &mut Chain, control: Control, moment: &Moment<'_>) -> Result<Control> {
    let applied = chain.pass(ActsOn::Control, control.numbers(), moment)?;
    Ok(applied.map_or(control, Control::from_numbers))
}

/// What perturbations know of a frame.
fn moment<'a>(
    place: &Place,
    labels: &'a Option<(Vec<String>, Vec<u8>)>,
    depth: &'a Option<Vec<f32>>,
    camera: &Camera,
) -> Moment<'a> {
    let Place { frame, state, travelled, .. } = place;
    Moment::new(*frame, state.time)
        .at_speed(state.speed)
        .after(*travelled)
        .at_rate(camera.rate)
        .with_labels(labels.as_ref().map(|(names, pixels)| Labels { names, pixels }))
        .with_depth(depth.as_deref())
}
