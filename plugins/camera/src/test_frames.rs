//! Perturbed frames for tests.

use pdk_sdk::config::frame_values;
use pdk_sdk::history::Recollection;
use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::{Map, Value};

/// A frame under a perturbation, after the frames before it.
pub fn perturbed<P: Component + Perturbation>(
    given: &Value,
    level: f64,
    (index, time): (u64, f64),
    frames: &[FrameBuf],
) -> FrameBuf {
    let description = P::description();
    let config = Config::check(&description, given.as_object().unwrap_or(&Map::new())).unwrap();
    let names: Vec<String> = description.parameters.iter().map(|p| p.name.clone()).collect();
    let (mut values, key) = (Vec::new(), Key([6; 32]));
    frame_values(&description, &config, level, &mut values);
    let mut kept = Recollection::of(description.history as usize);
    let (source, earlier) = frames.split_last().unwrap();
    for (back, frame) in earlier.iter().rev().enumerate().rev() {
        kept.keep(frame.as_ref(), index - 1 - back as u64, time - 0.05 * (back + 1) as f64);
    }
    let mut cx = Context::new(level, index, time, &key).with_values(&names, &values);
    cx.period = Some(0.05);
    let cx = cx.with_history(kept.before(source.as_ref(), index));
    let mut out = FrameBuf::new(source.width(), source.height());
    P::new(&config).unwrap().apply(source.as_ref(), out.as_mut(), &cx).unwrap();
    out
}

/// A frame of one grey.
pub fn even(grey: u8, width: usize, height: usize) -> FrameBuf {
    let mut frame = FrameBuf::new(width, height);
    frame.as_mut().rows_mut().for_each(|row| row.fill(grey));
    frame
}
