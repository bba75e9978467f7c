//! The topics of a pdk run in shared memory.
//!
//! Every loop of a run publishes four topics through iceoryx2: the frame as it came (`raw`), the frame as the
//! driver sees it (`perturbed`), the driver's answer (`control`) and what the vehicle did (`state`). The
//! services are named `pdk/<run>/<lane>/<topic>`; `lane` numbers the loops of a run that work side by side.
//! Every message carries a [`FrameHeader`].
//!
//! The loop owns a [`Bus`]: it borrows the memory of a frame, writes into it and publishes it, and nothing is
//! copied. Any other process opens a [`Tap`]. A slow tap loses the oldest frames, it never holds up the loop.
//!
//! A tap in another language opens the same services with its own iceoryx2 0.10: publish-subscribe, user header
//! `PdkFrameHeader`, payload a slice of `u8` for the frames, `PdkControl` and `PdkState` for the others, with the
//! fields in the order given here.
//!
//! A [`Bus`] or [`Tap`] that is dropped takes its files along. Those of a killed process stay in `/dev/shm` and
//! `/tmp/iceoryx2` until the next bus or tap is made, or [`cleanup_dead`] is called. Only the user who started
//! the first process on a machine can use its folder; other users give theirs with [`ROOT_VARIABLE`].

mod bus;
mod error;
mod message;
mod service;
mod tap;

pub use bus::{Bus, FrameLoan, FrameSample};
pub use error::{Error, Result};
pub use message::{ControlMessage, FORMAT_RGB8, FrameHeader, Stamp, StateMessage, Topic, run_hash};
pub use service::{LATEST, ROOT_VARIABLE, cleanup_dead, monotonic_nanoseconds};
pub use tap::{Message, RunTopics, Tap};
