//! The host's side of the boundary: raw components as the traits of the SDK.

use abi_stable::std_types::RBox;
use pdk_ops::{Frame, FrameBuf, FrameMut, Key};

use super::{
    Outcome, RawComponent, RawContext, RawDataset_TO, RawDriver_TO, RawFrame, RawFrameMut, RawHeatmap,
    RawPerturbation_TO, RawSaliency_TO, RawSearch_TO, RawSimulator_TO,
};
use crate::dataset::{Dataset, Entry};
use crate::describe::Kind;
use crate::driver::{Control, DriveContext, Driver};
use crate::error::{Error, ErrorKind, Result};
use crate::perturbation::{Context, Perturbation};
use crate::saliency::{HeatmapMut, Saliency};
use crate::search::{Candidate, Evaluated, Problem, Search};
use crate::simulator::{Camera, Scenario, Simulator, State};

/// An instance of a component of any kind.
pub enum Instance {
    /// A perturbation.
    Perturbation(Box<dyn Perturbation>),
    /// A simulator.
    Simulator(Box<dyn Simulator>),
    /// A driver.
    Driver(Box<dyn Driver>),
    /// A saliency method.
    Saliency(Box<dyn Saliency>),
    /// A search strategy.
    Search(Box<dyn Search>),
    /// A dataset reader.
    Dataset(Box<dyn Dataset>),
}

impl Instance {
    /// The kind of the component.
    pub fn kind(&self) -> Kind {
        match self {
            Instance::Perturbation(_) => Kind::Perturbation,
            Instance::Simulator(_) => Kind::Simulator,
            Instance::Driver(_) => Kind::Driver,
            Instance::Saliency(_) => Kind::Saliency,
            Instance::Search(_) => Kind::Search,
            Instance::Dataset(_) => Kind::Dataset,
        }
    }
}

/// Turns a raw component into the trait of its kind.
///
/// # Errors
/// Where the component fails at once, for instance a simulator that has no camera.
pub fn instance(raw: RawComponent) -> Result<Instance> {
    Ok(match raw {
        RawComponent::Perturbation(raw) => Instance::Perturbation(Box::new(HostPerturbation(raw))),
        RawComponent::Simulator(mut raw) => {
            let camera = result(raw.camera())?;
            let usable = |length: u32| (1..=1 << 14).contains(&length);
            if !usable(camera.width) || !usable(camera.height) || !(0.01..=100_000.0).contains(&camera.rate) {
                let sentence = format!(
                    "the simulator's camera has {}x{} pixels at {:?} frames a second, which is out of range",
                    camera.width, camera.height, camera.rate
                );
                return Err(Error::of(ErrorKind::Nonsense, sentence));
            }
            Instance::Simulator(Box::new(HostSimulator { raw, camera, waypoints: Vec::new() }))
        }
        RawComponent::Driver(mut raw) => {
            let info = serde_json::from_str(&result(raw.info())?)?;
            Instance::Driver(Box::new(HostDriver { raw, info }))
        }
        RawComponent::Saliency(raw) => Instance::Saliency(Box::new(HostSaliency(raw))),
        RawComponent::Search(raw) => Instance::Search(Box::new(HostSearch(raw))),
        RawComponent::Dataset(mut raw) => {
            let len = result(raw.len())?;
            Instance::Dataset(Box::new(HostDataset { raw: std::cell::RefCell::new(raw), len }))
        }
    })
}

/// Turns an outcome into a result.
pub fn result<T>(outcome: Outcome<T>) -> Result<T> {
    outcome.into_result().map_err(Error::from)
}

struct HostPerturbation(RawPerturbation_TO<'static, RBox<()>>);

impl Perturbation for HostPerturbation {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let raw = RawContext {
            intensity: cx.intensity,
            frame_index: cx.frame_index,
            time: cx.time,
            key: cx.key.0,
            stream: cx.stream,
            values: cx.values.as_ptr(),
            values_len: cx.values.len(),
            saliency: cx.saliency.map_or(std::ptr::null(), <[f32]>::as_ptr),
            saliency_len: cx.saliency.map_or(0, <[f32]>::len),
        };
        result(self.0.apply(RawFrame::new(src), RawFrameMut::new(&mut dst), &raw))
    }
}

struct HostSimulator {
    raw: RawSimulator_TO<'static, RBox<()>>,
    camera: Camera,
    waypoints: Vec<[f64; 3]>,
}

impl Simulator for HostSimulator {
    fn camera(&self) -> Camera {
        self.camera
    }

    fn reset(&mut self, scenario: &Scenario, slot: u32) -> Result<State> {
        // Where this one cannot be built, the road of the one before must not pass for its own.
        self.waypoints.clear();
        let scenario = serde_json::to_string(scenario)?;
        let state = result(self.raw.reset(scenario.as_str().into(), slot))?;
        self.waypoints = result(self.raw.waypoints())?.into();
        Ok(state)
    }

    fn frame(&mut self, mut into: FrameMut<'_>) -> Result<State> {
        result(self.raw.frame(RawFrameMut::new(&mut into)))
    }

    fn act(&mut self, control: Control) -> Result<State> {
        result(self.raw.act(control))
    }

    fn waypoints(&self) -> Vec<[f64; 3]> {
        self.waypoints.clone()
    }
}

struct HostDriver {
    raw: RawDriver_TO<'static, RBox<()>>,
    info: Vec<(String, String)>,
}

impl Driver for HostDriver {
    fn reset(&mut self) -> Result<()> {
        result(self.raw.reset())
    }

    fn drive(&mut self, frame: Frame<'_>, cx: &DriveContext) -> Result<Control> {
        result(self.raw.drive(RawFrame::new(frame), *cx))
    }

    fn info(&self) -> Vec<(String, String)> {
        self.info.clone()
    }
}

struct HostSaliency(RawSaliency_TO<'static, RBox<()>>);

impl Saliency for HostSaliency {
    fn map(&mut self, frame: Frame<'_>, mut out: HeatmapMut<'_>) -> Result<()> {
        let (width, height) = (out.width(), out.height());
        let values = out.values_mut().as_mut_ptr();
        result(self.0.map(RawFrame::new(frame), RawHeatmap { values, width, height }))
    }
}

struct HostSearch(RawSearch_TO<'static, RBox<()>>);

impl Search for HostSearch {
    fn start(&mut self, problem: &Problem, key: &Key) -> Result<()> {
        result(self.0.start(serde_json::to_string(problem)?.as_str().into(), &key.0))
    }

    fn ask(&mut self, n: usize) -> Result<Vec<Candidate>> {
        Ok(serde_json::from_str(&result(self.0.ask(n))?)?)
    }

    fn tell(&mut self, results: &[Evaluated]) -> Result<()> {
        result(self.0.tell(serde_json::to_string(results)?.as_str().into()))
    }
}

struct HostDataset {
    /// Behind a cell, because every call across the boundary takes the component mutably.
    raw: std::cell::RefCell<RawDataset_TO<'static, RBox<()>>>,
    len: usize,
}

impl Dataset for HostDataset {
    fn len(&self) -> usize {
        self.len
    }

    fn name(&self, index: usize) -> String {
        match result(self.raw.borrow_mut().name(index)) {
            Ok(name) => name.into_string(),
            Err(_) => format!("frame {index}"),
        }
    }

    fn read(&mut self, index: usize) -> Result<Entry> {
        let raw = result(self.raw.get_mut().read(index))?;
        Ok(Entry {
            frame: FrameBuf::from_vec(raw.pixels.into(), raw.width, raw.height)?,
            steering: raw.steering,
            throttle: raw.throttle,
            time: raw.time,
        })
    }
}
