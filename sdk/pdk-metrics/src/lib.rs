//! How good the outputs of a network are, and how it drives: plain functions of numbers, each after the paper or the program that its module names.
//!
//! | module | metric |
//! |---|---|
//! | [`classification`] | top-k, the mean corruption error (mCE) and the relative one, [`alexnet`] with the errors of the published baseline |
//! | [`comfort`] | lateral acceleration and jerk of a drive |
//! | [`depth`] | absolute relative error, root mean square, share within a factor of 1.25 |
//! | [`detection`] | the average precision of COCO |
//! | [`segmentation`] | mean intersection over union (mIoU) |
//! | [`trajectory`] | average and final displacement error (ADE, FDE) |

pub mod alexnet;
pub mod classification;
pub mod comfort;
pub mod depth;
pub mod detection;
pub mod segmentation;
pub mod trajectory;

// The example in the README compiles.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
