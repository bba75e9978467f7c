//! Perturbed frames for tests.

use pdk_sdk::history::Recollection;
use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::Value;
use pdk_sdk::testing::Trial;
pub use pdk_sdk::testing::even_frame as even;

/// A frame under a perturbation, after the frames before it.
pub fn perturbed<P: Component + Perturbation>(
    given: &Value,
    level: f64,
    (index, time): (u64, f64),
    frames: &[FrameBuf],
) -> FrameBuf {
    let mut trial = Trial::<P>::new(given, level, Key([6; 32])).unwrap();
    let mut kept = Recollection::of(trial.history);
    let (source, earlier) = frames.split_last().unwrap();
    for (back, frame) in earlier.iter().rev().enumerate().rev() {
        kept.keep(frame.as_ref(), index - 1 - back as u64, time - 0.05 * (back + 1) as f64);
    }
    let (instance, mut cx) = trial.at(index, time);
    cx.period = Some(0.05);
    let cx = cx.with_history(kept.before(source.as_ref(), index));
    let mut out = FrameBuf::new(source.width(), source.height());
    instance.apply(source.as_ref(), out.as_mut(), &cx).unwrap();
    out
}
