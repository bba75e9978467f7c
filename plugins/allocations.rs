//! Counts allocations in tests, shared by plugin crates (`#[path]`).

// Every crate uses a part of this file.
#![allow(dead_code)]

use pdk_sdk::history::Recollection;
use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::Value;
use pdk_sdk::testing::Trial;

#[path = "../sdk/pdk-ops/tests/counting/mod.rs"]
mod counting;
pub use counting::count;

/// Checks that a perturbation asks for memory at the first frames of a sequence alone.
pub fn on_the_first_frames_alone<P: Component + Perturbation>() {
    let key = Key([6; 32]);
    let mut trial = Trial::<P>::new(&Value::Null, 3.0, key).unwrap();
    let mut kept = Recollection::of(trial.history);
    let (mut source, mut target) = (FrameBuf::new(96, 64), FrameBuf::new(96, 64));
    for index in 0..8 {
        key.frame(index).fill(source.as_mut().data_mut());
        let time = 0.05 * index as f64;
        let (instance, cx) = trial.at(index, time);
        let cx = cx.with_history(kept.before(source.as_ref(), index));
        let before = count();
        instance.apply(source.as_ref(), target.as_mut(), &cx).unwrap();
        assert!(index < 2 || count() == before, "{} at frame {index}", P::description().name);
        kept.keep(source.as_ref(), index, time);
    }
}
