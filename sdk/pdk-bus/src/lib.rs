//! The topics of a pdk run in shared memory.
//!
//! Every loop of a run publishes four topics through iceoryx2: the frame as it came (`raw`), the frame as the
//! driver sees it (`perturbed`), the driver's answer (`control`) and what the vehicle did (`state`). The loops of
//! a run that work side by side are numbered by slots. Every message carries a [`FrameHeader`].
//!
//! The loop owns a [`Bus`]: it borrows the memory of a frame, writes all of it and publishes it, and nothing is
//! copied. Any other process of the same user opens a [`Tap`]. A slow tap loses the oldest frames, it never holds
//! up the loop.
//!
//! # Where a bus lies
//!
//! Each bus has a folder of its own, its root: `<base>/<run>/<slot>-<random>/`. The base is [`BASE_VARIABLE`],
//! else `pdk` in `$XDG_RUNTIME_DIR` if that is this user's, else `/dev/shm/pdk-<user number>`; it should lie in
//! memory, as iceoryx2 waits for the disk often. All of it is for this user alone, so users do not meet. All files of the bus in `/dev/shm` begin with `pdk_<random>_`. So no bus
//! can block or damage another, whatever state it was left in.
//!
//! The owner of a bus holds a lock in its root for as long as it lives. A [`Bus`] that is dropped takes root and
//! shared memory off the machine, taps or not. A killed process cannot: [`sweep`] does so for all whose owner is
//! dead, by deleting files only. A process that has to end while a thread is inside its bus calls [`remove`].
//!
//! # Taps in other languages
//!
//! A root holds the file `iceoryx2.toml` once its bus is complete: the configuration with which any language opens
//! the topics with its own iceoryx2 0.10 (`Config::from_file`, then a node with this configuration). It sets
//! `global.root-path` and `global.prefix`. A root is of a living bus if its file `lock` is locked (`flock`);
//! `pdk tap --list` prints the roots.
//!
//! The services are `pdk/raw`, `pdk/perturbed`, `pdk/control` and `pdk/state`: publish-subscribe, user header
//! `PdkFrameHeader`, payload a slice of `u8` for the frames, `PdkControl` (the numbers of a control as 64-bit
//! floating-point numbers, in the order of `pdk_model::control::Control::NUMBERS`) and `PdkState` (those of a state, in the order of
//! `pdk_model::state::State::NUMBERS`, then 32 bits of flags in the order of `State::FLAGS`, the lowest first, and 32 bits of 0).

mod base;
mod bus;
mod error;
mod layout;
mod link;
mod message;
mod remedy;
mod removal;
mod root;
mod service;
mod sweep;
mod tap;
#[cfg(test)]
mod testing;
mod topics;

pub use base::BASE_VARIABLE;
pub use bus::Bus;
pub use error::{Error, Result};
pub use layout::LATEST;
pub use link::Message;
pub use message::{FORMAT_RGB8, FrameHeader, Stamp, Topic, run_hash};
pub use removal::remove;
pub use service::monotonic_nanoseconds;
pub use sweep::{sweep, sweep_run};
pub use tap::{RunTopics, SlotTopics, Tap};
pub use topics::{FrameLoan, FrameSample};

// The example in the README compiles.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
