//! What the tests of the corruptions share.

use std::ops::RangeInclusive;

use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::Value;
use pdk_sdk::testing::Trial;
pub use pdk_sdk::testing::even_frame as frame;
use pdk_sdk::testing::sample_frame;

use crate::simd::with_each;

/// A frame by a new instance, with a key that is made of a number.
pub fn perturbed<P: Component + Perturbation>(src: &FrameBuf, level: f64, key: u8) -> FrameBuf {
    Trial::<P>::new(&Value::Null, level, Key([key; 32])).unwrap().frame(src, 0, 0.0).unwrap()
}

/// An instance that lives through frames of other sizes, levels and keys gives what new instances give, with each set of instructions.
pub fn keeps_nothing_that_does_not_fit<P: Component + Perturbation>() {
    let mut kept = None;
    for (level, key, [width, height]) in [
        (0.0, 1, [37, 23]),
        (4.0, 1, [37, 23]),
        (4.0, 2, [37, 23]),
        (0.0, 2, [23, 37]),
        (2.5, 2, [64, 5]),
        (1.0, 1, [1, 1]),
        (0.0, 1, [37, 23]),
    ] {
        let src = sample_frame(width, height);
        let mut trial = Trial::<P>::new(&Value::Null, level, Key([key; 32])).unwrap();
        let wanted = trial.frame(&src, 5, 0.25).unwrap();
        if let Some(instance) = kept.take() {
            trial.instance = instance;
        }
        with_each(|instructions| {
            let found = trial.frame(&src, 5, 0.25).unwrap();
            assert_eq!(found, wanted, "{width}x{height} at level {level} with {instructions:?}");
        });
        kept = Some(trial.instance);
    }
}

/// The mean of a frame's values, and their standard deviation.
pub fn moments(frame: &FrameBuf) -> (f64, f64) {
    let values: Vec<f64> = frame.data().iter().map(|&v| f64::from(v)).collect();
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let variance = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / values.len() as f64;
    (mean, variance.sqrt())
}

/// Blurs, blocks and displacements leave a grey frame as it is, but for fractions, which are dropped, and for a softened disc, which
/// weighs a little more than 1, as published.
pub fn stays_grey<P: Component + Perturbation>(levels: &[f64], shades: RangeInclusive<u8>) {
    let grey = frame(100, 60, 50);
    for level in levels {
        let perturbed = perturbed::<P>(&grey, *level, 1);
        assert!(perturbed.data().iter().all(|value| shades.contains(value)), "{level}");
    }
}

/// A corruption changes a pixel to another, but for what rounding does.
pub fn changes_pixel<P: Component + Perturbation>(pixel: [u8; 3], level: f64, wanted: [u8; 3]) {
    let frame = FrameBuf::from_vec(pixel.to_vec(), 1, 1).unwrap();
    let found = perturbed::<P>(&frame, level, 1);
    let near = found.data().iter().zip(wanted).all(|(found, wanted)| found.abs_diff(wanted) <= 1);
    assert!(near, "{:?} {wanted:?}", found.data());
}
