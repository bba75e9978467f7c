//! H.264 videos in MP4 files as frames, one at a time: a video is never in memory as a whole.
//!
//! [`Writer`] is deterministic: the same frames give the same bytes. Colours are those of ITU-R BT.601 with luma from 16 to
//! 235.

mod assembly;
mod bounded;
mod convert;
mod index;
mod reader;
mod timing;
mod turn;
mod writer;

pub use assembly::has_assembly;
pub use bounded::Input;
pub use convert::Yuv420;
pub use reader::{Container, Opened, Reader, container, only_h264};
pub use writer::Writer;

// The example in the README compiles.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
