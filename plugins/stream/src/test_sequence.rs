//! Sequences for tests: even frames, each with a grey of its own.

use pdk_sdk::history::Recollection;
use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::Value;
use pdk_sdk::testing::{Trial, even_frame};

/// The grey of a frame, never black.
pub fn mark(index: usize) -> u8 {
    (1 + index % 251) as u8
}

fn frame(index: usize) -> FrameBuf {
    even_frame(mark(index), 70, 40)
}

/// Perturbs the frames from `first` to before `end`, one after the other, at 20 frames a second.
fn perturbed<P: Component + Perturbation>(
    given: &Value,
    level: f64,
    first: usize,
    end: usize,
) -> Vec<FrameBuf> {
    let mut trial = Trial::<P>::new(given, level, Key([6; 32])).unwrap();
    let mut kept = Recollection::of(trial.history);
    (first..end)
        .map(|index| {
            let (source, time) = (frame(index), index as f64 / 20.0);
            let (instance, cx) = trial.at(index as u64, time);
            let mut out = FrameBuf::new(source.width(), source.height());
            let cx = cx.with_history(kept.before(source.as_ref(), index as u64));
            instance.apply(source.as_ref(), out.as_mut(), &cx).unwrap();
            kept.keep(source.as_ref(), index as u64, time);
            out
        })
        .collect()
}

/// The frames of a sequence, perturbed.
pub fn pixels<P: Component + Perturbation>(given: &Value, level: f64, frames: usize) -> Vec<FrameBuf> {
    perturbed::<P>(given, level, 0, frames)
}

/// Which frame each frame of a sequence shows.
pub fn shown<P: Component + Perturbation>(given: &Value, level: f64, frames: usize) -> Vec<usize> {
    let latest = |index: usize, frame: FrameBuf| {
        let value = frame.data()[0];
        assert!(frame.data().iter().all(|other| *other == value), "frame {index} is not even");
        (0..=index).rev().find(|earlier| mark(*earlier) == value).unwrap()
    };
    pixels::<P>(given, level, frames)
        .into_iter()
        .enumerate()
        .map(|(index, frame)| latest(index, frame))
        .collect()
}

/// Checks that a frame comes out the same after as many frames as the perturbation asks for as after all of them.
pub fn any_frame_can_be_computed_alone<P: Component + Perturbation>() {
    let history = P::description().history as usize;
    for level in [0.0, 1.5, 4.0] {
        let whole = pixels::<P>(&Value::Null, level, 200);
        for index in [history, history + 1, 150, 199] {
            let alone = perturbed::<P>(&Value::Null, level, index - history, index + 1);
            assert_eq!(alone.last(), Some(&whole[index]), "frame {index} at level {level}");
        }
    }
}

/// Checks that a sequence stays as it is under these parameters.
pub fn leaves_a_sequence_alone<P: Component + Perturbation>(given: &Value) {
    let frames = pixels::<P>(given, 0.0, 5);
    assert!(
        frames
            .iter()
            .enumerate()
            .all(|(index, frame)| frame.data().iter().all(|value| *value == mark(index)))
    );
}
