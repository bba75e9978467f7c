//! What search strategies and reports of searches share: which points are better ([`ranking`]), how much a front is worth
//! ([`hypervolume`]), and in which regions of the space points are critical ([`tree`]).

#![forbid(unsafe_code)]

pub mod hypervolume;
pub mod point;
pub mod ranking;
pub mod tree;

// The example in the README compiles.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
