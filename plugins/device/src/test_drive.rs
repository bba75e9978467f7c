//! Drives for tests, at 20 frames a second.

use pdk_sdk::perturbation::pass;
use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::Value;
use pdk_sdk::signals::{Numbers, Passed};
use pdk_sdk::testing::Trial;

/// The time of a frame at which whole numbers of frames are exact enough.
fn time(index: u64) -> f64 {
    index as f64 / 20.0
}

/// What becomes of signals at frames with these numbers.
fn passed<P: Component + Perturbation>(
    given: &Value,
    level: f64,
    signals: impl IntoIterator<Item = (u64, Numbers)>,
) -> Vec<Numbers> {
    let mut trial = Trial::<P>::new(given, level, Key([6; 32])).unwrap();
    let (acts_on, mut kept) = (P::description().acts_on, Passed::of(trial.history));
    let mut found = Vec::new();
    for (frame_index, given) in signals {
        let time = time(frame_index);
        let (instance, mut cx) = trial.at(frame_index, time);
        cx.period = Some(0.05);
        let cx = cx.with_signals(kept.before(frame_index));
        let passed = pass(instance, acts_on, given, &cx).unwrap();
        kept.keep(Signal { frame_index, time, given, passed });
        found.push(passed);
    }
    found
}

/// What becomes of controls, one after the other.
pub fn applied<P: Component + Perturbation>(given: &Value, level: f64, controls: &[Control]) -> Vec<Control> {
    let controls: Vec<(u64, Control)> = (0..).zip(controls.iter().copied()).collect();
    applied_at::<P>(given, level, &controls)
}

/// What becomes of controls at frames with these numbers; the driver missed those between.
pub fn applied_at<P: Component + Perturbation>(
    given: &Value,
    level: f64,
    controls: &[(u64, Control)],
) -> Vec<Control> {
    let signals = controls.iter().map(|(index, control)| (*index, control.numbers()));
    passed::<P>(given, level, signals).into_iter().map(Control::from_numbers).collect()
}

/// Asserts that over frames which the driver misses, an actuator goes on to the control before: as in a drive in which it misses none.
pub fn assert_missed_frames_change_nothing<P: Component + Perturbation>(given: &Value) {
    let control = |index: u64| Control { steering: if index < 40 { 0.75 } else { -0.25 }, throttle: 0.5 };
    let driven = |frames: &[u64]| {
        let controls: Vec<(u64, Control)> = frames.iter().map(|index| (*index, control(*index))).collect();
        applied_at::<P>(given, 0.0, &controls)
    };
    let all = driven(&(0..60).collect::<Vec<_>>());
    // The control before stays, so that nothing but the number of frames differs.
    let some = [0, 1, 5, 6, 20, 40, 41, 59];
    for (index, found) in some.iter().zip(driven(&some)) {
        let expected = all[*index as usize];
        assert!((found.steering - expected.steering).abs() < 1e-9, "{index}: {found:?}, {expected:?}");
        assert!((found.throttle - expected.throttle).abs() < 1e-9, "{index}: {found:?}, {expected:?}");
    }
}

/// The times and the speeds that a driver gets if these are the true speeds.
pub fn observed<P: Component + Perturbation>(given: &Value, level: f64, speeds: &[f64]) -> Vec<Numbers> {
    passed::<P>(given, level, (0..).zip(speeds).map(|(index, speed)| (index, [time(index), *speed])))
}

/// The speeds that a driver gets if these are the true ones. The time stays.
pub fn speeds<P: Component + Perturbation>(given: &Value, level: f64, speeds: &[f64]) -> Vec<f64> {
    let observed = observed::<P>(given, level, speeds);
    assert!((0..).zip(&observed).all(|(index, [observed, _])| *observed == time(index)));
    observed.into_iter().map(|[_, speed]| speed).collect()
}
