//! Images: perturbed, explained and evaluated outside of the closed loop.

#![allow(clippy::unwrap_used)]

mod attack;
mod corrupt;
mod damaged_streams;
mod geometry;
mod gradient;
mod levels;
mod masks;
mod networks;
mod offline;
mod perturb;
mod pixel_tasks;
mod rewritten;
mod saliency;
mod sequences;
mod strength;
mod tasks;
mod video;
