//! What travels on the topics. Every type here has a fixed C layout and a fixed type name, so that a tap
//! written in C++ or Python can declare the same type and read the same memory.

use std::{fmt, str::FromStr};

use iceoryx2::prelude::ZeroCopySend;

use crate::error::{Error, Result};

/// The only pixel format in use: rows of interleaved 8-bit red, green, blue, top row first, no gaps.
pub const FORMAT_RGB8: u32 = 1;

/// One of the topics of a loop.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Topic {
    /// The frame as the simulator or dataset gave it.
    Raw,
    /// The frame as the driver sees it, after the perturbations.
    Perturbed,
    /// What the driver answered.
    Control,
    /// What the vehicle did.
    State,
}

impl Topic {
    /// All topics, in the order of a step.
    pub const ALL: [Self; 4] = [Self::Raw, Self::Perturbed, Self::Control, Self::State];

    /// The last part of the service name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Raw => "raw",
            Self::Perturbed => "perturbed",
            Self::Control => "control",
            Self::State => "state",
        }
    }
}

impl fmt::Display for Topic {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.pad(self.name())
    }
}

impl FromStr for Topic {
    type Err = Error;

    fn from_str(name: &str) -> Result<Self> {
        Self::ALL.into_iter().find(|topic| topic.name() == name).ok_or_else(|| {
            Error::new(format!("there is no topic `{name}`: use raw, perturbed, control or state"))
        })
    }
}

/// Where a message stands in the experiment; the sender of the message gives it.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Stamp {
    /// Number of the scenario within the run, from 0.
    pub scenario: u64,
    /// Number of the frame within the scenario, from 0.
    pub sequence: u64,
    /// Simulation time in seconds since the start of the scenario.
    pub time: f64,
}

/// The user header of every message on every topic.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend)]
#[type_name("PdkFrameHeader")]
pub struct FrameHeader {
    /// The run, as [`run_hash`] of its id. The id itself is the name of the folder in which the root lies.
    pub run: u64,
    /// Number of the scenario within the run, from 0.
    pub scenario: u64,
    /// Number of the frame within the scenario, from 0.
    pub sequence: u64,
    /// Number of the message on this topic since the bus was created, from 0, over all scenarios. It rises by
    /// one with every message sent, so a gap is what the receiver lost.
    pub number: u64,
    /// Simulation time in seconds since the start of the scenario.
    pub time: f64,
    /// When the message was sent: nanoseconds of the monotonic clock, comparable between the processes of
    /// one machine.
    pub sent_at: u64,
    /// The slot of the loop within the run, from 0.
    pub slot: u32,
    /// Width in pixels of the frames of this loop.
    pub width: u32,
    /// Height in pixels of the frames of this loop.
    pub height: u32,
    /// Pixel format of the frames of this loop: [`FORMAT_RGB8`].
    pub format: u32,
}

/// What the driver answered to a frame: the payload of [`Topic::Control`].
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend)]
#[type_name("PdkControl")]
pub struct ControlMessage {
    /// Steering, -1 (full left) to 1 (full right).
    pub steering: f64,
    /// Throttle, -1 (full brake) to 1 (full throttle).
    pub throttle: f64,
}

/// What the vehicle did: the payload of [`Topic::State`]. The time is in the header.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, Default, ZeroCopySend)]
#[type_name("PdkState")]
pub struct StateMessage {
    /// Position in metres, in the axes of the simulator.
    pub position: [f64; 3],
    /// Heading in radians, in the axes of the simulator.
    pub heading: f64,
    /// Speed in metres per second.
    pub speed: f64,
    /// Signed distance to the middle of the lane in metres.
    pub cross_track_error: f64,
    /// Part of the road that is driven, 0 to 1.
    pub progress: f64,
    /// Free distance to the vehicle ahead in metres; infinite where there is none.
    pub vehicle_ahead: f64,
    /// Sum of [`Self::LANE_DEPARTURE`], [`Self::COLLISION`] and [`Self::FINISHED`] where they hold.
    pub flags: u32,
    /// Fills the struct to a multiple of 8 bytes; 0.
    pub reserved: u32,
}

impl StateMessage {
    /// The vehicle is outside its lane.
    pub const LANE_DEPARTURE: u32 = 1;
    /// The vehicle has hit something.
    pub const COLLISION: u32 = 2;
    /// The vehicle has reached the end of the road.
    pub const FINISHED: u32 = 4;
}

/// The number that stands for a run in [`FrameHeader::run`]: the 64-bit FNV-1a hash of its id.
pub fn run_hash(run: &str) -> u64 {
    run.bytes()
        .fold(0xcbf2_9ce4_8422_2325, |hash, byte| (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn topics_parse_from_their_names() {
        for topic in Topic::ALL {
            assert_eq!(topic.name().parse(), Ok(topic));
        }
        let error = "pertubed".parse::<Topic>().unwrap_err();
        assert_eq!(error.message(), "there is no topic `pertubed`: use raw, perturbed, control or state");
    }

    #[test]
    fn layouts_are_those_that_other_languages_declare() {
        assert_eq!(size_of::<FrameHeader>(), 64);
        assert_eq!(std::mem::offset_of!(FrameHeader, sent_at), 40);
        assert_eq!(std::mem::offset_of!(FrameHeader, format), 60);
        assert_eq!(size_of::<ControlMessage>(), 16);
        assert_eq!(size_of::<StateMessage>(), 72);
        assert_eq!(std::mem::offset_of!(StateMessage, flags), 64);
    }

    #[test]
    fn run_hash_is_fnv_1a() {
        // The test vectors of the algorithm's authors.
        assert_eq!(run_hash(""), 0xcbf2_9ce4_8422_2325);
        assert_eq!(run_hash("a"), 0xaf63_dc4c_8601_ec8c);
        assert_eq!(run_hash("foobar"), 0x8594_4171_f739_67e8);
    }
}
