//! The host's side of the boundary: what a plugin offers, as the traits of the SDK.

use std::cell::RefCell;
use std::ffi::c_void;

use pdk_abi::{Header, Sink, Status, Text, empty, kind, load, status};
use pdk_ops::{Frame, FrameBuf, FrameMut};
use pdk_seed::Key;

use super::convert::{self, Crosses};
use crate::dataset::{Dataset, Entry};
use crate::describe::Kind;
use crate::driver::{Control, DriveContext, Driver};
use crate::error::{Error, ErrorKind, Result};
use crate::input_files::InputFiles;
use crate::mask::Mask;
use crate::perturbation::{Context, Perturbation};
use crate::saliency::{HeatmapMut, MapContext, Saliency};
use crate::search::{Candidate, Evaluated, Problem, Search};
use crate::simulator::{Annotations, Camera, Scenario, Simulator, State, no_depth};

/// The functions of a plugin.
#[derive(Clone, Copy)]
pub struct Module {
    describe: unsafe extern "C" fn(*const Sink, *const Sink) -> Status,
    create: unsafe extern "C" fn(usize, Text, *mut pdk_abi::Instance, *const Sink) -> Status,
    input_files: Option<unsafe extern "C" fn(usize, Text, *const Sink, *const Sink) -> Status>,
}

impl Module {
    /// The functions behind a header of this version of the interface.
    ///
    /// # Safety
    /// The header is what a library exports under [`pdk_abi::SYMBOL`], and the library is never unloaded.
    ///
    /// # Errors
    /// Where it lacks a function.
    pub unsafe fn behind(header: &Header) -> Result<Self> {
        if header.plugin.is_null() {
            return Err(Error::of(ErrorKind::Nonsense, "has no table of functions; build it again"));
        }
        // SAFETY: the caller's promise.
        let plugin = unsafe { load(header.plugin, empty()) };
        Ok(Self {
            describe: needed(plugin.describe, "describe")?,
            create: needed(plugin.create, "create")?,
            input_files: plugin.input_files,
        })
    }

    /// What the plugin says of itself, as JSON: see [`PluginDescription`](super::PluginDescription).
    ///
    /// # Errors
    /// Where it cannot describe itself.
    pub fn describe(&self) -> Result<String> {
        // SAFETY: both sinks live through the call.
        collect(|description, error| unsafe { (self.describe)(description, error) })
    }

    /// Makes an instance of the component with this place in the description, from its parameters as a JSON object.
    ///
    /// # Errors
    /// Where the component refuses the parameters or panics, or fails at once, such as a simulator that has no camera.
    pub fn create(&self, index: usize, parameters: &str) -> Result<Instance> {
        let mut raw = empty::<pdk_abi::Instance>();
        // SAFETY: everything lives through the call.
        call(|error| unsafe { (self.create)(index, Text::new(parameters.as_bytes()), &mut raw, error) })?;
        // SAFETY: the plugin has made it just now, and nothing else has it.
        unsafe { instance(raw) }
    }
}

impl Module {
    /// The files that an instance of the component with this place reads besides those that the parameters name, a JSON object; none
    /// from a plugin that cannot say.
    ///
    /// # Errors
    /// If they cannot be listed.
    pub fn input_files(&self, index: usize, parameters: &str) -> Result<Vec<InputFiles>> {
        let Some(function) = self.input_files else { return Ok(Vec::new()) };
        let parameters = Text::new(parameters.as_bytes());
        // SAFETY: everything lives through the call.
        let listed = collect(|files, error| unsafe { function(index, parameters, files, error) })?;
        Ok(serde_json::from_str(&listed)?)
    }
}

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
    /// A mask.
    Mask(Box<dyn Mask>),
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
            Instance::Mask(_) => Kind::Mask,
            Instance::Search(_) => Kind::Search,
            Instance::Dataset(_) => Kind::Dataset,
        }
    }
}

/// Turns what a plugin made into the trait of its kind.
///
/// # Safety
/// A plugin of this version of the interface made it, and nothing else has it.
unsafe fn instance(raw: pdk_abi::Instance) -> Result<Instance> {
    if raw.functions.is_null() {
        return Err(Error::of(ErrorKind::Nonsense, "its plugin made an instance without functions"));
    }
    // SAFETY: the table of an instance is that of its kind.
    unsafe {
        Ok(match raw.kind {
            kind::PERTURBATION => Instance::Perturbation(Box::new(HostPerturbation::new(&raw)?)),
            kind::SIMULATOR => Instance::Simulator(Box::new(HostSimulator::new(&raw)?)),
            kind::DRIVER => Instance::Driver(Box::new(HostDriver::new(&raw)?)),
            kind::SALIENCY => Instance::Saliency(Box::new(HostSaliency::new(&raw)?)),
            kind::MASK => Instance::Mask(Box::new(HostMask::new(&raw)?)),
            kind::SEARCH => Instance::Search(Box::new(HostSearch::new(&raw)?)),
            kind::DATASET => Instance::Dataset(Box::new(HostDataset::new(&raw)?)),
            other => {
                let sentence =
                    format!("its plugin made an instance of kind {other}, which this pdk does not know");
                return Err(Error::of(ErrorKind::Nonsense, sentence));
            }
        })
    }
}

/// Makes a call; where it fails, the plugin leaves its sentence in the sink.
#[inline]
fn call(work: impl FnOnce(*const Sink) -> Status) -> Result<()> {
    // Takes memory only where there is an error.
    let mut sentence = Vec::new();
    let sink = convert::sink(&mut sentence);
    match work(&sink) {
        Status { code: status::DONE } => Ok(()),
        status => Err(Error::of(convert::kind_of(status), String::from_utf8_lossy(&sentence))),
    }
}

/// Makes a call that answers with a text.
fn collect(work: impl FnOnce(*const Sink, *const Sink) -> Status) -> Result<String> {
    let mut answer = Vec::new();
    let sink = convert::sink(&mut answer);
    call(|error| work(&sink, error))?;
    String::from_utf8(answer)
        .map_err(|_| Error::of(ErrorKind::Nonsense, "it answered with a text that is not UTF-8"))
}

/// A function that every plugin of this version has.
fn needed<F>(function: Option<F>, name: &str) -> Result<F> {
    function.ok_or_else(|| {
        Error::of(ErrorKind::Nonsense, format!("its plugin has no function `{name}`; build it again"))
    })
}

/// An instance in a plugin, which ends with this.
struct Object {
    pointer: *mut c_void,
    drop: unsafe extern "C" fn(*mut c_void),
}

// SAFETY: the interface has instances used by one thread at a time, not always by the same one.
unsafe impl Send for Object {}

impl Drop for Object {
    fn drop(&mut self) {
        // SAFETY: the plugin made it, and it is not used after this.
        unsafe { (self.drop)(self.pointer) };
    }
}

/// Declares the host's side of a kind: the object and the functions of its table, all of which are there.
macro_rules! host {
    ($($name:ident: $table:ident { $($function:ident: fn($($argument:ty),*);)* })*) => {
        $(
            struct $name {
                object: Object,
                $($function: unsafe extern "C" fn(*mut c_void, $($argument),*) -> Status,)*
            }

            impl $name {
                /// # Safety
                /// The instance is of this kind, and nothing else has it.
                unsafe fn of(raw: &pdk_abi::Instance) -> Result<Self> {
                    // SAFETY: the caller's promise.
                    let table = unsafe { load(raw.functions.cast::<pdk_abi::$table>(), empty()) };
                    let object = Object { pointer: raw.object, drop: needed(table.drop, "drop")? };
                    Ok(Self { object, $($function: needed(table.$function, stringify!($function))?,)* })
                }
            }
        )*
    };
}

host! {
    PerturbationCalls: PerturbationFunctions {
        apply: fn(
            *const pdk_abi::Frame,
            *const pdk_abi::FrameMut,
            *const pdk_abi::PerturbationContext,
            *const Sink
        );
    }
    SimulatorCalls: SimulatorFunctions {
        camera: fn(*mut pdk_abi::Camera, *const Sink);
        reset: fn(Text, u32, *mut pdk_abi::State, *const Sink);
        frame: fn(*const pdk_abi::FrameMut, *mut pdk_abi::State, *const Sink);
        act: fn(*const pdk_abi::Control, *mut pdk_abi::State, *const Sink);
        waypoints: fn(*const Sink, *const Sink);
    }
    DriverCalls: DriverFunctions {
        reset: fn(*const Sink);
        drive: fn(
            *const pdk_abi::Frame,
            *const pdk_abi::DriveContext,
            *mut pdk_abi::Control,
            *const Sink
        );
        info: fn(*const Sink, *const Sink);
    }
    SaliencyCalls: SaliencyFunctions {
        map_size: fn(usize, usize, *mut pdk_abi::MapSize, *const Sink);
        map: fn(
            *const pdk_abi::Frame,
            *const pdk_abi::MapContext,
            *const pdk_abi::Heatmap,
            *const Sink
        );
    }
    MaskCalls: MaskFunctions {
        weights: fn(
            *const pdk_abi::Frame,
            *const pdk_abi::MapContext,
            *const pdk_abi::Heatmap,
            *const Sink
        );
    }
    SearchCalls: SearchFunctions {
        start: fn(Text, Text, *const Sink);
        ask: fn(usize, *const Sink, *const Sink);
        tell: fn(Text, *const Sink);
    }
    DatasetCalls: DatasetFunctions {
        length: fn(*mut u64, *const Sink);
        name: fn(u64, *const Sink, *const Sink);
        read: fn(u64, *mut pdk_abi::Entry, *const Sink, *const Sink);
    }
}

struct HostPerturbation(PerturbationCalls);

impl HostPerturbation {
    /// # Safety
    /// The instance is a perturbation, and nothing else has it.
    unsafe fn new(raw: &pdk_abi::Instance) -> Result<Self> {
        // SAFETY: the caller's promise.
        unsafe { PerturbationCalls::of(raw) }.map(Self)
    }
}

impl Perturbation for HostPerturbation {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let context = pdk_abi::PerturbationContext {
            intensity: cx.intensity,
            frame_index: cx.frame_index,
            time: cx.time,
            key: cx.key.0,
            stream: cx.stream,
            values: cx.values.as_ptr(),
            values_length: cx.values.len(),
            saliency: cx.saliency.map_or(std::ptr::null(), <[f32]>::as_ptr),
            saliency_length: cx.saliency.map_or(0, <[f32]>::len),
            earlier_times: cx.earlier.times.as_ptr(),
            earlier_length: cx.earlier.times.len(),
            earlier_values: cx.earlier.values.as_ptr(),
            earlier_width: cx.earlier.width,
            earlier_height: cx.earlier.height,
            travelled: cx.travelled.unwrap_or(f64::NAN),
            ..empty()
        };
        let (source, target) = (convert::frame(src), convert::frame_mut(&mut dst));
        let Self(PerturbationCalls { object, apply }) = self;
        // SAFETY: the frames and all slices live through the call.
        call(|error| unsafe { apply(object.pointer, &source, &target, &context, error) })
    }
}

struct HostSimulator {
    /// Behind a cell, because an instance is used by one at a time.
    calls: RefCell<SimulatorCalls>,
    /// None in a plugin of an SDK that did not have it yet.
    info: Option<unsafe extern "C" fn(*mut c_void, *const Sink, *const Sink) -> Status>,
    labels: Option<LabelFunction>,
    annotate: Option<unsafe extern "C" fn(*mut c_void, u64, *const Sink) -> Status>,
    depth: Option<unsafe extern "C" fn(*mut c_void, *mut f32, usize, *const Sink) -> Status>,
    label_names: Vec<String>,
    camera: Camera,
    waypoints: Vec<[f64; 3]>,
}

/// Writes labels; plugins of before there were any do not have it.
type LabelFunction = unsafe extern "C" fn(*mut c_void, *mut u8, usize, *const Sink) -> Status;

impl HostSimulator {
    /// # Safety
    /// The instance is a simulator, and nothing else has it.
    unsafe fn new(raw: &pdk_abi::Instance) -> Result<Self> {
        // SAFETY: the caller's promise.
        let calls = unsafe { SimulatorCalls::of(raw) }?;
        // SAFETY: as above.
        let table = unsafe { load(raw.functions.cast::<pdk_abi::SimulatorFunctions>(), empty()) };
        let mut camera = empty::<pdk_abi::Camera>();
        // SAFETY: everything lives through the call.
        call(|error| unsafe { (calls.camera)(calls.object.pointer, &mut camera, error) })?;
        let camera = Camera::from_raw(camera);
        let usable = |length: u32| (1..=1 << 14).contains(&length);
        if !usable(camera.width) || !usable(camera.height) || !(0.01..=100_000.0).contains(&camera.rate) {
            let sentence = format!(
                "the simulator's camera has {}x{} pixels at {:?} frames a second, which is out of range",
                camera.width, camera.height, camera.rate
            );
            return Err(Error::of(ErrorKind::Nonsense, sentence));
        }
        let label_names = match table.label_names {
            None => Vec::new(),
            Some(label_names) => {
                // SAFETY: both sinks live through the call.
                let names = collect(|text, error| unsafe { label_names(calls.object.pointer, text, error) })?;
                serde_json::from_str(&names)?
            }
        };
        Ok(Self {
            calls: RefCell::new(calls),
            info: table.info,
            labels: table.labels,
            annotate: table.annotate,
            depth: table.depth,
            label_names,
            camera,
            waypoints: Vec::new(),
        })
    }

    /// Makes a call that answers with a state.
    #[inline]
    fn state(
        &mut self,
        work: impl FnOnce(&SimulatorCalls, *mut pdk_abi::State, *const Sink) -> Status,
    ) -> Result<State> {
        let mut state = State::default().raw();
        call(|error| work(self.calls.get_mut(), &mut state, error))?;
        Ok(State::from_raw(state))
    }
}

impl Simulator for HostSimulator {
    fn camera(&self) -> Camera {
        self.camera
    }

    fn reset(&mut self, scenario: &Scenario, slot: u32) -> Result<State> {
        // Where this one cannot be built, the road of the one before must not pass for its own.
        self.waypoints.clear();
        // What is done to the pictures is no concern of the world that they show.
        let scenario = serde_json::to_string(&Scenario { perturbations: Vec::new(), ..scenario.clone() })?;
        let scenario = Text::new(scenario.as_bytes());
        // SAFETY: everything lives through the call.
        let state = self.state(|calls, into, error| unsafe {
            (calls.reset)(calls.object.pointer, scenario, slot, into, error)
        })?;
        let SimulatorCalls { object, waypoints, .. } = self.calls.get_mut();
        // SAFETY: as above.
        let road = collect(|text, error| unsafe { waypoints(object.pointer, text, error) })?;
        self.waypoints = serde_json::from_str(&road).map_err(|error| {
            Error::of(ErrorKind::Nonsense, format!("its waypoints are no list of [x, height, z] ({error})"))
        })?;
        Ok(state)
    }

    fn frame(&mut self, mut into: FrameMut<'_>) -> Result<State> {
        let target = convert::frame_mut(&mut into);
        // SAFETY: everything lives through the call.
        self.state(|calls, into, error| unsafe { (calls.frame)(calls.object.pointer, &target, into, error) })
    }

    fn act(&mut self, control: Control) -> Result<State> {
        let control = control.raw();
        // SAFETY: everything lives through the call.
        self.state(|calls, into, error| unsafe { (calls.act)(calls.object.pointer, &control, into, error) })
    }

    fn waypoints(&self) -> Vec<[f64; 3]> {
        self.waypoints.clone()
    }

    fn info(&self) -> Vec<(String, String)> {
        let Some(info) = self.info else { return Vec::new() };
        let calls = self.calls.borrow_mut();
        // SAFETY: both sinks live through the call.
        let told = collect(|text, error| unsafe { info(calls.object.pointer, text, error) });
        // It is for people only, so that without it nothing is lost.
        told.ok().and_then(|told| serde_json::from_str(&told).ok()).unwrap_or_default()
    }

    fn label_names(&self) -> Vec<String> {
        self.label_names.clone()
    }

    fn labels(&mut self, into: &mut [u8]) -> Result<()> {
        let labels = needed(self.labels, "labels")?;
        // SAFETY: everything lives through the call.
        call(|error| unsafe {
            labels(self.calls.get_mut().object.pointer, into.as_mut_ptr(), into.len(), error)
        })
    }

    fn annotate(&mut self, annotations: Annotations) {
        let Some(annotate) = self.annotate else { return };
        let annotations = convert::annotations(annotations);
        // SAFETY: everything lives through the call. What a simulator does not take, it refuses when it is asked for it.
        let _ = call(|error| unsafe { annotate(self.calls.get_mut().object.pointer, annotations, error) });
    }

    fn depth(&mut self, into: &mut [f32]) -> Result<()> {
        let Some(depth) = self.depth else { return Err(no_depth()) };
        // SAFETY: everything lives through the call.
        call(|error| unsafe {
            depth(self.calls.get_mut().object.pointer, into.as_mut_ptr(), into.len(), error)
        })
    }
}

struct HostDriver {
    calls: DriverCalls,
    info: Vec<(String, String)>,
}

impl HostDriver {
    /// # Safety
    /// The instance is a driver, and nothing else has it.
    unsafe fn new(raw: &pdk_abi::Instance) -> Result<Self> {
        // SAFETY: the caller's promise.
        let calls = unsafe { DriverCalls::of(raw) }?;
        // SAFETY: both sinks live through the call.
        let info = collect(|text, error| unsafe { (calls.info)(calls.object.pointer, text, error) })?;
        Ok(Self { calls, info: serde_json::from_str(&info)? })
    }
}

impl Driver for HostDriver {
    fn reset(&mut self) -> Result<()> {
        let DriverCalls { object, reset, .. } = &self.calls;
        // SAFETY: the sink lives through the call.
        call(|error| unsafe { reset(object.pointer, error) })
    }

    fn drive(&mut self, frame: Frame<'_>, cx: &DriveContext) -> Result<Control> {
        let DriverCalls { object, drive, .. } = &self.calls;
        let (frame, context) = (convert::frame(frame), cx.raw());
        let mut control = Control::default().raw();
        // SAFETY: everything lives through the call.
        call(|error| unsafe { drive(object.pointer, &frame, &context, &mut control, error) })?;
        Ok(Control::from_raw(control))
    }

    fn info(&self) -> Vec<(String, String)> {
        self.info.clone()
    }
}

struct HostSaliency(SaliencyCalls);

impl HostSaliency {
    /// # Safety
    /// The instance is a saliency method, and nothing else has it.
    unsafe fn new(raw: &pdk_abi::Instance) -> Result<Self> {
        // SAFETY: the caller's promise.
        unsafe { SaliencyCalls::of(raw) }.map(Self)
    }
}

impl Saliency for HostSaliency {
    fn map_size(&mut self, width: usize, height: usize) -> Result<[usize; 2]> {
        let Self(SaliencyCalls { object, map_size, .. }) = self;
        let mut size = empty::<pdk_abi::MapSize>();
        // SAFETY: everything lives through the call.
        call(|error| unsafe { map_size(object.pointer, width, height, &mut size, error) })?;
        if !(1..=width).contains(&size.width) || !(1..=height).contains(&size.height) {
            let sentence = format!(
                "its map of a frame of {width}x{height} has {}x{} values, but has to have 1x1 at least and {width}x{height} at most",
                size.width, size.height
            );
            return Err(Error::of(ErrorKind::Nonsense, sentence));
        }
        Ok([size.width, size.height])
    }

    fn map(&mut self, frame: Frame<'_>, cx: &MapContext<'_>, mut out: HeatmapMut<'_>) -> Result<()> {
        let Self(SaliencyCalls { object, map, .. }) = self;
        let frame = convert::frame(frame);
        let context = convert::map_context(cx);
        let (width, height) = (out.width(), out.height());
        let heatmap = pdk_abi::Heatmap { values: out.values_mut().as_mut_ptr(), width, height, ..empty() };
        // SAFETY: everything lives through the call.
        call(|error| unsafe { map(object.pointer, &frame, &context, &heatmap, error) })
    }
}

struct HostMask(MaskCalls);

impl HostMask {
    /// # Safety
    /// The instance is a mask, and nothing else has it.
    unsafe fn new(raw: &pdk_abi::Instance) -> Result<Self> {
        // SAFETY: the caller's promise.
        unsafe { MaskCalls::of(raw) }.map(Self)
    }
}

impl Mask for HostMask {
    fn weights(&mut self, frame: Frame<'_>, cx: &MapContext<'_>, mut out: HeatmapMut<'_>) -> Result<()> {
        let Self(MaskCalls { object, weights }) = self;
        let (frame, context) = (convert::frame(frame), convert::map_context(cx));
        let (width, height) = (out.width(), out.height());
        let heatmap = pdk_abi::Heatmap { values: out.values_mut().as_mut_ptr(), width, height, ..empty() };
        // SAFETY: everything lives through the call.
        call(|error| unsafe { weights(object.pointer, &frame, &context, &heatmap, error) })
    }
}

struct HostSearch(SearchCalls);

impl HostSearch {
    /// # Safety
    /// The instance is a search strategy, and nothing else has it.
    unsafe fn new(raw: &pdk_abi::Instance) -> Result<Self> {
        // SAFETY: the caller's promise.
        unsafe { SearchCalls::of(raw) }.map(Self)
    }
}

impl Search for HostSearch {
    fn start(&mut self, problem: &Problem, key: &Key) -> Result<()> {
        let Self(SearchCalls { object, start, .. }) = self;
        let problem = serde_json::to_string(problem)?;
        let (problem, key) = (Text::new(problem.as_bytes()), Text::new(&key.0));
        // SAFETY: everything lives through the call.
        call(|error| unsafe { start(object.pointer, problem, key, error) })
    }

    fn ask(&mut self, n: usize) -> Result<Vec<Candidate>> {
        let Self(SearchCalls { object, ask, .. }) = self;
        // SAFETY: both sinks live through the call.
        let candidates = collect(|text, error| unsafe { ask(object.pointer, n, text, error) })?;
        Ok(serde_json::from_str(&candidates)?)
    }

    fn tell(&mut self, results: &[Evaluated]) -> Result<()> {
        let Self(SearchCalls { object, tell, .. }) = self;
        let results = serde_json::to_string(results)?;
        // SAFETY: everything lives through the call.
        call(|error| unsafe { tell(object.pointer, Text::new(results.as_bytes()), error) })
    }
}

struct HostDataset {
    /// Behind a cell, because an instance is used by one at a time.
    calls: RefCell<DatasetCalls>,
    len: usize,
}

impl HostDataset {
    /// # Safety
    /// The instance is a dataset reader, and nothing else has it.
    unsafe fn new(raw: &pdk_abi::Instance) -> Result<Self> {
        // SAFETY: the caller's promise.
        let calls = unsafe { DatasetCalls::of(raw) }?;
        let mut length = 0;
        // SAFETY: everything lives through the call.
        call(|error| unsafe { (calls.length)(calls.object.pointer, &mut length, error) })?;
        let len = usize::try_from(length)
            .map_err(|_| Error::of(ErrorKind::Nonsense, format!("it says that it has {length} frames")))?;
        Ok(Self { calls: RefCell::new(calls), len })
    }
}

impl Dataset for HostDataset {
    fn len(&self) -> usize {
        self.len
    }

    fn name(&self, index: usize) -> String {
        let calls = self.calls.borrow_mut();
        // SAFETY: both sinks live through the call.
        let name =
            collect(|text, error| unsafe { (calls.name)(calls.object.pointer, index as u64, text, error) });
        name.unwrap_or_else(|_| format!("frame {index}"))
    }

    fn read(&mut self, index: usize) -> Result<Entry> {
        let calls = self.calls.get_mut();
        let mut entry = empty::<pdk_abi::Entry>();
        let mut pixels = Vec::new();
        let sink = convert::sink(&mut pixels);
        // SAFETY: everything lives through the call.
        call(|error| unsafe { (calls.read)(calls.object.pointer, index as u64, &mut entry, &sink, error) })?;
        let pdk_abi::Entry { width, height, steering, throttle, time, .. } = entry;
        Ok(Entry {
            frame: FrameBuf::from_vec(pixels, width, height).map_err(Error::new)?,
            steering,
            throttle,
            time,
        })
    }
}
