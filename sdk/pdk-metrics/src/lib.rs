//! How good the outputs of a network are: plain functions of numbers, each after the paper or the program that its module names.
//!
//! | module | metric |
//! |---|---|
//! | [`classification`] | top-k, the mean corruption error (mCE) and the relative one, [`alexnet`] with the errors of the published baseline |
//! | [`detection`] | the average precision of COCO |
//! | [`trajectory`] | average and final displacement error (ADE, FDE) |

pub mod alexnet;
pub mod classification;
pub mod detection;
pub mod trajectory;

// The example in the README compiles.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
