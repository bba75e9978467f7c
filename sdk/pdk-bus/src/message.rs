//! What travels on the topics. Every type here has a fixed C layout and a fixed type name, so that a tap
//! written in C++ or Python can declare the same type and read the same memory.

use std::{fmt, str::FromStr};

use iceoryx2::prelude::ZeroCopySend;

use pdk_model::control::Control;
use pdk_model::state::State;

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

/// The payload of [`Topic::Control`]: the numbers of a [`Control`], in the order of [`Control::NUMBERS`].
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, ZeroCopySend)]
#[type_name("PdkControl")]
pub(crate) struct ControlMessage {
    numbers: [f64; Control::NUMBERS.len()],
}

impl From<Control> for ControlMessage {
    fn from(control: Control) -> Self {
        Self { numbers: control.numbers() }
    }
}

impl From<ControlMessage> for Control {
    fn from(message: ControlMessage) -> Self {
        Self::from_numbers(message.numbers)
    }
}

/// The payload of [`Topic::State`]: the numbers of a [`State`], in the order of [`State::NUMBERS`], and its flags.
#[repr(C)]
#[derive(Debug, Clone, Copy, PartialEq, ZeroCopySend)]
#[type_name("PdkState")]
pub(crate) struct StateMessage {
    numbers: [f64; State::NUMBERS.len()],
    /// A bit for each of [`State::FLAGS`], the lowest for the first.
    flags: u32,
    /// Fills the struct to a multiple of 8 bytes; 0.
    reserved: u32,
}

impl From<State> for StateMessage {
    fn from(state: State) -> Self {
        let bits = state.flags().into_iter().enumerate().map(|(bit, set)| u32::from(set) << bit);
        Self { numbers: state.numbers(), flags: bits.sum(), reserved: 0 }
    }
}

impl From<StateMessage> for State {
    fn from(message: StateMessage) -> Self {
        Self::from_parts(message.numbers, std::array::from_fn(|bit| message.flags >> bit & 1 == 1))
    }
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
        assert_eq!(size_of::<StateMessage>(), 80);
        assert_eq!(std::mem::offset_of!(StateMessage, flags), 72);
        let state = State { speed: 8.5, collision: true, ..State::default() };
        assert_eq!((StateMessage::from(state).flags, State::from(StateMessage::from(state))), (2, state));
    }

    #[test]
    fn run_hash_is_fnv_1a() {
        // The test vectors of the algorithm's authors.
        assert_eq!(run_hash(""), 0xcbf2_9ce4_8422_2325);
        assert_eq!(run_hash("a"), 0xaf63_dc4c_8601_ec8c);
        assert_eq!(run_hash("foobar"), 0x8594_4171_f739_67e8);
    }
}
