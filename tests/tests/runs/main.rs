//! Runs: what is driven, by which pipeline, and on which workers.

#![allow(clippy::unwrap_used)]

mod attack_drives;
mod closed_loop;
mod decide;
mod devices;
mod examples;
mod gate;
mod gate_recordings;
mod pipelines;
mod pool;
mod search;
mod sensitivity;
mod session;
mod shrink;
mod why;
