//! Maps that a CARLA server has: how the adapter finds its way among them, and what it does while one loads.

use std::path::Path;
use std::time::Duration;

use pdk_tests::carla::{CarlaServer, Setup};
use pdk_tests::process::pipeline;
use pdk_tests::{Pdk, temp};
use serde_json::{Value, json};

use crate::carla::{assert_left_as_it_was, outcomes, simulator};

#[test]
fn a_lane_of_a_map_is_followed_and_maps_are_known_by_name() {
    let folder = temp();
    let server = CarlaServer::start(Setup::default());
    let source = pipeline(
        folder.path(),
        r#"
        local settings = pdk.settings({ simulator = "carla" })
        pdk.drive({ simulator = settings.simulator, driver = "lane_keeper", duration = 0.5, scenarios = {
            { name = "loaded", road = { start = 0, length = 50 } },
            { name = "by name", road = { map = "Town02", start = 1 } },
            { name = "no such map", road = { map = "Town99" } },
            { name = "no such place", road = { map = "Town01", start = 7 } },
        } })
        "#,
    );
    let run = Pdk::new(["run", "--out"])
        .arg(folder.path().join("record"))
        .arg(source)
        .set("simulator", simulator(server.port(), json!({"initial_speed": 0})))
        .set("workers", 1)
        .run();
    assert_eq!(run.code, Some(1), "{}", run.stderr);
    let outcomes = outcomes(folder.path());
    for outcome in &outcomes[..2] {
        assert_eq!(outcome["cause"], "time_out", "{outcome}");
        // It stands in the middle of the lane.
        assert!(outcome["max_cross_track_error"].as_f64().unwrap() < 0.01, "{outcome}");
    }
    let said = |outcome: &Value| outcome["error"].as_str().unwrap().to_owned();
    assert!(
        said(&outcomes[2]).contains("has no map `Town99`; it has Town01, Town02"),
        "{}",
        said(&outcomes[2])
    );
    assert!(said(&outcomes[3]).contains("so there is no number 7"), "{}", said(&outcomes[3]));
    assert_left_as_it_was(&server);
}

/// Drives these scenarios, which end soon.
fn drive(folder: &Path, server: &CarlaServer, scenarios: &str, more: Value) -> Vec<Value> {
    let source = format!(
        r#"
        local settings = pdk.settings({{ simulator = "carla" }})
        pdk.drive({{ simulator = settings.simulator, driver = "lane_keeper", duration = 0.2, scenarios = {{ {scenarios} }} }})
        "#
    );
    let mut set = json!({"initial_speed": 0});
    set.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
    Pdk::new(["run", "--out"])
        .arg(folder.join("record"))
        .arg(pipeline(folder, &source))
        .set("simulator", simulator(server.port(), set))
        .set("workers", 1)
        .run();
    outcomes(folder)
}

#[test]
fn a_road_without_a_map_is_on_the_one_that_was_found_whatever_was_loaded_since() {
    let server = CarlaServer::start(Setup::default());
    for other in [r#"{ road = { map = "Town02", start = 1 } }"#, "{ road = { angles = { 0, 5, 0 } } }"] {
        let folder = temp();
        let found =
            drive(folder.path(), &server, &format!("{other}, {{ road = {{ start = 0 }} }}"), json!({}));
        assert!(found.iter().all(|outcome| outcome["cause"] == "time_out"), "{found:?}");
        assert_eq!(server.town().as_deref(), Some("Town01"), "{other}");
    }
    // A map that was generated from a road cannot be loaded again.
    drive(temp().path(), &server, "{ road = { angles = { 0, 5, 0 } } }", json!({}));
    let folder = temp();
    let found = drive(
        folder.path(),
        &server,
        "{ road = { angles = { 0, -5, 0 } } }, { road = { start = 0 } }",
        json!({}),
    );
    assert_eq!((&found[0]["cause"], &found[1]["cause"]), (&json!("time_out"), &json!("error")), "{found:?}");
    let error = found[1]["error"].as_str().unwrap();
    assert!(error.contains("give the road a `map`, one of Town01, Town02"), "{error}");
}

#[test]
fn a_map_that_is_loaded_has_the_weather_that_was_found() {
    for (weather, cloudiness) in
        [(Value::Null, 15.0), (json!({"fog_density": 40}), 15.0), (json!({"cloudiness": 70}), 70.0)]
    {
        let folder = temp();
        let server = CarlaServer::start(Setup::default());
        let found =
            drive(folder.path(), &server, r#"{ road = { map = "Town02" } }"#, json!({"weather": weather}));
        assert_eq!(found[0]["cause"], "time_out", "{found:?}");
        assert_eq!((server.seen_cloudiness(), server.cloudiness()), (cloudiness, 15.0), "{weather}");
    }
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn a_map_that_loads_for_longer_than_an_answer_may_take_is_waited_for() {
    let folder = temp();
    let server = CarlaServer::start(Setup { loads: Duration::from_secs(12), ..Setup::default() });
    let found =
        drive(folder.path(), &server, r#"{ road = { map = "Town02" } }"#, json!({"answer_seconds": 5}));
    assert_eq!((found.len(), &found[0]["cause"]), (1, &json!("time_out")), "{found:?}");
    assert_eq!(server.calls().iter().filter(|call| *call == "load_new_episode").count(), 1);
}
