//! Sequences for tests: even frames, each with a grey of its own.

use pdk_sdk::config::frame_values;
use pdk_sdk::history::Recollection;
use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::{Map, Value};

/// The grey of a frame, never black.
pub fn mark(index: usize) -> u8 {
    (1 + index % 251) as u8
}

fn frame(index: usize) -> FrameBuf {
    let mut frame = FrameBuf::new(70, 40);
    frame.as_mut().rows_mut().for_each(|row| row.fill(mark(index)));
    frame
}

/// Perturbs the frames from `first` to before `end`, one after the other, at 20 frames a second.
fn perturbed<P: Component + Perturbation>(
    given: &Value,
    level: f64,
    first: usize,
    end: usize,
) -> Vec<FrameBuf> {
    let description = P::description();
    let config = Config::check(&description, given.as_object().unwrap_or(&Map::new())).unwrap();
    let names: Vec<String> = description.parameters.iter().map(|p| p.name.clone()).collect();
    let (mut values, key) = (Vec::new(), Key([6; 32]));
    frame_values(&description, &config, level, &mut values);
    let mut instance = P::new(&config).unwrap();
    let mut kept = Recollection::of(description.history as usize);
    (first..end)
        .map(|index| {
            let (source, time) = (frame(index), index as f64 / 20.0);
            let cx = Context::new(level, index as u64, time, &key).with_values(&names, &values);
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
