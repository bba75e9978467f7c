//! Simulators: components that render frames and move the vehicle.

use std::cell::RefCell;
use std::ffi::c_void;

use pdk_abi::{SimulatorFunctionsRef, Sink, Status, Text, annotation, empty, state_flag, store};
pub use pdk_model::camera::Camera;
use pdk_model::component::ComponentSpec;
pub use pdk_model::scenario::Scenario;
pub use pdk_model::state::State;
use pdk_ops::{FrameBuf, FrameMut};
use serde::{Deserialize, Serialize};

use super::driver::Control;
use crate::abi::convert::{self, Crosses};
use crate::abi::host::call::{Object, call, collect, needed};
use crate::abi::plugin::call::{functions, put};
use crate::config::Config;
use crate::describe::Description;
use crate::error::{Error, ErrorKind, Result};
use crate::testing::sample::{Make, ensure};
use crate::timeline::{Timeline, Told};

/// What a simulator is asked for besides frames.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Annotations {
    /// [`labels`](Simulator::labels).
    pub labels: bool,
    /// [`depth`](Simulator::depth).
    pub depth: bool,
}

/// A number of what a simulator saves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SavedNumber {
    /// What it is, with its unit, such as `heading (rad)`.
    pub name: String,
    /// A small change of it that shows in what follows, by which differences are taken; 0 if it is not to be changed by itself, because it
    /// follows from the others.
    pub step: f64,
    /// If it is an angle that begins anew after a turn, how much a turn is; 0 if not.
    #[serde(default)]
    pub period: f64,
}

/// Renders what the ego vehicle's camera sees and moves the vehicle.
///
/// The loop calls [`reset`](Simulator::reset) once a scenario, then [`frame`](Simulator::frame) and
/// [`act`](Simulator::act) in turn, once a step. In real time it calls `act` several times in a row where the driver was
/// still at work while frames went by.
///
/// A simulator with its own clock ([`Clock::Own`](crate::describe::Clock::Own)) goes on whatever the loop does. It is driven in real time
/// only, and `act` is called once a step: it applies the control, waits for the next frame after that, and returns its state. Frames
/// that came while the driver was at work are skipped; where one of them has a state that ends the scenario, that state is
/// returned instead. How many were skipped follows from the time in the state.
pub trait Simulator: Send {
    /// Size and rate of the camera. It does not change while the instance lives.
    fn camera(&self) -> Camera;

    /// Puts the vehicle at the start of a scenario. `slot` is the number of the worker that drives it, from 0: two that
    /// drive at the same time have different ones, so that each can take a network port of its own. Nothing else may
    /// depend on it. What reaches a plugin has no perturbations: a simulator shows the same world whatever is done to its
    /// pictures.
    ///
    /// # Errors
    /// If the scenario cannot be built or the simulator does not answer.
    fn reset(&mut self, scenario: &Scenario, slot: u32) -> Result<State>;

    /// Writes what the camera sees now, and returns the state that belongs to it.
    ///
    /// # Errors
    /// If the simulator does not deliver a frame.
    fn frame(&mut self, into: FrameMut<'_>) -> Result<State>;

    /// Applies a control, moves the simulation on by one frame, and returns the state after that: the one that the next
    /// [`frame`](Simulator::frame) returns as well. So every state is judged, also that of a frame that is not used.
    ///
    /// # Errors
    /// If the simulator does not take the control.
    fn act(&mut self, control: Control) -> Result<State>;

    /// The centre line of the driven lane as `[x, height, z]` in metres, for the record; empty if it is not known.
    fn waypoints(&self) -> Vec<[f64; 3]> {
        Vec::new()
    }

    /// What a simulator that is a program of its own has told of itself by now, such as its version: names and values for people.
    fn info(&self) -> Vec<(String, String)> {
        Vec::new()
    }

    /// Says which annotations will be asked for in the scenarios that follow, before [`reset`](Simulator::reset): a simulator that
    /// needs a sensor of its own for them has time to make one. By default, none are asked for.
    fn annotate(&mut self, annotations: Annotations) {
        let _ = annotations;
    }

    /// What the simulator can tell apart in its frames, 256 at most; empty if it labels nothing. If it fits, the names are
    /// `sky`, `road`, `marking`, `vehicle`, `pedestrian`, `vegetation`, `building` and `ground`, so that users find the same ones
    /// everywhere. They do not change while the instance lives.
    fn label_names(&self) -> Vec<String> {
        Vec::new()
    }

    /// Writes for each pixel of the frame that was rendered last the place of what it shows among
    /// [`label_names`](Simulator::label_names), row by row. It is called behind [`frame`](Simulator::frame) if it is needed.
    ///
    /// # Errors
    /// If the simulator labels nothing, or fails.
    fn labels(&mut self, into: &mut [u8]) -> Result<()> {
        let _ = into;
        Err(Error::new("it does not label its frames"))
    }

    /// Writes for each pixel of the frame that was rendered last how far away it is along the optical axis, in metres, row by row;
    /// infinite for the sky. It is called behind [`frame`](Simulator::frame) if it is needed.
    ///
    /// # Errors
    /// If the simulator does not know depths, or fails.
    fn depth(&mut self, into: &mut [f32]) -> Result<()> {
        let _ = into;
        Err(no_depth())
    }

    /// The numbers that, with the scenario and the number of a frame, decide all that follows, for a simulator that can be put back to a
    /// frame: position, heading, speed, and whatever else it remembers of the drive. Empty by default: it cannot be put back. They do
    /// not change while the instance lives.
    fn saved_numbers(&self) -> Vec<SavedNumber> {
        Vec::new()
    }

    /// Writes those numbers as they are now, in the same order.
    ///
    /// # Errors
    /// If the simulator cannot be put back, or has no scenario yet.
    fn save(&mut self, into: &mut [f64]) -> Result<()> {
        let _ = into;
        Err(cannot_be_put_back())
    }

    /// Puts the simulation to frame `frame` of the scenario, counted from its start, with these numbers, and returns the state there. With the numbers that
    /// were saved at that frame, all that follows is as it was, bit for bit; with others, it is as if the vehicle had come there that way.
    ///
    /// # Errors
    /// If the simulator cannot be put back, or not to such numbers.
    fn restore(&mut self, frame: u64, saved: &[f64]) -> Result<State> {
        let _ = (frame, saved);
        Err(cannot_be_put_back())
    }
}

/// The error of a simulator that cannot be put back.
fn cannot_be_put_back() -> Error {
    Error::new(
        "it cannot be put back to an earlier frame; use a simulator that can, such as the embedded one",
    )
}

/// The error of a simulator that does not know depths.
fn no_depth() -> Error {
    Error::new(
        "it does not report how far away pixels are, which `nearer`, `farther` and `depth=simulator` need; use a simulator that does",
    )
}

/// What a simulator is asked for, as it crosses.
fn raw_annotations(annotations: Annotations) -> u64 {
    [(annotations.labels, annotation::LABELS), (annotations.depth, annotation::DEPTH)]
        .into_iter()
        .filter_map(|(wanted, number)| wanted.then_some(number))
        .sum()
}

/// What a simulator is asked for; what is not known here is left out.
fn read_annotations(numbers: u64) -> Annotations {
    Annotations { labels: numbers & annotation::LABELS != 0, depth: numbers & annotation::DEPTH != 0 }
}

impl Crosses for State {
    type Raw = pdk_abi::State;

    fn raw(self) -> pdk_abi::State {
        let Self { time, position, heading, speed, cross_track_error, progress, vehicle_ahead, .. } = self;
        let flag = |set: bool, flag: u64| if set { flag } else { 0 };
        pdk_abi::State {
            time,
            position,
            heading,
            speed,
            cross_track_error,
            progress,
            vehicle_ahead,
            flags: flag(self.lane_departure, state_flag::LANE_DEPARTURE)
                | flag(self.collision, state_flag::COLLISION)
                | flag(self.finished, state_flag::FINISHED),
            ..empty()
        }
    }

    fn from_raw(raw: pdk_abi::State) -> Self {
        let pdk_abi::State {
            time, position, heading, speed, cross_track_error, progress, vehicle_ahead, ..
        } = raw;
        Self {
            time,
            position,
            heading,
            speed,
            cross_track_error,
            progress,
            vehicle_ahead,
            lane_departure: raw.flags & state_flag::LANE_DEPARTURE != 0,
            collision: raw.flags & state_flag::COLLISION != 0,
            finished: raw.flags & state_flag::FINISHED != 0,
        }
    }
}

impl Crosses for Camera {
    type Raw = pdk_abi::Camera;

    fn raw(self) -> Self::Raw {
        let Self { width, height, rate } = self;
        pdk_abi::Camera { width, height, rate, ..empty() }
    }

    fn from_raw(raw: Self::Raw) -> Self {
        Self { width: raw.width, height: raw.height, rate: raw.rate }
    }
}

functions! { Simulator as SimulatorFunctions:
    fn camera(component, _, into: *mut pdk_abi::Camera) {
        store(component.camera().raw(), into);
        Ok(())
    }
    fn reset(component, _, scenario: Text, slot: u32, into: *mut pdk_abi::State) {
        let scenario = serde_json::from_str(convert::text(scenario)?)?;
        store(component.reset(&scenario, slot)?.raw(), into);
        Ok(())
    }
    fn frame(component, _, target: *const pdk_abi::FrameMut, into: *mut pdk_abi::State) {
        store(component.frame(convert::target(target)?)?.raw(), into);
        Ok(())
    }
    fn act(component, _, control: *const pdk_abi::Control, into: *mut pdk_abi::State) {
        store(component.act(Control::read(control))?.raw(), into);
        Ok(())
    }
    fn waypoints(component, _, waypoints: *const Sink) {
        put(waypoints, &serde_json::to_string(&component.waypoints())?);
        Ok(())
    }
    fn info(component, _, info: *const Sink) {
        put(info, &serde_json::to_string(&component.info())?);
        Ok(())
    }
    fn label_names(component, _, names: *const Sink) {
        put(names, &serde_json::to_string(&component.label_names())?);
        Ok(())
    }
    fn labels(component, _, into: *mut u8, length: usize) {
        component.labels(convert::slice_mut(into, length))
    }
    fn annotate(component, _, annotations: u64) {
        component.annotate(read_annotations(annotations));
        Ok(())
    }
    fn depth(component, _, into: *mut f32, length: usize) {
        component.depth(convert::slice_mut(into, length))
    }
    fn saved_numbers(component, _, numbers: *const Sink) {
        put(numbers, &serde_json::to_string(&component.saved_numbers())?);
        Ok(())
    }
    fn save(component, _, into: *mut f64, length: usize) {
        component.save(convert::slice_mut(into, length))
    }
    fn restore(component, _, frame: u64, saved: *const f64, length: usize, into: *mut pdk_abi::State) {
        store(component.restore(frame, convert::slice(saved, length))?.raw(), into);
        Ok(())
    }
}

/// An instance in a plugin.
pub(crate) struct Host {
    /// Behind a cell, because an instance is used by one at a time.
    object: RefCell<Object<SimulatorFunctionsRef>>,
    label_names: Vec<String>,
    saved_numbers: Vec<SavedNumber>,
    camera: Camera,
    waypoints: Vec<[f64; 3]>,
}

impl Host {
    pub(crate) fn new(object: Object<SimulatorFunctionsRef>) -> Result<Self> {
        let Object { pointer, functions, .. } = object;
        let mut camera = empty::<pdk_abi::Camera>();
        // SAFETY: everything lives through the call.
        call(|error| unsafe { functions.camera()(pointer, &mut camera, error) })?;
        let camera = Camera::from_raw(camera);
        let usable = |length: u32| (1..=1 << 14).contains(&length);
        if !usable(camera.width) || !usable(camera.height) || !(0.01..=100_000.0).contains(&camera.rate) {
            let sentence = format!(
                "the simulator's camera has {}x{} pixels at {:?} frames a second, which is out of range",
                camera.width, camera.height, camera.rate
            );
            return Err(Error::of(ErrorKind::Nonsense, sentence));
        }
        let label_names = match functions.label_names() {
            None => Vec::new(),
            Some(label_names) => {
                // SAFETY: both sinks live through the call.
                let names = collect(|text, error| unsafe { label_names(pointer, text, error) })?;
                serde_json::from_str(&names)?
            }
        };
        let saved_numbers = match functions.saved_numbers() {
            None => Vec::new(),
            Some(saved_numbers) => {
                // SAFETY: as above.
                let numbers = collect(|text, error| unsafe { saved_numbers(pointer, text, error) })?;
                serde_json::from_str(&numbers)?
            }
        };
        let waypoints = Vec::new();
        Ok(Self { object: RefCell::new(object), label_names, saved_numbers, camera, waypoints })
    }

    /// The instance and its functions, for one call.
    fn object(&mut self) -> (*mut c_void, SimulatorFunctionsRef) {
        let Object { pointer, functions, .. } = self.object.get_mut();
        (*pointer, *functions)
    }

    /// Makes a call that answers with a state.
    #[inline]
    fn state(
        &mut self,
        work: impl FnOnce(*mut c_void, SimulatorFunctionsRef, *mut pdk_abi::State, *const Sink) -> Status,
    ) -> Result<State> {
        let (pointer, functions) = self.object();
        let mut state = State::default().raw();
        call(|error| work(pointer, functions, &mut state, error))?;
        Ok(State::from_raw(state))
    }
}

impl Simulator for Host {
    fn camera(&self) -> Camera {
        self.camera
    }

    fn reset(&mut self, scenario: &Scenario, slot: u32) -> Result<State> {
        // If this one cannot be built, the road of the one before must not pass for its own.
        self.waypoints.clear();
        // What is done to the pictures is not the concern of the world that they show.
        let scenario = serde_json::to_string(&Scenario { perturbations: Vec::new(), ..scenario.clone() })?;
        let scenario = Text::new(scenario.as_bytes());
        // SAFETY: everything lives through the call.
        let state = self.state(|pointer, functions, into, error| unsafe {
            functions.reset()(pointer, scenario, slot, into, error)
        })?;
        let (pointer, functions) = self.object();
        // SAFETY: as above.
        let road = collect(|text, error| unsafe { functions.waypoints()(pointer, text, error) })?;
        self.waypoints = serde_json::from_str(&road).map_err(|error| {
            Error::of(ErrorKind::Nonsense, format!("its waypoints are not a list of [x, height, z] ({error}); return one point for each waypoint"))
        })?;
        Ok(state)
    }

    fn frame(&mut self, mut into: FrameMut<'_>) -> Result<State> {
        let target = convert::frame_mut(&mut into);
        // SAFETY: everything lives through the call.
        self.state(|pointer, functions, into, error| unsafe {
            functions.frame()(pointer, &target, into, error)
        })
    }

    fn act(&mut self, control: Control) -> Result<State> {
        let control = control.raw();
        // SAFETY: everything lives through the call.
        self.state(|pointer, functions, into, error| unsafe {
            functions.act()(pointer, &control, into, error)
        })
    }

    fn waypoints(&self) -> Vec<[f64; 3]> {
        self.waypoints.clone()
    }

    fn info(&self) -> Vec<(String, String)> {
        let object = self.object.borrow_mut();
        let Some(info) = object.functions.info() else { return Vec::new() };
        // SAFETY: both sinks live through the call.
        let told = collect(|text, error| unsafe { info(object.pointer, text, error) });
        // It is for people only, so that without it nothing is lost.
        told.ok().and_then(|told| serde_json::from_str(&told).ok()).unwrap_or_default()
    }

    fn label_names(&self) -> Vec<String> {
        self.label_names.clone()
    }

    fn labels(&mut self, into: &mut [u8]) -> Result<()> {
        let (pointer, functions) = self.object();
        let labels = needed(functions.labels(), "labels")?;
        // SAFETY: everything lives through the call.
        call(|error| unsafe { labels(pointer, into.as_mut_ptr(), into.len(), error) })
    }

    fn annotate(&mut self, annotations: Annotations) {
        let (pointer, functions) = self.object();
        let Some(annotate) = functions.annotate() else { return };
        let annotations = raw_annotations(annotations);
        // SAFETY: everything lives through the call. What a simulator does not take, it refuses when it is asked for it.
        let _ = call(|error| unsafe { annotate(pointer, annotations, error) });
    }

    fn depth(&mut self, into: &mut [f32]) -> Result<()> {
        let (pointer, functions) = self.object();
        let Some(depth) = functions.depth() else { return Err(no_depth()) };
        // SAFETY: everything lives through the call.
        call(|error| unsafe { depth(pointer, into.as_mut_ptr(), into.len(), error) })
    }

    fn saved_numbers(&self) -> Vec<SavedNumber> {
        self.saved_numbers.clone()
    }

    fn save(&mut self, into: &mut [f64]) -> Result<()> {
        let (pointer, functions) = self.object();
        let save = functions.save().ok_or_else(cannot_be_put_back)?;
        // SAFETY: everything lives through the call.
        call(|error| unsafe { save(pointer, into.as_mut_ptr(), into.len(), error) })
    }

    fn restore(&mut self, frame: u64, saved: &[f64]) -> Result<State> {
        let restore = self.object().1.restore().ok_or_else(cannot_be_put_back)?;
        // SAFETY: everything lives through the call.
        self.state(|pointer, _, into, error| unsafe {
            restore(pointer, frame, saved.as_ptr(), saved.len(), into, error)
        })
    }
}

/// Checks that a simulator renders, moves, returns after each step the state that the next frame has, and does the same again
/// after a reset; the last not where it has its own clock. One that is a program of its own has to be there.
///
/// # Errors
/// The first check that fails.
pub fn check(description: &Description, config: &Config, make: Make<'_, dyn Simulator>) -> Result<()> {
    let mut simulator = make(config)?;
    let camera = simulator.camera();
    let component = ComponentSpec::new;
    let scenario =
        Scenario { seed: 1, duration: 10.0, ..Scenario::new(component("simulator"), component("driver")) };
    let mut runs = [Vec::new(), Vec::new()];
    for run in &mut runs {
        let mut expected = simulator.reset(&scenario, 0)?;
        let mut timeline = Timeline::new(description.clock, camera.rate);
        for step in 0..5 {
            let mut frame = FrameBuf::new(camera.width as usize, camera.height as usize);
            let state = simulator.frame(frame.as_mut())?;
            state.check()?;
            ensure(state == expected, || match step {
                0 => "the state of its first frame is not the one that reset returned".to_owned(),
                _ => "the state of a frame is not the one that act returned before it".to_owned(),
            })?;
            timeline.go_on(state.time, if step == 0 { Told::Frame } else { Told::Act })?;
            run.push((frame, state));
            expected = simulator.act(Control { steering: 0.1, throttle: 0.5 })?;
        }
    }
    let [first, second] = &runs;
    ensure(first[4].1.time > first[0].1.time, || "its time does not advance".to_owned())?;
    ensure(first == second || !description.clock.is_stepped(), || {
        "the same scenario comes out differently the second time, which only a simulator with its own clock may do".to_owned()
    })?;
    check_restore(simulator.as_mut(), &scenario)
}

/// Checks that a simulator that can be put back to a frame goes on from there as it did.
fn check_restore(simulator: &mut dyn Simulator, scenario: &Scenario) -> Result<()> {
    const FRAMES: usize = 5;
    let mut saved = vec![0.0; simulator.saved_numbers().len()];
    if saved.is_empty() {
        return Ok(());
    }
    let camera = simulator.camera();
    let control = Control { steering: 0.1, throttle: 0.5 };
    simulator.reset(scenario, 0)?;
    let mut runs = [Vec::new(), Vec::new()];
    for (again, run) in runs.iter_mut().enumerate() {
        if again == 0 {
            simulator.act(control)?;
            simulator.save(&mut saved)?;
        } else {
            simulator.restore(1, &saved)?;
        }
        for _ in 0..FRAMES {
            let mut frame = FrameBuf::new(camera.width as usize, camera.height as usize);
            let state = simulator.frame(frame.as_mut())?;
            run.push((frame, state));
            simulator.act(control)?;
        }
    }
    ensure(runs[0] == runs[1], || {
        "put back to a frame with the numbers that it saved there, it goes on differently; it has to save everything that it remembers".to_owned()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn states_and_cameras_cross_as_they_are() {
        for flag in 0..3 {
            let flags = std::array::from_fn(|other| other == flag);
            let state = State::from_parts(std::array::from_fn(|i| i as f64 + 0.5), flags);
            assert_eq!(State::from_raw(state.raw()), state);
        }
        let camera = Camera { width: 32, height: 24, rate: 20.0 };
        assert_eq!(Camera::from_raw(camera.raw()), camera);
    }

    #[test]
    fn what_the_other_side_does_not_know_is_as_without_it() {
        // A state that ends before the road ahead.
        let mut short = State { speed: 3.0, vehicle_ahead: 4.0, collision: true, ..State::default() }.raw();
        short.size = std::mem::offset_of!(pdk_abi::State, vehicle_ahead);
        // SAFETY: it is larger than it says.
        let state = unsafe { State::read(&short) };
        assert_eq!(state, State { speed: 3.0, ..State::default() });
    }
}
