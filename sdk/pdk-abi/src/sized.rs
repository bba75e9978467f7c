//! The values of a call, which may grow at their end: every structure here begins with its size and crosses by pointer.

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
        /// How much each pixel matters to the driver, 0 to 1, row by row, as large as the frame; null if there is no such map.
        pub saliency: *const f32,
        /// The number of its values.
        pub saliency_length: usize,
        /// The saliency maps of the sequence so far, the oldest first: since when each was in use, in seconds; null if there are none.
        pub earlier_times: *const f64,
        /// How many there are.
        pub earlier_length: usize,
        /// Their values, one map after the other, row by row; each covers the whole frame.
        pub earlier_values: *const f32,
        /// Values in a row of each.
        pub earlier_width: usize,
        /// Rows of each.
        pub earlier_height: usize,
        /// How far the vehicle has driven since the start of the sequence, in metres; not a number if it is not known.
        pub travelled: f64,
        /// Earlier frames of the sequence, in slots that are used in turn: slot after slot, each as large as a frame and laid out without
        /// gaps; null if there are none.
        pub history: *const u8,
        /// The number of slots.
        pub history_slots: usize,
        /// The slot of the latest frame; the one before it is in the slot before it, and before the first slot comes the last.
        pub history_latest: usize,
        /// How many slots are in use: the latest and those before it.
        pub history_length: usize,
        /// The number of the frame in each slot.
        pub history_indices: *const u64,
        /// The time of the frame in each slot, in seconds since the start of the sequence.
        pub history_times: *const f64,
        /// Pixels in a row of each.
        pub history_width: usize,
        /// Rows of each.
        pub history_height: usize,
        /// How long a frame lasts at the camera's rate, in seconds; 0 if it is not known.
        pub period: f64,
        /// The numbers of the frames before this one at which signals passed, the oldest first; null if there are none.
        pub signal_indices: *const u64,
        /// How many there are.
        pub signals_length: usize,
        /// The time of each, in seconds since the start of the sequence.
        pub signal_times: *const f64,
        /// What the perturbation was given at each: two numbers, steering and throttle or time and speed.
        pub signals_given: *const f64,
        /// What it made of them.
        pub signals_passed: *const f64,
        /// How far away each pixel is along the optical axis in metres, row by row; null if that is not known or not asked for.
        pub depth: *const f32,
        /// The number of its values.
        pub depth_length: usize,
        /// The vehicle's speed in metres per second; not a number where it is not known.
        pub speed: f64,
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
        /// Free distance to the vehicle ahead in metres; infinite if there is none.
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

    /// What a driver knows besides the frame.
    pub struct DriveContext {
        /// The number of the frame in its sequence, from 0.
        pub frame_index: u64,
        /// Simulation time in seconds since the start of the sequence.
        pub time: f64,
        /// The vehicle's speed in metres per second; not a number if it is not known.
        pub speed: f64,
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
        /// The vehicle's speed in metres per second; not a number if it is not known.
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

    /// What was recorded with a frame.
    pub struct Entry {
        /// Pixels in a row.
        pub width: usize,
        /// Rows.
        pub height: usize,
        /// The recorded steering, -1 to 1; not a number if none was recorded.
        pub steering: f64,
        /// The recorded throttle, -1 to 1; not a number if none was recorded.
        pub throttle: f64,
        /// Seconds since the first frame.
        pub time: f64,
        /// The recorded speed in metres per second; not a number if none was recorded.
        pub speed: f64,
    }

    /// Where in its recording a frame lies.
    pub struct Position {
        /// The part of the recording that it belongs to: what follows each other is of one part.
        pub part: u64,
        /// Its number in that part, as it was recorded.
        pub number: u64,
        /// Seconds since the first frame of the recording; not a number if it is not known.
        pub time: f64,
    }

    /// Perturbs the frames of a recording that is written again.
    pub struct Perturber {
        /// For the function alone.
        pub context: *mut c_void,
        /// Writes what a frame, known by its number in the recording, is to be in the copy; both have the same size.
        pub apply: Option<
            unsafe extern "C" fn(
                context: *mut c_void,
                index: u64,
                source: *const Frame,
                target: *const FrameMut,
                error: *const Sink,
            ) -> Status,
        >,
    }
}

impl Sink {
    /// Passes bytes on; nothing if the other side takes none.
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
