//! What the tests of the corruptions share.

use pdk_sdk::config::frame_values;
use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::Map;

/// A frame of one grey.
pub fn frame(shade: u8, width: usize, height: usize) -> FrameBuf {
    FrameBuf::from_vec(vec![shade; width * height * 3], width, height).unwrap()
}

/// A frame by a new instance, with a key that is made of a number.
pub fn perturbed<P: Component + Perturbation>(src: &FrameBuf, level: f64, key: u8) -> FrameBuf {
    let description = P::description();
    let config = Config::check(&description, &Map::new()).unwrap();
    let names: Vec<String> = description.parameters.iter().map(|p| p.name.clone()).collect();
    let mut values = Vec::new();
    frame_values(&description, &config, level, &mut values);
    let key = Key([key; 32]);
    let context = Context::new(level, 0, 0.0, &key).with_values(&names, &values);
    let mut dst = FrameBuf::new(src.width(), src.height());
    P::new(&config).unwrap().apply(src.as_ref(), dst.as_mut(), &context).unwrap();
    dst
}
