//! The drivers that come with pdk, and networks that become drivers by lying in a folder.

use std::fs;

use pdk_tests::process::{json_lines, pipeline};
use pdk_tests::{Pdk, repository, temp};

/// The trained drivers come to the end of a road of the study in every light, with and without a vehicle ahead.
#[test]
#[ignore = "long: .ci/run runs it"]
fn the_trained_drivers_keep_the_lane_and_their_distance() {
    let folder = temp();
    let source = r#"
        local road = pdk.road({ seed = 3, limit = 35, attempts = 1000 }).road
        for _, driver in { "dave2", "dave2_augmented" } do
            for _, light in { "day", "dusk", "overcast" } do
                pdk.drive({
                    simulator = { name = "lane", light = light, vehicle_ahead = 20 },
                    driver = driver,
                    duration = 40,
                    images_every = 0,
                    scenarios = { { road = road } },
                })
            end
        end
    "#;
    let record = folder.path().join("record");
    Pdk::new(["run", "--out"]).arg(&record).arg(pipeline(folder.path(), source)).succeed();
    let outcomes = json_lines(&record.join("scenarios.jsonl"));
    assert_eq!(outcomes.len(), 6);
    for outcome in outcomes {
        assert_eq!(outcome["cause"], "finished", "{outcome}");
        assert!(outcome["mean_cross_track_error"].as_f64().unwrap() < 0.2, "{outcome}");
    }
}

#[test]
fn a_network_in_a_folder_of_models_is_a_driver() {
    let folder = temp();
    let models = folder.path().join("plugins/models");
    fs::create_dir_all(&models).unwrap();
    fs::copy(repository().join("scripts/models/dave2.onnx"), models.join("my_network.onnx")).unwrap();
    fs::write(models.join("broken.onnx"), "no network").unwrap();
    // A name of pdk's own means the same everywhere.
    fs::write(models.join("dave2.onnx"), "no network").unwrap();
    let pdk = |arguments: &[&str]| {
        Pdk::new(["--plugins"]).arg(folder.path().join("plugins")).args(arguments).folder(folder.path())
    };
    let shown = pdk(&["show", "my_network"]).succeed();
    assert!(shown.stdout.contains("driver") && shown.stdout.contains("my_network.onnx"), "{}", shown.stdout);

    let source = |driver: &str| {
        format!(
            r#"pdk.drive({{ simulator = "lane", driver = "{driver}", duration = 0.5, images_every = 0, scenarios = {{ {{}} }} }})"#
        )
    };
    let script = pipeline(folder.path(), &source("dave2"));
    pdk(&["run", "--out", "own"]).arg(script).succeed();
    let script = pipeline(folder.path(), &source("my_network"));
    pdk(&["run", "--out", "theirs"]).arg(script).succeed();
    // A replay needs the record alone, and it is found from elsewhere, also by a user whose cache holds no note of any library.
    let elsewhere = temp();
    let replay = Pdk::new(["replay"]).arg(folder.path().join("theirs")).folder(elsewhere.path());
    let replay = replay.env("PDK_CACHE", "/dev/null").succeed();
    assert!(replay.stdout.contains("1 of 1 equal"), "{}", replay.stdout);
    let outcome = |record: &str| json_lines(&folder.path().join(record).join("scenarios.jsonl")).remove(0);
    assert_eq!(
        outcome("own")["mean_cross_track_error"],
        outcome("theirs")["mean_cross_track_error"],
        "the same network drives the same way under any name"
    );
    let script = pipeline(folder.path(), &source("broken"));
    pdk(&["run", "--out", "broken"]).arg(script).fail(1, &["broken.onnx"]);
}
