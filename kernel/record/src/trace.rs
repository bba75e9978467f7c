//! The trace of a scenario as MCAP: frames, control, state, events and the road, for Foxglove, Rerun and everything else that
//! reads the format. Times are simulation times, so that two equal runs write equal files.
//!
//! | topic | message | holds |
//! |---|---|---|
//! | `/state` | `pdk.State` | every frame's state, with a hash of what the driver saw |
//! | `/control` | `pdk.Control` | what the driver decided |
//! | `/observed`, `/applied` | `pdk.Observation`, `pdk.Control` | the time and speed that the driver got, and what was applied to the vehicle, if perturbations change them |
//! | `/raw`, `/perturbed` | `foxglove.CompressedImage` | some frames, as the camera and as the driver saw them |
//! | `/event` | `foxglove.Log` | the start, failures, the end |
//! | `/road` | `pdk.Road` | the centre line of the driven lane, where the simulator tells |
//!
//! [`writer`] writes a trace, [`reader`] reads one, whole or cut off; [`step`] is what they speak of.

mod chunks;
pub mod ending;
mod message;
mod protobuf;
pub mod reader;
pub mod step;
pub mod writer;
