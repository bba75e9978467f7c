//! Texts that users write: perturbations, levels, regions, settings, roads; and scenarios as values.

#![no_main]

use libfuzzer_sys::fuzz_target;
use pdk_fuzz as _;
use pdk_model::level::Level;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_model::region::Region;
use pdk_model::scenario::Scenario;
use pdk_model::text::parse_value;
use pdk_pipeline::settings::{Override, apply, split};
use pdk_road::Road;
use serde_json::{Value, json};

fuzz_target!(|data: &[u8]| {
    let Ok(text) = std::str::from_utf8(data) else { return };
    if let Ok(applied) = AppliedPerturbation::parse(text) {
        assert!(!applied.label().is_empty());
        let scenario = json!({ "simulator": { "name": "lane" }, "driver": { "name": "dave2" }, "duration": 1.0,
            "seed": 0, "perturbations": [applied] });
        same_after_writing(&scenario.to_string());
    }
    same_after_writing(text);
    let Ok(value) = parse_value(text) else { return };
    if let Ok(level) = Level::from_json("a level", &value)
        && level.check("x").is_ok()
    {
        for time in [0.0, 0.25, 1e9] {
            assert!(level.at(time).is_none_or(|level| (0.0..=4.0).contains(&level)));
        }
    }
    let _ = AppliedPerturbation::from_json(&value);
    let _ = Region::from_json(&value);
    let overrides: Vec<Override> = text.lines().filter_map(|line| line.parse().ok()).collect();
    let _ = apply(json!({ "a": 1, "b": { "c": "x" }, "list": [1, 2] }), &overrides);
    let _ = split(overrides);
    let numbers = |value: &Value| -> Vec<f64> {
        value.as_array().into_iter().flatten().filter_map(Value::as_f64).collect()
    };
    if let Ok(road) = Road::from_angles(&numbers(&value["angles"]), &numbers(&value["lengths"])) {
        assert!(road.length().is_finite() && road.mean_curvature().is_finite());
    }
});

/// A scenario that can be read is written as one that is the same, with the same id.
fn same_after_writing(text: &str) {
    let Ok(scenario) = serde_json::from_str::<Scenario>(text) else { return };
    let written = serde_json::to_string(&scenario).expect("a scenario can be written");
    let again: Scenario = serde_json::from_str(&written).expect("what was written can be read");
    assert_eq!(again.id(), scenario.id(), "{written}");
}
