//! Frames and keyed random streams.

pub mod frame;
pub mod random;

pub use frame::{Frame, FrameBuf, FrameError, FrameMut};
pub use random::{Key, Random};
