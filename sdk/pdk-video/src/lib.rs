//! Videos as frames, one at a time: a video is never in memory as a whole.
//!
//! [`Video`] opens any: [`Reader`] decodes H.264 in MP4 files, and [`Ffmpeg`] leaves the others to the program of that name.
//! [`Recoding`] writes one again with other pictures, in the same way.
//!
//! [`Writer`] is deterministic: the same frames give the same bytes. It writes colours by ITU-R BT.601 with luma from 16 to 235.
//!
//! [`Reader`] and [`Stream`] read the matrix and the range of colours from the stream (ITU-T H.264, annex E): BT.601 or BT.709, limited or
//! full. A stream that names none has BT.601 with luma from 16 to 235. Files with another matrix are left to ffmpeg, which converts
//! everything that it decodes to BT.601 with luma from 16 to 235.

mod assembly;
mod boxes;
#[cfg(test)]
mod coded;
mod container;
mod convert;
mod encoder;
mod ffmpeg;
mod fragments;
mod index;
mod matroska;
mod process;
mod reader;
mod recode;
mod sample;
mod sps;
#[cfg(test)]
mod stand_in;
mod stream;
mod timing;
mod turn;
mod video;
mod writer;

/// MP4 files without their frames being decoded or encoded.
pub mod mp4 {
    pub use crate::container::Mp4;
    pub use crate::index::{Index, Indexed, index};
    pub use crate::sample::Sample;
}

pub use assembly::has_assembly;
pub use convert::Yuv420;
pub use encoder::{Encoder, Units};
pub use ffmpeg::Ffmpeg;
pub use reader::{Container, Input, Opened, Reader, container};
pub use recode::{Recoder, Recoding};
pub use stream::{Stream, begins_anew};
pub use timing::Timing;
pub use video::Video;
pub use writer::Writer;

// The example in the README compiles.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
