//! Perturbed frames for tests.

use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::Value;
use pdk_sdk::testing::Trial;
pub use pdk_sdk::testing::even_frame as even;

/// A frame under a perturbation at level 2, at a number and after the vehicle has driven that far.
pub fn perturbed_at<P: Component + Perturbation>(
    given: &Value,
    source: &FrameBuf,
    depth: Option<&[f32]>,
    (index, travelled): (u64, f64),
) -> FrameBuf {
    let mut trial = Trial::<P>::new(given, 2.0, Key([2; 32])).unwrap();
    let (instance, mut cx) = trial.at(index, 0.05 * index as f64);
    (cx.depth, cx.travelled) = (depth, Some(travelled));
    let mut out = FrameBuf::new(source.width(), source.height());
    instance.apply(source.as_ref(), out.as_mut(), &cx).unwrap();
    out
}

/// As [`perturbed_at`], the first of a sequence.
pub fn perturbed<P: Component + Perturbation>(
    given: &Value,
    source: &FrameBuf,
    depth: Option<&[f32]>,
) -> FrameBuf {
    perturbed_at::<P>(given, source, depth, (0, 0.0))
}
