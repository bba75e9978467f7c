//! The host's side of the boundary: what a plugin offers, as the traits of the SDK.

use std::cell::RefCell;
use std::ffi::c_void;

use pdk_abi::abi_stable::StableAbi;
use pdk_abi::abi_stable::reexports::True;
use pdk_abi::{
    DatasetFunctionsRef, DriverFunctionsRef, MaskFunctionsRef, PerturbationFunctionsRef, PluginRef,
    PredictorFunctionsRef, SaliencyFunctionsRef, SearchFunctionsRef, SimulatorFunctionsRef, Sink, Status,
    Text, empty, status,
};
use pdk_ops::{Frame, FrameBuf, FrameMut};
use pdk_seed::Key;

use super::convert::{self, Crosses};
use crate::SDK_VERSION;
use crate::dataset::{Dataset, Entry, Position};
use crate::describe::Kind;
use crate::driver::{Control, DriveContext, Driver};
use crate::error::{Error, ErrorKind, Result};
use crate::input_files::InputFiles;
use crate::mask::Mask;
use crate::perturbation::{Context, Perturbation, Way};
use crate::predictor::{Output, Predictor};
use crate::saliency::{HeatmapMut, MapContext, Saliency};
use crate::search::{Candidate, Evaluated, Problem, Search};
use crate::simulator::{Annotations, Camera, Scenario, Simulator, State, no_depth};

/// The functions of a plugin.
#[derive(Clone, Copy)]
pub struct Module {
    plugin: PluginRef,
}

impl Module {
    /// The functions of a root module.
    ///
    /// # Safety
    /// It is the root module of a library whose layout has been checked and that is never unloaded, and its functions do what
    /// [`pdk_abi`] says.
    pub unsafe fn of(plugin: PluginRef) -> Self {
        Self { plugin }
    }

    /// What the plugin says of itself, as JSON: see [`PluginDescription`](super::PluginDescription).
    ///
    /// # Errors
    /// If it cannot describe itself.
    pub fn describe(&self) -> Result<String> {
        // SAFETY: both sinks live through the call.
        collect(|description, error| unsafe { (self.plugin.describe())(description, error) })
    }

    /// The files that an instance of the component with this place reads besides those that the parameters name, a JSON object; none
    /// from a plugin that cannot say.
    ///
    /// # Errors
    /// If they cannot be listed.
    pub fn input_files(&self, index: usize, parameters: &str) -> Result<Vec<InputFiles>> {
        let Some(function) = self.plugin.input_files() else { return Ok(Vec::new()) };
        let parameters = Text::new(parameters.as_bytes());
        // SAFETY: everything lives through the call.
        let listed = collect(|files, error| unsafe { function(index, parameters, files, error) })?;
        Ok(serde_json::from_str(&listed)?)
    }
}

/// A function of a root module that makes instances with these functions.
type Make<F> = unsafe extern "C" fn(usize, Text, *mut pdk_abi::Instance<F>, *const Sink) -> Status;

/// Declares, for each kind, what an instance is here, and how it is made.
macro_rules! instances {
    ($($(#[$doc:meta])* $kind:ident: $make:ident, $table:ident => $host:ident;)*) => {
        /// An instance of a component of any kind.
        pub enum Instance {
            $($(#[$doc])* $kind(Box<dyn $kind>),)*
        }

        impl Instance {
            /// The kind of the component.
            pub fn kind(&self) -> Kind {
                match self {
                    $(Instance::$kind(_) => Kind::$kind,)*
                }
            }
        }

        impl Module {
            /// Makes an instance of the component of this kind with this place in the description, from its parameters as a JSON object.
            ///
            /// # Errors
            /// If the component refuses the parameters or panics, or fails at once, such as a simulator that has no camera.
            pub fn create(&self, kind: Kind, index: usize, parameters: &str) -> Result<Instance> {
                Ok(match kind {
                    $(Kind::$kind => {
                        // A plugin of an SDK that did not have the kind yet has no such function.
                        let make: Option<Make<pdk_abi::$table>> = self.plugin.$make().into();
                        let (pointer, functions) = make_instance(needed(make, stringify!($make))?, index, parameters)?;
                        let object = Object { pointer, functions, drop: functions.drop() };
                        Instance::$kind(Box::new($host::new(object)?))
                    })*
                })
            }
        }
    };
}

instances! {
    /// A perturbation.
    Perturbation: perturbation, PerturbationFunctionsRef => HostPerturbation;
    /// A simulator.
    Simulator: simulator, SimulatorFunctionsRef => HostSimulator;
    /// A driver.
    Driver: driver, DriverFunctionsRef => HostDriver;
    /// A saliency method.
    Saliency: saliency, SaliencyFunctionsRef => HostSaliency;
    /// A mask.
    Mask: mask, MaskFunctionsRef => HostMask;
    /// A predictor.
    Predictor: predictor, PredictorFunctionsRef => HostPredictor;
    /// A search strategy.
    Search: search, SearchFunctionsRef => HostSearch;
    /// A dataset reader.
    Dataset: dataset, DatasetFunctionsRef => HostDataset;
}

/// Calls a function that makes instances.
fn make_instance<F: StableAbi<IsNonZeroType = True>>(
    make: Make<F>,
    index: usize,
    parameters: &str,
) -> Result<(*mut c_void, F)> {
    let mut made = pdk_abi::Instance { object: std::ptr::null_mut(), functions: None };
    let parameters = Text::new(parameters.as_bytes());
    // SAFETY: everything lives through the call.
    call(|error| unsafe { make(index, parameters, &mut made, error) })?;
    let functions = made
        .functions
        .ok_or_else(|| Error::of(ErrorKind::Nonsense, "its plugin made an instance without functions"))?;
    Ok((made.object, functions))
}

/// Makes a call; if it fails, the plugin leaves its sentence in the sink.
#[inline]
fn call(work: impl FnOnce(*const Sink) -> Status) -> Result<()> {
    // Takes memory only if there is an error.
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

/// A function that was added after the first version, if there is no way without it.
fn needed<F>(function: Option<F>, name: &str) -> Result<F> {
    function.ok_or_else(|| {
        let sentence =
            format!("its plugin has no function `{name}`; build it again with pdk-sdk {SDK_VERSION}");
        Error::of(ErrorKind::Nonsense, sentence)
    })
}

/// An instance in a plugin, which ends with this.
struct Object<F> {
    pointer: *mut c_void,
    functions: F,
    drop: unsafe extern "C" fn(*mut c_void),
}

// SAFETY: the interface has instances used by one thread at a time, not always by the same one.
unsafe impl<F> Send for Object<F> {}

impl<F> Drop for Object<F> {
    fn drop(&mut self) {
        // SAFETY: the plugin made it, and it is not used after this.
        unsafe { (self.drop)(self.pointer) };
    }
}

struct HostPerturbation(Object<PerturbationFunctionsRef>);

impl HostPerturbation {
    fn new(object: Object<PerturbationFunctionsRef>) -> Result<Self> {
        Ok(Self(object))
    }
}

impl Perturbation for HostPerturbation {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let context = perturbation_context(cx);
        let (source, target) = (convert::frame(src), convert::frame_mut(&mut dst));
        let Object { pointer, functions, .. } = self.0;
        // SAFETY: the frames and all slices live through the call.
        call(|error| unsafe { functions.apply()(pointer, &source, &target, &context, error) })
    }

    fn move_points(
        &mut self,
        points: &mut [[f64; 2]],
        way: Way,
        [width, height]: [usize; 2],
        cx: &Context<'_>,
    ) -> Result<()> {
        let Object { pointer, functions, .. } = self.0;
        let move_points = needed(functions.move_points(), "move_points")?;
        let context = perturbation_context(cx);
        let (data, length, way) = (points.as_mut_ptr().cast(), points.len(), convert::way(way));
        // SAFETY: the points and all slices live through the call.
        call(|error| unsafe { move_points(pointer, data, length, way, width, height, &context, error) })
    }
}

/// What a perturbation knows about a frame; its slices live as long as the context.
fn perturbation_context(cx: &Context<'_>) -> pdk_abi::PerturbationContext {
    pdk_abi::PerturbationContext {
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
        history: cx.history.ring.pixels.as_ptr(),
        history_slots: cx.history.ring.indices.len(),
        history_latest: cx.history.ring.latest,
        history_length: cx.history.ring.length,
        history_indices: cx.history.ring.indices.as_ptr(),
        history_times: cx.history.ring.times.as_ptr(),
        history_width: cx.history.ring.width,
        history_height: cx.history.ring.height,
        ..empty()
    }
}

struct HostSimulator {
    /// Behind a cell, because an instance is used by one at a time.
    object: RefCell<Object<SimulatorFunctionsRef>>,
    label_names: Vec<String>,
    camera: Camera,
    waypoints: Vec<[f64; 3]>,
}

impl HostSimulator {
    fn new(object: Object<SimulatorFunctionsRef>) -> Result<Self> {
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
        Ok(Self { object: RefCell::new(object), label_names, camera, waypoints: Vec::new() })
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

impl Simulator for HostSimulator {
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
        let annotations = convert::annotations(annotations);
        // SAFETY: everything lives through the call. What a simulator does not take, it refuses when it is asked for it.
        let _ = call(|error| unsafe { annotate(pointer, annotations, error) });
    }

    fn depth(&mut self, into: &mut [f32]) -> Result<()> {
        let (pointer, functions) = self.object();
        let Some(depth) = functions.depth() else { return Err(no_depth()) };
        // SAFETY: everything lives through the call.
        call(|error| unsafe { depth(pointer, into.as_mut_ptr(), into.len(), error) })
    }
}

struct HostDriver {
    object: Object<DriverFunctionsRef>,
    info: Vec<(String, String)>,
}

impl HostDriver {
    fn new(object: Object<DriverFunctionsRef>) -> Result<Self> {
        let Object { pointer, functions, .. } = object;
        // SAFETY: both sinks live through the call.
        let info = collect(|text, error| unsafe { functions.info()(pointer, text, error) })?;
        Ok(Self { object, info: serde_json::from_str(&info)? })
    }
}

impl Driver for HostDriver {
    fn reset(&mut self) -> Result<()> {
        let Object { pointer, functions, .. } = self.object;
        // SAFETY: the sink lives through the call.
        call(|error| unsafe { functions.reset()(pointer, error) })
    }

    fn drive(&mut self, frame: Frame<'_>, cx: &DriveContext) -> Result<Control> {
        let Object { pointer, functions, .. } = self.object;
        let (frame, context) = (convert::frame(frame), cx.raw());
        let mut control = Control::default().raw();
        // SAFETY: everything lives through the call.
        call(|error| unsafe { functions.drive()(pointer, &frame, &context, &mut control, error) })?;
        Ok(Control::from_raw(control))
    }

    fn info(&self) -> Vec<(String, String)> {
        self.info.clone()
    }
}

struct HostPredictor {
    object: Object<PredictorFunctionsRef>,
    info: Vec<(String, String)>,
}

impl HostPredictor {
    fn new(object: Object<PredictorFunctionsRef>) -> Result<Self> {
        let Object { pointer, functions, .. } = object;
        // SAFETY: both sinks live through the call.
        let info = collect(|text, error| unsafe { functions.info()(pointer, text, error) })?;
        Ok(Self { object, info: serde_json::from_str(&info)? })
    }
}

impl Predictor for HostPredictor {
    fn reset(&mut self) -> Result<()> {
        let Object { pointer, functions, .. } = self.object;
        // SAFETY: the sink lives through the call.
        call(|error| unsafe { functions.reset()(pointer, error) })
    }

    fn predict(&mut self, frame: Frame<'_>, cx: &DriveContext) -> Result<Vec<Output>> {
        let Object { pointer, functions, .. } = self.object;
        let (frame, context) = (convert::frame(frame), cx.raw());
        let mut values = Vec::new();
        let sink = convert::sink(&mut values);
        // SAFETY: everything lives through the call.
        let shapes = collect(|outputs, error| unsafe {
            functions.predict()(pointer, &frame, &context, outputs, &sink, error)
        })?;
        convert::read_outputs(serde_json::from_str(&shapes)?, &values).ok_or_else(|| {
            Error::of(ErrorKind::Nonsense, "its outputs have another number of values than their shapes say")
        })
    }

    fn info(&self) -> Vec<(String, String)> {
        self.info.clone()
    }
}

struct HostSaliency(Object<SaliencyFunctionsRef>);

impl HostSaliency {
    fn new(object: Object<SaliencyFunctionsRef>) -> Result<Self> {
        Ok(Self(object))
    }
}

impl Saliency for HostSaliency {
    fn map_size(&mut self, width: usize, height: usize) -> Result<[usize; 2]> {
        let Object { pointer, functions, .. } = self.0;
        let mut size = empty::<pdk_abi::MapSize>();
        // SAFETY: everything lives through the call.
        call(|error| unsafe { functions.map_size()(pointer, width, height, &mut size, error) })?;
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
        let Object { pointer, functions, .. } = self.0;
        let frame = convert::frame(frame);
        let context = convert::map_context(cx);
        let (width, height) = (out.width(), out.height());
        let heatmap = pdk_abi::Heatmap { values: out.values_mut().as_mut_ptr(), width, height, ..empty() };
        // SAFETY: everything lives through the call.
        call(|error| unsafe { functions.map()(pointer, &frame, &context, &heatmap, error) })
    }
}

struct HostMask(Object<MaskFunctionsRef>);

impl HostMask {
    fn new(object: Object<MaskFunctionsRef>) -> Result<Self> {
        Ok(Self(object))
    }
}

impl Mask for HostMask {
    fn weights(&mut self, frame: Frame<'_>, cx: &MapContext<'_>, mut out: HeatmapMut<'_>) -> Result<()> {
        let Object { pointer, functions, .. } = self.0;
        let (frame, context) = (convert::frame(frame), convert::map_context(cx));
        let (width, height) = (out.width(), out.height());
        let heatmap = pdk_abi::Heatmap { values: out.values_mut().as_mut_ptr(), width, height, ..empty() };
        // SAFETY: everything lives through the call.
        call(|error| unsafe { functions.weights()(pointer, &frame, &context, &heatmap, error) })
    }
}

struct HostSearch(Object<SearchFunctionsRef>);

impl HostSearch {
    fn new(object: Object<SearchFunctionsRef>) -> Result<Self> {
        Ok(Self(object))
    }
}

impl Search for HostSearch {
    fn start(&mut self, problem: &Problem, key: &Key) -> Result<()> {
        let Object { pointer, functions, .. } = self.0;
        let problem = serde_json::to_string(problem)?;
        let (problem, key) = (Text::new(problem.as_bytes()), Text::new(&key.0));
        // SAFETY: everything lives through the call.
        call(|error| unsafe { functions.start()(pointer, problem, key, error) })
    }

    fn ask(&mut self, n: usize) -> Result<Vec<Candidate>> {
        let Object { pointer, functions, .. } = self.0;
        // SAFETY: both sinks live through the call.
        let candidates = collect(|text, error| unsafe { functions.ask()(pointer, n, text, error) })?;
        Ok(serde_json::from_str(&candidates)?)
    }

    fn tell(&mut self, results: &[Evaluated]) -> Result<()> {
        let Object { pointer, functions, .. } = self.0;
        let results = serde_json::to_string(results)?;
        // SAFETY: everything lives through the call.
        call(|error| unsafe { functions.tell()(pointer, Text::new(results.as_bytes()), error) })
    }
}

struct HostDataset {
    /// Behind a cell, because an instance is used by one at a time.
    object: RefCell<Object<DatasetFunctionsRef>>,
    len: usize,
    info: Vec<(String, String)>,
}

impl HostDataset {
    fn new(object: Object<DatasetFunctionsRef>) -> Result<Self> {
        let mut length = 0;
        // SAFETY: everything lives through the call.
        call(|error| unsafe { object.functions.length()(object.pointer, &mut length, error) })?;
        let len = usize::try_from(length)
            .map_err(|_| Error::of(ErrorKind::Nonsense, format!("it says that it has {length} frames")))?;
        let info = match object.functions.info() {
            None => Vec::new(),
            Some(info) => {
                // SAFETY: both sinks live through the call.
                let info = collect(|text, error| unsafe { info(object.pointer, text, error) })?;
                serde_json::from_str(&info)?
            }
        };
        Ok(Self { object: RefCell::new(object), len, info })
    }
}

impl Dataset for HostDataset {
    fn len(&self) -> usize {
        self.len
    }

    fn name(&self, index: usize) -> String {
        let object = self.object.borrow_mut();
        // SAFETY: both sinks live through the call.
        let name = collect(|text, error| unsafe {
            object.functions.name()(object.pointer, index as u64, text, error)
        });
        name.unwrap_or_else(|_| format!("frame {index}"))
    }

    fn read(&mut self, index: usize) -> Result<Entry> {
        let Object { pointer, functions, .. } = *self.object.get_mut();
        // An older plugin says nothing of the speed.
        let mut entry = pdk_abi::Entry { speed: f64::NAN, ..empty() };
        let mut pixels = Vec::new();
        let sink = convert::sink(&mut pixels);
        // SAFETY: everything lives through the call.
        call(|error| unsafe { functions.read()(pointer, index as u64, &mut entry, &sink, error) })?;
        let pdk_abi::Entry { width, height, steering, throttle, time, speed, .. } = entry;
        Ok(Entry {
            frame: FrameBuf::from_vec(pixels, width, height).map_err(Error::new)?,
            steering,
            throttle,
            time,
            speed,
        })
    }

    fn info(&self) -> Vec<(String, String)> {
        self.info.clone()
    }

    fn position(&self, index: usize) -> Position {
        let unknown = Position { part: 0, number: index as u64, time: f64::NAN };
        let object = self.object.borrow_mut();
        let Some(function) = object.functions.position() else { return unknown };
        let mut position = unknown.raw();
        // SAFETY: everything lives through the call.
        let told = call(|error| unsafe { function(object.pointer, index as u64, &mut position, error) });
        told.map_or(unknown, |()| Position::from_raw(position))
    }
}
