//! The values that everything in pdk speaks of, each defined once; no input or output happens here.
//!
//! What is driven is a [`Scenario`](scenario::Scenario): everything that decides an outcome, and nothing else. What comes of
//! it is an [`Outcome`](outcome::Outcome). On the way there, a [`State`](state::State) and a [`Control`](control::Control)
//! belong to each frame, and what goes wrong is an [`Error`](error::Error) of a [kind](error::ErrorKind).

#![forbid(unsafe_code)]

pub mod attention;
pub mod camera;
pub mod canonical;
pub mod component;
pub mod control;
pub mod described;
pub mod during;
pub mod error;
pub mod failure;
pub mod json;
pub mod level;
pub mod level_scale;
pub mod outcome;
pub mod pace;
pub mod perturbation;
pub mod region;
pub mod scale_file;
pub mod scenario;
pub mod search;
pub mod selection;
pub mod shard;
pub mod state;
pub mod text;

// The example in the README compiles.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
