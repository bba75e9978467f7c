//! What may grow at its end: every structure here begins with its size and crosses by pointer.
//!
//! Functions of an instance take its object first, and last the sink for the sentence of an error. Functions that were added
//! later than the first version are null in the table of an older plugin; the others are not.

use core::ffi::c_void;

use crate::declare::sized;
use crate::fixed::{Status, Text};

sized! {
    /// Takes bytes of unknown number from the other side, in one or several pieces.
    pub struct Sink {
        /// For the function alone.
        pub context: *mut c_void,
        /// Takes the next bytes.
        pub write: Option<unsafe extern "C" fn(context: *mut c_void, bytes: Text)>,
    }

    /// The functions of a plugin.
    pub struct Plugin {
        /// Describes the plugin and its components, as a JSON object.
        pub describe: Option<unsafe extern "C" fn(description: *const Sink, error: *const Sink) -> Status>,
        /// Makes an instance of the component with this place in the description, from its parameters as a JSON object.
        pub create: Option<unsafe extern "C" fn(
            index: usize,
            parameters: Text,
            into: *mut Instance,
            error: *const Sink,
        ) -> Status>,
        /// The files that an instance of the component with this place, made from these parameters, reads besides those that the
        /// parameters name: a JSON list. Null in the first plugins.
        pub input_files: Option<unsafe extern "C" fn(
            index: usize,
            parameters: Text,
            files: *const Sink,
            error: *const Sink,
        ) -> Status>,
    }

    /// An instance of a component.
    pub struct Instance {
        /// One of the numbers of [`kind`](crate::kind).
        pub kind: u64,
        /// The instance, for its functions alone.
        pub object: *mut c_void,
        /// The table of the functions of this kind; it lives as long as the library is loaded.
        pub functions: *const c_void,
    }

    /// A frame to read: RGB, a byte each, rows from top to bottom.
    pub struct Frame {
        /// The first pixel.
        pub data: *const u8,
        /// The number of bytes, of which the last belongs to the last pixel.
        pub length: usize,
        /// Pixels in a row.
        pub width: usize,
        /// Rows.
        pub height: usize,
        /// Bytes from the beginning of one row to that of the next.
        pub stride: usize,
    }

    /// A frame to write, laid out as [`Frame`].
    pub struct FrameMut {
        /// The first pixel.
        pub data: *mut u8,
        /// The number of bytes, of which the last belongs to the last pixel.
        pub length: usize,
        /// Pixels in a row.
        pub width: usize,
        /// Rows.
        pub height: usize,
        /// Bytes from the beginning of one row to that of the next.
        pub stride: usize,
    }

    /// What a perturbation knows about the frame at hand.
    pub struct PerturbationContext {
        /// The intensity: 0 to 4, any real number in between.
        pub intensity: f64,
        /// The number of the frame in its sequence, from 0.
        pub frame_index: u64,
        /// Simulation time in seconds since the start of the sequence.
        pub time: f64,
        /// The origin of all random numbers of the instance.
        pub key: [u8; 32],
        /// The stream of what is drawn anew for every frame.
        pub stream: u64,
        /// A number for each parameter, in the order of the description.
        pub values: *const f64,
        /// How many there are.
        pub values_length: usize,
        /// How much each pixel matters to the driver, 0 to 1, row by row, as large as the frame; null where there is no such map.
        pub saliency: *const f32,
        /// The number of its values.
        pub saliency_length: usize,
        /// The saliency maps of the sequence so far, the oldest first: since when each was in use, in seconds; null where there are none.
        pub earlier_times: *const f64,
        /// How many there are.
        pub earlier_length: usize,
        /// Their values, one map after the other, row by row; each covers the whole frame.
        pub earlier_values: *const f32,
        /// Values in a row of each.
        pub earlier_width: usize,
        /// Rows of each.
        pub earlier_height: usize,
        /// How far the vehicle has driven since the start of the sequence, in metres; not a number where it is not known.
        pub travelled: f64,
    }

    /// The functions of a perturbation.
    pub struct PerturbationFunctions {
        /// Ends the instance.
        pub drop: Option<unsafe extern "C" fn(object: *mut c_void)>,
        /// Writes the perturbed `source` to `target`, which has the same size.
        pub apply: Option<unsafe extern "C" fn(
            object: *mut c_void,
            source: *const Frame,
            target: *const FrameMut,
            context: *const PerturbationContext,
            error: *const Sink,
        ) -> Status>,
    }

    /// Size and rate of a simulator's camera.
    pub struct Camera {
        /// Pixels in a row.
        pub width: u32,
        /// Rows.
        pub height: u32,
        /// Frames per second of simulation time.
        pub rate: f64,
    }

    /// The state of the ego vehicle at one moment.
    pub struct State {
        /// Simulation time in seconds since the start of the scenario.
        pub time: f64,
        /// Position of the vehicle's centre in metres: x, height, z.
        pub position: [f64; 3],
        /// Heading in radians, clockwise seen from above, 0 towards +z.
        pub heading: f64,
        /// Speed in metres per second.
        pub speed: f64,
        /// Signed distance of the vehicle's centre from the lane's centre line in metres, positive to the right.
        pub cross_track_error: f64,
        /// The share of the road that has been driven, 0 to 1.
        pub progress: f64,
        /// Free distance to the vehicle ahead in metres; infinite where there is none.
        pub vehicle_ahead: f64,
        /// The sum of those numbers of [`state_flag`] that apply.
        pub flags: u64,
    }

    /// What a driver decides.
    pub struct Control {
        /// -1 (full left) to 1 (full right).
        pub steering: f64,
        /// -1 (full brake) to 1 (full throttle).
        pub throttle: f64,
    }

    /// The functions of a simulator.
    pub struct SimulatorFunctions {
        /// Ends the instance.
        pub drop: Option<unsafe extern "C" fn(object: *mut c_void)>,
        /// Size and rate of the camera.
        pub camera: Option<unsafe extern "C" fn(
            object: *mut c_void,
            into: *mut Camera,
            error: *const Sink,
        ) -> Status>,
        /// Puts the vehicle at the start of a scenario, a JSON object; `slot` is the number of the worker, from 0.
        pub reset: Option<unsafe extern "C" fn(
            object: *mut c_void,
            scenario: Text,
            slot: u32,
            into: *mut State,
            error: *const Sink,
        ) -> Status>,
        /// Writes what the camera sees now, and tells the state that belongs to it.
        pub frame: Option<unsafe extern "C" fn(
            object: *mut c_void,
            target: *const FrameMut,
            into: *mut State,
            error: *const Sink,
        ) -> Status>,
        /// Applies a control, moves on by one frame, and tells the state after that.
        pub act: Option<unsafe extern "C" fn(
            object: *mut c_void,
            control: *const Control,
            into: *mut State,
            error: *const Sink,
        ) -> Status>,
        /// The centre line of the driven lane: a JSON list of `[x, height, z]` in metres.
        pub waypoints: Option<unsafe extern "C" fn(
            object: *mut c_void,
            waypoints: *const Sink,
            error: *const Sink,
        ) -> Status>,
        /// What the simulator has told of itself by now: a JSON list of `[name, value]`. Null in the first plugins.
        pub info: Option<unsafe extern "C" fn(
            object: *mut c_void,
            info: *const Sink,
            error: *const Sink,
        ) -> Status>,
        /// What the simulator can tell apart in its frames: a JSON list of names, empty where it labels nothing.
        pub label_names: Option<unsafe extern "C" fn(
            object: *mut c_void,
            names: *const Sink,
            error: *const Sink,
        ) -> Status>,
        /// Writes for each pixel of the frame that was rendered last the place of what it shows among those names, row by row.
        pub labels: Option<unsafe extern "C" fn(
            object: *mut c_void,
            into: *mut u8,
            length: usize,
            error: *const Sink,
        ) -> Status>,
        /// Says before a scenario what will be asked for besides frames: numbers of [`annotation`](crate::annotation), added up.
        pub annotate: Option<unsafe extern "C" fn(
            object: *mut c_void,
            annotations: u64,
            error: *const Sink,
        ) -> Status>,
        /// Writes for each pixel of the frame that was rendered last its distance along the optical axis in metres, row by row;
        /// infinite for the sky.
        pub depth: Option<unsafe extern "C" fn(
            object: *mut c_void,
            into: *mut f32,
            length: usize,
            error: *const Sink,
        ) -> Status>,
    }

    /// What a driver knows besides the frame.
    pub struct DriveContext {
        /// The number of the frame in its sequence, from 0.
        pub frame_index: u64,
        /// Simulation time in seconds since the start of the sequence.
        pub time: f64,
        /// The vehicle's speed in metres per second; not a number where it is not known.
        pub speed: f64,
    }

    /// The functions of a driver.
    pub struct DriverFunctions {
        /// Ends the instance.
        pub drop: Option<unsafe extern "C" fn(object: *mut c_void)>,
        /// Forgets everything about earlier frames.
        pub reset: Option<unsafe extern "C" fn(object: *mut c_void, error: *const Sink) -> Status>,
        /// Decides what to do.
        pub drive: Option<unsafe extern "C" fn(
            object: *mut c_void,
            frame: *const Frame,
            context: *const DriveContext,
            into: *mut Control,
            error: *const Sink,
        ) -> Status>,
        /// What was decided when the instance was made: a JSON list of `[name, value]`.
        pub info: Option<unsafe extern "C" fn(
            object: *mut c_void,
            info: *const Sink,
            error: *const Sink,
        ) -> Status>,
    }

    /// The size of a saliency map.
    pub struct MapSize {
        /// Values in a row.
        pub width: usize,
        /// Rows.
        pub height: usize,
    }

    /// What a saliency method knows besides the frame.
    pub struct MapContext {
        /// The number of the frame in its sequence, from 0.
        pub frame_index: u64,
        /// Simulation time in seconds since the start of the sequence.
        pub time: f64,
        /// The origin of all random numbers of the instance.
        pub key: [u8; 32],
        /// The vehicle's speed in metres per second; not a number where it is not known.
        pub speed: f64,
        /// The sum of those numbers of [`map_flag`] that apply.
        pub flags: u64,
    }

    /// A saliency map to write, row by row without gaps.
    pub struct Heatmap {
        /// The first value.
        pub values: *mut f32,
        /// Values in a row.
        pub width: usize,
        /// Rows.
        pub height: usize,
    }

    /// The functions of a saliency method.
    pub struct SaliencyFunctions {
        /// Ends the instance.
        pub drop: Option<unsafe extern "C" fn(object: *mut c_void)>,
        /// The size of the map of a frame of this size.
        pub map_size: Option<unsafe extern "C" fn(
            object: *mut c_void,
            width: usize,
            height: usize,
            into: *mut MapSize,
            error: *const Sink,
        ) -> Status>,
        /// Writes the map of a frame, which has the size that `map_size` told.
        pub map: Option<unsafe extern "C" fn(
            object: *mut c_void,
            frame: *const Frame,
            context: *const MapContext,
            map: *const Heatmap,
            error: *const Sink,
        ) -> Status>,
    }

    /// The functions of a mask.
    pub struct MaskFunctions {
        /// Ends the instance.
        pub drop: Option<unsafe extern "C" fn(object: *mut c_void)>,
        /// Writes how much of each pixel of a frame is to be perturbed; the map is as large as the frame.
        pub weights: Option<unsafe extern "C" fn(
            object: *mut c_void,
            frame: *const Frame,
            context: *const MapContext,
            map: *const Heatmap,
            error: *const Sink,
        ) -> Status>,
    }

    /// The functions of a search strategy.
    pub struct SearchFunctions {
        /// Ends the instance.
        pub drop: Option<unsafe extern "C" fn(object: *mut c_void)>,
        /// Begins a search: what for, and where, is a JSON object; `key` is the origin of all random numbers, 32 bytes.
        pub start: Option<unsafe extern "C" fn(
            object: *mut c_void,
            problem: Text,
            key: Text,
            error: *const Sink,
        ) -> Status>,
        /// Proposes up to `count` candidates: a JSON list.
        pub ask: Option<unsafe extern "C" fn(
            object: *mut c_void,
            count: usize,
            candidates: *const Sink,
            error: *const Sink,
        ) -> Status>,
        /// Learns how candidates did: a JSON list.
        pub tell: Option<unsafe extern "C" fn(
            object: *mut c_void,
            results: Text,
            error: *const Sink,
        ) -> Status>,
    }

    /// What was recorded with a frame.
    pub struct Entry {
        /// Pixels in a row.
        pub width: usize,
        /// Rows.
        pub height: usize,
        /// The recorded steering, -1 to 1.
        pub steering: f64,
        /// The recorded throttle, -1 to 1.
        pub throttle: f64,
        /// Seconds since the first frame.
        pub time: f64,
    }

    /// The functions of a dataset reader.
    pub struct DatasetFunctions {
        /// Ends the instance.
        pub drop: Option<unsafe extern "C" fn(object: *mut c_void)>,
        /// The number of frames.
        pub length: Option<unsafe extern "C" fn(
            object: *mut c_void,
            into: *mut u64,
            error: *const Sink,
        ) -> Status>,
        /// The name of a frame.
        pub name: Option<unsafe extern "C" fn(
            object: *mut c_void,
            index: u64,
            name: *const Sink,
            error: *const Sink,
        ) -> Status>,
        /// Reads a frame: RGB, a byte each, rows from top to bottom without gaps.
        pub read: Option<unsafe extern "C" fn(
            object: *mut c_void,
            index: u64,
            into: *mut Entry,
            pixels: *const Sink,
            error: *const Sink,
        ) -> Status>,
    }
}

impl Sink {
    /// Passes bytes on; nothing where the other side takes none.
    ///
    /// # Safety
    /// The sink is that of a call in progress.
    pub unsafe fn put(&self, bytes: &[u8]) {
        if let Some(write) = self.write {
            // SAFETY: the caller's promise; the bytes live through the call.
            unsafe { write(self.context, Text::new(bytes)) };
        }
    }
}

/// What a [`MapContext`] can say besides its numbers, added up.
pub mod map_flag {
    crate::declare::numbers! {
        /// The frame is of a recording and may come again, so that what took long to compute is worth keeping.
        pub const RECORDED = 1;
    }
}

/// What a [`State`] can say besides its numbers, added up.
pub mod state_flag {
    crate::declare::numbers! {
        /// The vehicle has left its lane.
        pub const LANE_DEPARTURE = 1;
        /// The vehicle has hit something.
        pub const COLLISION = 2;
        /// The vehicle has reached the end of the road.
        pub const FINISHED = 4;
    }
}
