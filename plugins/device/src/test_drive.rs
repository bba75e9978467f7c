//! Drives for tests, at 20 frames a second.

use pdk_sdk::config::frame_values;
use pdk_sdk::perturbation::pass;
use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::{Map, Value};
use pdk_sdk::signals::{Numbers, Passed};

/// The time of a frame at which whole numbers of frames are exact enough.
fn time(index: usize) -> f64 {
    index as f64 / 20.0
}

fn passed<P: Component + Perturbation>(given: &Value, level: f64, signals: &[Numbers]) -> Vec<Numbers> {
    let description = P::description();
    let config = Config::check(&description, given.as_object().unwrap_or(&Map::new())).unwrap();
    let names: Vec<String> = description.parameters.iter().map(|p| p.name.clone()).collect();
    let (mut values, key) = (Vec::new(), Key([6; 32]));
    frame_values(&description, &config, level, &mut values);
    let mut instance = P::new(&config).unwrap();
    let mut kept = Passed::of(description.history as usize);
    let mut found = Vec::new();
    for (index, given) in signals.iter().enumerate() {
        let (frame_index, time) = (index as u64, time(index));
        let mut cx = Context::new(level, frame_index, time, &key).with_values(&names, &values);
        cx.period = Some(0.05);
        let cx = cx.with_signals(kept.before(frame_index));
        let passed = pass(&mut instance, description.acts_on, *given, &cx).unwrap();
        kept.keep(Signal { frame_index, time, given: *given, passed });
        found.push(passed);
    }
    found
}

/// What becomes of controls, one after the other.
pub fn applied<P: Component + Perturbation>(given: &Value, level: f64, controls: &[Control]) -> Vec<Control> {
    let signals: Vec<Numbers> = controls.iter().map(Control::numbers).collect();
    passed::<P>(given, level, &signals).into_iter().map(Control::from_numbers).collect()
}

/// The times and the speeds that a driver gets if these are the true speeds.
pub fn told<P: Component + Perturbation>(given: &Value, level: f64, speeds: &[f64]) -> Vec<Numbers> {
    let signals: Vec<Numbers> =
        speeds.iter().enumerate().map(|(index, speed)| [time(index), *speed]).collect();
    passed::<P>(given, level, &signals)
}

/// The speeds that a driver gets if these are the true ones. The time stays.
pub fn speeds<P: Component + Perturbation>(given: &Value, level: f64, speeds: &[f64]) -> Vec<f64> {
    let told = told::<P>(given, level, speeds);
    assert!(told.iter().enumerate().all(|(index, [told, _])| *told == time(index)));
    told.into_iter().map(|[_, speed]| speed).collect()
}
