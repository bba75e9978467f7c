//! Images: perturbed, explained and evaluated outside of the closed loop.

#![allow(clippy::unwrap_used)]

mod masks;
mod offline;
mod saliency;
mod sequences;
mod strength;
mod tasks;
mod video;
