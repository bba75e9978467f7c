//! The table of what perturbations and simulators stand for in an operational design domain is complete.

use std::collections::BTreeSet;

use pdk_export::domain::Domain;
use pdk_product::PRODUCT;
use pdk_tests::Pdk;
use serde_json::Value;

fn domain() -> Domain {
    Domain::parse(PRODUCT.domain).unwrap()
}

fn listed(kind: &str) -> Vec<Value> {
    let all = Pdk::new(["list", kind, "--json"]).succeed().json();
    all.as_array().unwrap().iter().map(|entry| entry.get("description").unwrap_or(entry).clone()).collect()
}

#[test]
fn every_perturbation_stands_for_something() {
    let domain = domain();
    let there: BTreeSet<String> =
        listed("perturbation").iter().map(|entry| entry["name"].as_str().unwrap().to_owned()).collect();
    let in_table: BTreeSet<String> = domain.perturbations.keys().cloned().collect();
    let missing: Vec<_> = there.difference(&in_table).collect();
    let unknown: Vec<_> = in_table.difference(&there).collect();
    assert!(missing.is_empty(), "scripts/domain.toml lacks {missing:?}");
    assert!(unknown.is_empty(), "scripts/domain.toml has {unknown:?}, which are not perturbations");
    for (name, stands) in &domain.perturbations {
        assert!(!stands.triggers.is_empty(), "{name} triggers nothing");
    }
    // A trigger that nothing stands for says nothing.
    let used: BTreeSet<&String> = domain.perturbations.values().flat_map(|stands| &stands.triggers).collect();
    for trigger in &domain.triggers {
        assert!(used.contains(&trigger.id), "nothing stands for {}", trigger.id);
    }
}

#[test]
fn conditions_are_values_that_simulators_have() {
    let simulators = listed("simulator");
    for condition in &domain().conditions {
        let simulator = simulators.iter().find(|entry| entry["name"] == condition.simulator.as_str());
        let simulator = simulator.unwrap_or_else(|| panic!("there is no simulator {}", condition.simulator));
        let Some(name) = &condition.parameter else { continue };
        let parameters = simulator["parameters"].as_array().unwrap();
        let parameter = parameters.iter().find(|parameter| parameter["name"] == name.as_str());
        let parameter =
            parameter.unwrap_or_else(|| panic!("{} has no parameter {name}", condition.simulator));
        let is_default = match (&condition.value, condition.above) {
            (Some(value), None) => parameter["default"] == *value,
            (None, Some(above)) => parameter["default"].as_f64().unwrap() > above,
            both => panic!("{name} of {} has {both:?}", condition.simulator),
        };
        assert_eq!(condition.default, is_default, "{name} of {}: {:?}", condition.simulator, condition.value);
        if let (Some(value), Some(options)) = (&condition.value, parameter["options"].as_array()) {
            assert!(options.contains(value), "{name} is never {value}");
        }
    }
}
