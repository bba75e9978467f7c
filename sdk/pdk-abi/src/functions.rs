//! The functions of a plugin and of each kind of component, in tables of abi_stable (its "prefix types").
//!
//! A library carries a description of these tables, and a host compares it with its own before it calls anything: names, order, and the
//! types of all parameters. `last_prefix_field` marks the last function of the first version; it never moves. Functions behind it were
//! added later: a plugin of before does not have them, and the host gets `None`. The names of parameters are compared as well.
//!
//! Functions of an instance take its object first, and last the sink for the sentence of an error. A function must not unwind.
//!
//! A kind of component is its line in [`each_kind!`](crate::each_kind), its function at the end of [`Plugin`], and its table.

use core::ffi::c_void;

use abi_stable::StableAbi;
use abi_stable::library::RootModule;
use abi_stable::reexports::True;
use abi_stable::sabi_types::VersionStrings;

use crate::fixed::{Status, Text};
use crate::sized::{
    Camera, Control, DriveContext, Entry, Frame, FrameMut, Heatmap, MapContext, MapSize, PerturbationContext,
    Perturber, Position, Sink, State,
};

/// Calls a macro with all kinds of component, in the order in which they are listed for people and sorted in records. This is the one list of
/// them: the two sides of the boundary, the test kit, and the functions of hosts are made from it.
///
/// The line of a kind has what its components do, the name of its trait, its name in lists and of its function in [`Plugin`], its name in
/// `export!`, its table with the reference to that, and what one component and several are called.
#[macro_export]
macro_rules! each_kind {
    ($then:ident) => {
        $then! {
            /// Changes a frame.
            Perturbation perturbation perturbations: PerturbationFunctions PerturbationFunctionsRef,
                "perturbation", "perturbations";
            /// Renders frames and moves the vehicle.
            Simulator simulator simulators: SimulatorFunctions SimulatorFunctionsRef, "simulator", "simulators";
            /// Looks at a frame and steers.
            Driver driver drivers: DriverFunctions DriverFunctionsRef, "driver", "drivers";
            /// Says which pixels matter to a driver.
            Saliency saliency saliencies: SaliencyFunctions SaliencyFunctionsRef,
                "saliency method", "saliency methods";
            /// Says where frames are to be perturbed.
            Mask mask masks: MaskFunctions MaskFunctionsRef, "mask", "masks";
            /// Proposes scenarios and learns from outcomes.
            Search search searches: SearchFunctions SearchFunctionsRef, "search strategy", "search strategies";
            /// Looks at a frame and gives values by name, such as scores of classes.
            Predictor predictor predictors: PredictorFunctions PredictorFunctionsRef, "predictor", "predictors";
            /// Reads recorded frames with their ground truth.
            Dataset dataset datasets: DatasetFunctions DatasetFunctionsRef, "dataset reader", "dataset readers";
        }
    };
}

/// The functions of a plugin: one that describes it, and for each kind one that makes instances.
///
/// Those that make instances take the place of the component in the description and its parameters as a JSON object.
#[repr(C)]
#[derive(StableAbi)]
#[sabi(kind(Prefix(prefix_ref = PluginRef, prefix_fields = PluginPrefix)))]
pub struct Plugin {
    /// Describes the plugin and its components, as a JSON object.
    pub describe: unsafe extern "C" fn(description: *const Sink, error: *const Sink) -> Status,
    /// Makes a perturbation, which changes frames.
    pub perturbation: unsafe extern "C" fn(
        index: usize,
        parameters: Text,
        into: *mut Instance<PerturbationFunctionsRef>,
        error: *const Sink,
    ) -> Status,
    /// Makes a simulator, which renders frames and moves the vehicle.
    pub simulator: unsafe extern "C" fn(
        index: usize,
        parameters: Text,
        into: *mut Instance<SimulatorFunctionsRef>,
        error: *const Sink,
    ) -> Status,
    /// Makes a driver, which looks at a frame and steers.
    pub driver: unsafe extern "C" fn(
        index: usize,
        parameters: Text,
        into: *mut Instance<DriverFunctionsRef>,
        error: *const Sink,
    ) -> Status,
    /// Makes a saliency method, which says which pixels matter to a driver.
    pub saliency: unsafe extern "C" fn(
        index: usize,
        parameters: Text,
        into: *mut Instance<SaliencyFunctionsRef>,
        error: *const Sink,
    ) -> Status,
    /// Makes a search strategy, which proposes scenarios and learns from outcomes.
    pub search: unsafe extern "C" fn(
        index: usize,
        parameters: Text,
        into: *mut Instance<SearchFunctionsRef>,
        error: *const Sink,
    ) -> Status,
    /// Makes a dataset reader, which reads recorded frames.
    #[sabi(last_prefix_field)]
    pub dataset: unsafe extern "C" fn(
        index: usize,
        parameters: Text,
        into: *mut Instance<DatasetFunctionsRef>,
        error: *const Sink,
    ) -> Status,
    /// The files that an instance of the component with this place, made from these parameters, reads besides those that the
    /// parameters name: a JSON list.
    pub input_files: unsafe extern "C" fn(
        index: usize,
        parameters: Text,
        files: *const Sink,
        error: *const Sink,
    ) -> Status,
    /// Makes a mask, which says where frames are to be perturbed.
    pub mask: unsafe extern "C" fn(
        index: usize,
        parameters: Text,
        into: *mut Instance<MaskFunctionsRef>,
        error: *const Sink,
    ) -> Status,
    /// Makes a predictor, which gives values by name for a frame.
    pub predictor: unsafe extern "C" fn(
        index: usize,
        parameters: Text,
        into: *mut Instance<PredictorFunctionsRef>,
        error: *const Sink,
    ) -> Status,
}

impl RootModule for PluginRef {
    abi_stable::declare_root_module_statics! {PluginRef}
    // By this name a host tells plugins of pdk from those of other programs.
    const BASE_NAME: &'static str = "pdk_plugin";
    const NAME: &'static str = Self::BASE_NAME;
    const VERSION_STRINGS: VersionStrings = abi_stable::package_version_strings!();
}

/// An instance of a component, as a plugin hands it over.
#[repr(C)]
#[derive(StableAbi)]
pub struct Instance<F>
where
    F: StableAbi<IsNonZeroType = True>,
{
    /// The instance, for its functions alone.
    pub object: *mut c_void,
    /// The functions of its kind, which live as long as the library is loaded. A host sets it to `None` before the call.
    pub functions: Option<F>,
}

/// The functions of a perturbation.
#[repr(C)]
#[derive(StableAbi)]
#[sabi(kind(Prefix(prefix_ref = PerturbationFunctionsRef, prefix_fields = PerturbationFunctionsPrefix)))]
pub struct PerturbationFunctions {
    /// Ends the instance.
    pub drop: unsafe extern "C" fn(object: *mut c_void),
    /// Writes the perturbed `source` to `target`, which has the same size.
    #[sabi(last_prefix_field)]
    pub apply: unsafe extern "C" fn(
        object: *mut c_void,
        source: *const Frame,
        target: *const FrameMut,
        context: *const PerturbationContext,
        error: *const Sink,
    ) -> Status,
    /// Moves points as the pixels of a frame of this size are moved: `points` are pairs of x and y, `length` of them, in pixels from
    /// the centre of the first; `way` is one of the numbers of [`way`](crate::way). One that has nowhere to go becomes not a number.
    pub move_points: unsafe extern "C" fn(
        object: *mut c_void,
        points: *mut f64,
        length: usize,
        way: u64,
        width: usize,
        height: usize,
        context: *const PerturbationContext,
        error: *const Sink,
    ) -> Status,
    /// Writes what the driver gets in place of what `told` says.
    pub observe: unsafe extern "C" fn(
        object: *mut c_void,
        told: *const DriveContext,
        context: *const PerturbationContext,
        into: *mut DriveContext,
        error: *const Sink,
    ) -> Status,
    /// Writes what is applied to the vehicle in place of the driver's control.
    pub actuate: unsafe extern "C" fn(
        object: *mut c_void,
        control: *const Control,
        context: *const PerturbationContext,
        into: *mut Control,
        error: *const Sink,
    ) -> Status,
    /// Adds to `into`, `length` numbers, three for each pixel of the picture that it shows, how something changes with them. `of_frame` has
    /// how it changes with the perturbed frame of this size, three numbers for each pixel.
    pub picture_gradient: unsafe extern "C" fn(
        object: *mut c_void,
        of_frame: *const f32,
        width: usize,
        height: usize,
        context: *const PerturbationContext,
        into: *mut f32,
        length: usize,
        error: *const Sink,
    ) -> Status,
}

/// The functions of a simulator.
#[repr(C)]
#[derive(StableAbi)]
#[sabi(kind(Prefix(prefix_ref = SimulatorFunctionsRef, prefix_fields = SimulatorFunctionsPrefix)))]
pub struct SimulatorFunctions {
    /// Ends the instance.
    pub drop: unsafe extern "C" fn(object: *mut c_void),
    /// Size and rate of the camera.
    pub camera: unsafe extern "C" fn(object: *mut c_void, into: *mut Camera, error: *const Sink) -> Status,
    /// Puts the vehicle at the start of a scenario, a JSON object; `slot` is the number of the worker, from 0.
    pub reset: unsafe extern "C" fn(
        object: *mut c_void,
        scenario: Text,
        slot: u32,
        into: *mut State,
        error: *const Sink,
    ) -> Status,
    /// Writes what the camera sees now, and returns the state that belongs to it.
    pub frame: unsafe extern "C" fn(
        object: *mut c_void,
        target: *const FrameMut,
        into: *mut State,
        error: *const Sink,
    ) -> Status,
    /// Applies a control, moves on by one frame, and tells the state after that.
    pub act: unsafe extern "C" fn(
        object: *mut c_void,
        control: *const Control,
        into: *mut State,
        error: *const Sink,
    ) -> Status,
    /// The centre line of the driven lane: a JSON list of `[x, height, z]` in metres.
    #[sabi(last_prefix_field)]
    pub waypoints:
        unsafe extern "C" fn(object: *mut c_void, waypoints: *const Sink, error: *const Sink) -> Status,
    /// What the simulator has told of itself by now: a JSON list of `[name, value]`.
    pub info: unsafe extern "C" fn(object: *mut c_void, info: *const Sink, error: *const Sink) -> Status,
    /// What the simulator can tell apart in its frames: a JSON list of names, empty if it labels nothing.
    pub label_names:
        unsafe extern "C" fn(object: *mut c_void, names: *const Sink, error: *const Sink) -> Status,
    /// Writes for each pixel of the frame that was rendered last the place of what it shows among those names, row by row.
    pub labels:
        unsafe extern "C" fn(object: *mut c_void, into: *mut u8, length: usize, error: *const Sink) -> Status,
    /// Says before a scenario what will be asked for besides frames: numbers of [`annotation`](crate::annotation), added up.
    pub annotate: unsafe extern "C" fn(object: *mut c_void, annotations: u64, error: *const Sink) -> Status,
    /// Writes for each pixel of the frame that was rendered last its distance along the optical axis in metres, row by row;
    /// infinite for the sky.
    pub depth: unsafe extern "C" fn(
        object: *mut c_void,
        into: *mut f32,
        length: usize,
        error: *const Sink,
    ) -> Status,
    /// The numbers that, with the scenario and the number of a frame, decide all that follows: a JSON list of `{"name", "step", "period"}`, empty if the
    /// simulator cannot be put back.
    pub saved_numbers:
        unsafe extern "C" fn(object: *mut c_void, numbers: *const Sink, error: *const Sink) -> Status,
    /// Writes those numbers as they are now.
    pub save: unsafe extern "C" fn(
        object: *mut c_void,
        into: *mut f64,
        length: usize,
        error: *const Sink,
    ) -> Status,
    /// Puts the simulation to the frame with this number, counted from the start of the scenario, in which the numbers are these.
    pub restore: unsafe extern "C" fn(
        object: *mut c_void,
        frame: u64,
        saved: *const f64,
        length: usize,
        into: *mut State,
        error: *const Sink,
    ) -> Status,
}

/// The functions of a driver.
#[repr(C)]
#[derive(StableAbi)]
#[sabi(kind(Prefix(prefix_ref = DriverFunctionsRef, prefix_fields = DriverFunctionsPrefix)))]
pub struct DriverFunctions {
    /// Ends the instance.
    pub drop: unsafe extern "C" fn(object: *mut c_void),
    /// Forgets everything about earlier frames.
    pub reset: unsafe extern "C" fn(object: *mut c_void, error: *const Sink) -> Status,
    /// Decides what to do.
    pub drive: unsafe extern "C" fn(
        object: *mut c_void,
        frame: *const Frame,
        context: *const DriveContext,
        into: *mut Control,
        error: *const Sink,
    ) -> Status,
    /// What was decided when the instance was made: a JSON list of `[name, value]`.
    #[sabi(last_prefix_field)]
    pub info: unsafe extern "C" fn(object: *mut c_void, info: *const Sink, error: *const Sink) -> Status,
    /// Writes how the steering at a frame that counts as the first changes with each of its bytes, row by row, `length` numbers, and the steering.
    pub gradient: unsafe extern "C" fn(
        object: *mut c_void,
        frame: *const Frame,
        context: *const DriveContext,
        into: *mut f32,
        length: usize,
        steering: *mut f64,
        error: *const Sink,
    ) -> Status,
}

/// The functions of a predictor.
#[repr(C)]
#[derive(StableAbi)]
#[sabi(kind(Prefix(prefix_ref = PredictorFunctionsRef, prefix_fields = PredictorFunctionsPrefix)))]
pub struct PredictorFunctions {
    /// Ends the instance.
    pub drop: unsafe extern "C" fn(object: *mut c_void),
    /// Forgets everything about earlier frames.
    pub reset: unsafe extern "C" fn(object: *mut c_void, error: *const Sink) -> Status,
    /// Says what it makes of a frame: a JSON list of `{"name", "shape"}`, and the values of all of them one after the other, each a 32-bit
    /// floating-point number as the machine has it.
    pub predict: unsafe extern "C" fn(
        object: *mut c_void,
        frame: *const Frame,
        context: *const DriveContext,
        outputs: *const Sink,
        values: *const Sink,
        error: *const Sink,
    ) -> Status,
    /// What was decided when the instance was made: a JSON list of `[name, value]`.
    #[sabi(last_prefix_field)]
    pub info: unsafe extern "C" fn(object: *mut c_void, info: *const Sink, error: *const Sink) -> Status,
}

/// The functions of a saliency method.
#[repr(C)]
#[derive(StableAbi)]
#[sabi(kind(Prefix(prefix_ref = SaliencyFunctionsRef, prefix_fields = SaliencyFunctionsPrefix)))]
pub struct SaliencyFunctions {
    /// Ends the instance.
    pub drop: unsafe extern "C" fn(object: *mut c_void),
    /// The size of the map of a frame of this size.
    pub map_size: unsafe extern "C" fn(
        object: *mut c_void,
        width: usize,
        height: usize,
        into: *mut MapSize,
        error: *const Sink,
    ) -> Status,
    /// Writes the map of a frame, which has the size that `map_size` told.
    #[sabi(last_prefix_field)]
    pub map: unsafe extern "C" fn(
        object: *mut c_void,
        frame: *const Frame,
        context: *const MapContext,
        map: *const Heatmap,
        error: *const Sink,
    ) -> Status,
}

/// The functions of a mask.
#[repr(C)]
#[derive(StableAbi)]
#[sabi(kind(Prefix(prefix_ref = MaskFunctionsRef, prefix_fields = MaskFunctionsPrefix)))]
pub struct MaskFunctions {
    /// Ends the instance.
    pub drop: unsafe extern "C" fn(object: *mut c_void),
    /// Writes how much of each pixel of a frame is to be perturbed; the map is as large as the frame.
    #[sabi(last_prefix_field)]
    pub weights: unsafe extern "C" fn(
        object: *mut c_void,
        frame: *const Frame,
        context: *const MapContext,
        map: *const Heatmap,
        error: *const Sink,
    ) -> Status,
}

/// The functions of a search strategy.
#[repr(C)]
#[derive(StableAbi)]
#[sabi(kind(Prefix(prefix_ref = SearchFunctionsRef, prefix_fields = SearchFunctionsPrefix)))]
pub struct SearchFunctions {
    /// Ends the instance.
    pub drop: unsafe extern "C" fn(object: *mut c_void),
    /// Begins a search: what for, and where, is a JSON object; `key` is the origin of all random numbers, 32 bytes.
    pub start:
        unsafe extern "C" fn(object: *mut c_void, problem: Text, key: Text, error: *const Sink) -> Status,
    /// Proposes up to `count` candidates: a JSON list.
    pub ask: unsafe extern "C" fn(
        object: *mut c_void,
        count: usize,
        candidates: *const Sink,
        error: *const Sink,
    ) -> Status,
    /// Learns how candidates did: a JSON list.
    #[sabi(last_prefix_field)]
    pub tell: unsafe extern "C" fn(object: *mut c_void, results: Text, error: *const Sink) -> Status,
}

/// The functions of a dataset reader.
#[repr(C)]
#[derive(StableAbi)]
#[sabi(kind(Prefix(prefix_ref = DatasetFunctionsRef, prefix_fields = DatasetFunctionsPrefix)))]
pub struct DatasetFunctions {
    /// Ends the instance.
    pub drop: unsafe extern "C" fn(object: *mut c_void),
    /// The number of frames.
    pub length: unsafe extern "C" fn(object: *mut c_void, into: *mut u64, error: *const Sink) -> Status,
    /// The name of a frame.
    pub name: unsafe extern "C" fn(
        object: *mut c_void,
        index: u64,
        name: *const Sink,
        error: *const Sink,
    ) -> Status,
    /// Reads a frame: RGB, a byte each, rows from top to bottom without gaps.
    #[sabi(last_prefix_field)]
    pub read: unsafe extern "C" fn(
        object: *mut c_void,
        index: u64,
        into: *mut Entry,
        pixels: *const Sink,
        error: *const Sink,
    ) -> Status,
    /// Where in its recording a frame lies.
    pub position: unsafe extern "C" fn(
        object: *mut c_void,
        index: u64,
        into: *mut Position,
        error: *const Sink,
    ) -> Status,
    /// What was decided when the recording was opened: a JSON list of `[name, value]`.
    pub info: unsafe extern "C" fn(object: *mut c_void, info: *const Sink, error: *const Sink) -> Status,
    /// How the recording is written again in its own form: a JSON object, or `null` if only its frames can be had.
    pub form: unsafe extern "C" fn(object: *mut c_void, form: *const Sink, error: *const Sink) -> Status,
    /// Writes a file of the recording again: which one, where and how is a JSON object.
    pub rewrite: unsafe extern "C" fn(
        object: *mut c_void,
        wanted: Text,
        perturber: *const Perturber,
        error: *const Sink,
    ) -> Status,
}
