//! The drivers: [`onnx`] runs a network in a file, the others those that are part of this plugin ([`trained`]).

mod dave2;
mod dave2_augmented;
mod dave2_temporal;
mod dave2_tub;
mod onnx;
mod trained;

pub use dave2::Dave2;
pub use dave2_augmented::Dave2Augmented;
pub use dave2_temporal::Dave2Temporal;
pub use dave2_tub::Dave2Tub;
pub use onnx::Onnx;
pub use trained::{content, own_description};
