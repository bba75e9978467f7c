//! Perturbed frames for tests.

use pdk_sdk::config::frame_values;
use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::Value;

/// A frame under a perturbation at level 2, at a number and after the vehicle has driven that far.
pub fn perturbed_at<P: Component + Perturbation>(
    given: &Value,
    source: &FrameBuf,
    depth: Option<&[f32]>,
    (index, travelled): (u64, f64),
) -> FrameBuf {
    let description = P::description();
    let config = Config::check(&description, given.as_object().unwrap()).unwrap();
    let names: Vec<String> = description.parameters.iter().map(|p| p.name.clone()).collect();
    let (mut values, key) = (Vec::new(), Key([2; 32]));
    frame_values(&description, &config, 2.0, &mut values);
    let mut cx = Context::new(2.0, index, 0.05 * index as f64, &key).with_values(&names, &values);
    (cx.depth, cx.travelled) = (depth, Some(travelled));
    let mut out = FrameBuf::new(source.width(), source.height());
    P::new(&config).unwrap().apply(source.as_ref(), out.as_mut(), &cx).unwrap();
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

/// A frame of one grey.
pub fn even(grey: u8, width: usize, height: usize) -> FrameBuf {
    let mut frame = FrameBuf::new(width, height);
    frame.as_mut().rows_mut().for_each(|row| row.fill(grey));
    frame
}
