//! Where all random numbers of pdk come from.
//!
//! The seed of a run gives each scenario its seed ([`of_scenario`]), a scenario's seed gives each component in it a [`Key`] ([`key`]), and
//! a key gives any number of streams of [`Random`] numbers (ChaCha8). Nothing is drawn from a clock, a counter or an order, so the same
//! seed gives the same numbers on every machine, whatever else is drawn beside them.

#![deny(unsafe_code)]

mod key;
mod stream;
mod wide;

pub use key::{Key, key, of_frame, of_scenario};
pub use stream::{Random, normal_quantile};

// The example in the README compiles.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
