//! What an id depends on, and what not.

use std::collections::BTreeSet;

use proptest::prelude::*;
use serde_json::{Map, Number, json};

use super::*;
use crate::failure::Comparison;
use crate::level::Level;

/// The seed of a scenario that names none.
fn seed_of(run_seed: u64, road: &Value, repeat: u64) -> u64 {
    pdk_seed::of_scenario(run_seed, &canonical(road), repeat)
}

fn lane() -> Scenario {
    Scenario::new(ComponentSpec::new("lane"), ComponentSpec::new("lane_keeper"))
}

#[test]
fn the_canonical_text_leaves_out_what_is_not_set() {
    assert_eq!(
        lane().canonical(),
        r#"{"driver":{"name":"lane_keeper"},"duration":30,"seed":0,"simulator":{"name":"lane"}}"#
    );
    let full = Scenario {
        road: json!({"segment": 25.0, "angles": [0, -0.0, 10.5], "heights": null}),
        perturbations: vec![AppliedPerturbation::parse("fog@2,size=3").unwrap()],
        duration: 4.5,
        failure: FailureCriteria { lane_departure: Some(4.0), ..FailureCriteria::default() },
        mode: Mode::Realtime,
        seed: u64::MAX,
        repeat: 2,
        ..lane()
    };
    assert_eq!(
        full.canonical(),
        r#"{"driver":{"name":"lane_keeper"},"duration":4.5,"failure":{"lane_departure":4},"mode":"realtime","perturbations":[{"level":2,"name":"fog","parameters":{"size":3}}],"repeat":2,"road":{"angles":[0,0,10.5],"segment":25},"seed":18446744073709551615,"simulator":{"name":"lane"}}"#
    );
}

/// A record is of use as long as its ids mean the same, so what they are is fixed.
#[test]
fn ids_are_those_of_every_earlier_build() {
    assert_eq!(lane().id().to_string(), "3cfb08e59edf296d85b89ad55929ae1a");
    assert_eq!(seed_of(1, &Value::Null, 0), 6_763_833_450_996_825);
}

#[test]
fn an_id_changes_with_every_field() {
    let road = |road: Value| Scenario { road, ..lane() };
    let component = |spec: Value| ComponentSpec::from_json("x", &spec).unwrap();
    let perturbed = |texts: &[&str]| Scenario {
        perturbations: texts.iter().map(|text| AppliedPerturbation::parse(text).unwrap()).collect(),
        ..lane()
    };
    let fails = |set: fn(&mut FailureCriteria)| {
        let mut scenario = lane();
        set(&mut scenario.failure);
        scenario
    };
    let scenarios = [
        lane(),
        Scenario { simulator: ComponentSpec::new("other"), ..lane() },
        Scenario { simulator: component(json!({"name": "lane", "light": "dusk"})), ..lane() },
        Scenario { driver: ComponentSpec::new("other"), ..lane() },
        Scenario { driver: component(json!({"name": "lane_keeper", "gain": 2})), ..lane() },
        Scenario { driver: component(json!({"name": "lane_keeper", "gain": 2.5})), ..lane() },
        Scenario { duration: 31.0, ..lane() },
        fails(|criteria| criteria.lane_departure = Some(2.0)),
        fails(|criteria| criteria.lane_departure = Some(4.0)),
        fails(|criteria| criteria.comparison = Comparison::MoreThan),
        fails(|criteria| criteria.standstill_speed = 0.2),
        fails(|criteria| criteria.standstill_seconds = 4.0),
        fails(|criteria| criteria.over_line = 1.0),
        Scenario { mode: Mode::Realtime, ..lane() },
        Scenario { seed: 1, ..lane() },
        // Two seeds that are the same number of floating point.
        Scenario { seed: u64::MAX, ..lane() },
        Scenario { seed: u64::MAX - 1, ..lane() },
        Scenario { repeat: 1, ..lane() },
        road(json!({"angles": [0, 1]})),
        road(json!({"angles": [1, 0]})),
        road(json!({"angles": ["0", 1]})),
        road(json!({"angles": []})),
        road(json!({})),
        road(json!([])),
        road(json!([null])),
        road(json!("")),
        perturbed(&["fog@2"]),
        perturbed(&["fog@3"]),
        perturbed(&["fog@2", "fog@2"]),
        perturbed(&["fog@2", "rain@2"]),
        perturbed(&["rain@2", "fog@2"]),
        perturbed(&["fog@2,size=2"]),
        perturbed(&["fog@2,size=[]"]),
        perturbed(&["fog@2,probability=0.5"]),
        perturbed(&["fog@2,draws=per_frame"]),
        perturbed(&["fog@2,draws=per_sequence"]),
        perturbed(&[r#"fog@2,region={"box":[0,0,1,0.5]}"#]),
        perturbed(&[r#"fog,level={"ramp":{"from":2,"to":2,"end":1}}"#]),
        perturbed(&[r#"fog,level={"pulse":{"level":2,"period":2,"duration":1}}"#]),
        perturbed(&[r#"fog,level={"pulse":{"level":2,"rest":0,"period":2,"duration":1}}"#]),
        perturbed(&[r#"fog,level={"points":[[0,2]]}"#]),
        perturbed(&[r#"fog,level={"frames":{"rate":20,"levels":[2]}}"#]),
        perturbed(&[r#"fog,level={"frames":{"rate":20,"levels":[[2,2]]}}"#]),
    ];
    let ids: BTreeSet<_> = scenarios.iter().map(Scenario::id).collect();
    assert_eq!(ids.len(), scenarios.len());
}

#[test]
fn an_id_is_read_from_its_text_alone() {
    let id = lane().id();
    assert_eq!(id.to_string().parse(), Ok(id));
    assert_eq!(serde_json::to_value(id).unwrap(), json!(id.to_string()));
    assert_eq!(serde_json::from_value::<ScenarioId>(json!(id.to_string())).unwrap(), id);
    let text = "00112233445566778899aabbccddeeff";
    assert_eq!(text.parse::<ScenarioId>().unwrap().to_string(), text);
    for wrong in
        ["", "12", "00112233445566778899AABBCCDDEEFF", "+0112233445566778899aabbccddeeff", &text[1..]]
    {
        assert!(wrong.parse::<ScenarioId>().is_err(), "{wrong}");
    }
}

#[test]
fn a_seed_depends_on_the_run_the_road_and_the_repeat() {
    let road = json!({"angles": [0, 10], "segment": 25});
    let seed = seed_of(7, &road, 0);
    assert_eq!(seed, seed_of(7, &json!({"segment": 25.0, "angles": [-0.0, 1e1]}), 0));
    let others = [seed_of(8, &road, 0), seed_of(7, &Value::Null, 0), seed_of(7, &road, 1)];
    assert!(others.iter().all(|other| *other != seed));
    // All the bits that a number of floating point keeps are in use, and no more.
    let all = (0..1000).map(|run| seed_of(run, &road, 0)).fold(0, |all, seed| all | seed);
    assert_eq!(all, (1 << 53) - 1);
}

#[test]
fn scenarios_are_named_after_their_perturbations() {
    assert_eq!(lane().default_name(), "nominal");
    let mut fog = AppliedPerturbation::new("fog", 1.0);
    let rain = AppliedPerturbation::new("rain", 2.0);
    let perturbations = vec![fog.clone(), rain.clone()];
    assert_eq!(Scenario { perturbations, ..lane() }.default_name(), "fog@1 + rain@2");
    fog.level = Level::Points { points: vec![[0.0, 1.0], [1.0, 2.0]] };
    let scenario = Scenario { perturbations: vec![rain, fog], ..lane() };
    assert_eq!(scenario.default_name(), "rain@2 + fog over time");
    assert_eq!(scenario.perturbation_names(), ["rain@2", "fog over time"]);
}

#[test]
fn modes_are_read_by_name() {
    for mode in Mode::ALL {
        assert_eq!(mode.name().parse(), Ok(mode));
        assert_eq!(serde_json::to_value(mode).unwrap(), json!(mode.name()));
    }
    let error = "fast".parse::<Mode>().unwrap_err();
    assert_eq!(error.message(), "`mode` is `fast`, but has to be lockstep or realtime");
}

/// Any JSON.
fn anything() -> impl Strategy<Value = Value> {
    let leaf = prop_oneof![
        Just(Value::Null),
        any::<bool>().prop_map(Value::from),
        any::<i64>().prop_map(Value::from),
        (-50i32..50).prop_map(|number| Value::from(f64::from(number) / 4.0)),
        prop::num::f64::NORMAL.prop_map(Value::from),
        ".{0,6}".prop_map(Value::from),
    ];
    leaf.prop_recursive(3, 24, 5, |inner| {
        prop_oneof![
            prop::collection::vec(inner.clone(), 0..5).prop_map(Value::from),
            prop::collection::btree_map("[a-c]{1,2}", inner, 0..5)
                .prop_map(|fields| Value::Object(fields.into_iter().collect())),
        ]
    })
}

fn level() -> impl Strategy<Value = Level> {
    prop_oneof![
        (0.0..=4.0).prop_map(Level::Constant),
        prop::collection::vec(0.0..=4.0, 1..6)
            .prop_map(|levels| Level::Frames { frames: crate::level::FrameLevels { rate: 20.0, levels } }),
    ]
}

prop_compose! {
    fn perturbation()(
        name in "[a-z]{1,6}",
        level in level(),
        probability in prop::option::of(0.0..=1.0),
        parameters in fields(),
    ) -> AppliedPerturbation {
        AppliedPerturbation { level, probability, parameters, ..AppliedPerturbation::new(&name, 0.0) }
    }
}

/// Parameters as a script can set them: none of them null.
fn fields() -> impl Strategy<Value = Map<String, Value>> {
    let value = anything().prop_filter("a parameter has a value", |value| !value.is_null());
    prop::collection::btree_map("[a-z]{1,4}", value, 0..4).prop_map(|fields| fields.into_iter().collect())
}

prop_compose! {
    fn scenario()(
        names in ["[a-z]{1,6}", "[a-z]{1,6}"],
        parameters in [fields(), fields()],
        road in anything(),
        perturbations in prop::collection::vec(perturbation(), 0..3),
        duration in 0.1..86_400.0,
        realtime in any::<bool>(),
        seed in any::<u64>(),
        repeat in 0u64..3,
    ) -> Scenario {
        let ([simulator, driver], [first, second]) = (names, parameters);
        Scenario {
            failure: FailureCriteria::default(),
            simulator: ComponentSpec { name: simulator, parameters: first },
            driver: ComponentSpec { name: driver, parameters: second },
            road,
            perturbations,
            duration,
            mode: if realtime { Mode::Realtime } else { Mode::Lockstep },
            seed,
            repeat,
            files: BTreeMap::new(),
        }
    }
}

/// The same value with keys in the opposite order and other spellings of its numbers.
fn respelled(value: &Value) -> Value {
    match value {
        Value::Number(number) => match (number.as_i64(), number.as_f64()) {
            // Beyond 2^53 another type would be another number.
            (Some(whole), _) if whole.unsigned_abs() <= 1 << 53 => Value::from(whole as f64),
            (_, Some(float)) if number.is_f64() && float.fract() == 0.0 && float.abs() < 1e15 => {
                Value::Number(Number::from(float as i64))
            }
            _ => value.clone(),
        },
        Value::Array(items) => items.iter().map(respelled).collect(),
        Value::Object(fields) => Value::Object(reordered(fields)),
        other => other.clone(),
    }
}

fn reordered(fields: &Map<String, Value>) -> Map<String, Value> {
    fields.iter().rev().map(|(key, value)| (key.clone(), respelled(value))).collect()
}

proptest! {
    #[test]
    fn an_id_survives_being_written_and_read(scenario in scenario()) {
        let text = serde_json::to_string(&scenario).unwrap();
        let read: Scenario = serde_json::from_str(&text).unwrap();
        prop_assert_eq!(read.id(), scenario.id());
        // The canonical text itself is such a text.
        let read: Scenario = serde_json::from_str(&scenario.canonical()).unwrap();
        prop_assert_eq!(read.canonical(), scenario.canonical());
    }

    #[test]
    fn neither_the_order_of_keys_nor_the_spelling_of_numbers_counts(scenario in scenario()) {
        let mut other = scenario.clone();
        other.road = respelled(&other.road);
        for component in [&mut other.simulator, &mut other.driver] {
            component.parameters = reordered(&component.parameters);
        }
        for perturbation in &mut other.perturbations {
            perturbation.parameters = reordered(&perturbation.parameters);
        }
        prop_assert_eq!(other.id(), scenario.id());
        prop_assert_eq!(seed_of(3, &other.road, 1), seed_of(3, &scenario.road, 1));
    }

    #[test]
    fn another_road_is_another_scenario(scenario in scenario(), number in -1e6f64..1e6, other in -1e6f64..1e6) {
        let with = |number| Scenario { road: json!({"angles": [number]}), ..scenario.clone() };
        prop_assert_eq!(with(number).id() == with(other).id(), number == other);
    }
}
