//! Masks.

mod segmentation;

pub use segmentation::Segmentation;
