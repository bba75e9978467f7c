//! The adapter `beamng` against a game that has the embedded simulator inside.
//! `cargo test -p pdk-tests --test beamng -- --nocapture` prints what is said about each way to go wrong.

#![allow(clippy::unwrap_used)]

use std::net::TcpListener;
use std::path::Path;
use std::time::Instant;

use pdk_tests::beamng::{BeamNgGame, Fault, Setup};
use pdk_tests::process::{json_lines, pipeline};
use pdk_tests::{Pdk, temp};
use serde_json::{Value, json};

const PIPELINE: &str = r#"
    local settings = pdk.settings({ simulator = "beamng", duration = 3 })
    pdk.drive({ simulator = settings.simulator, driver = "lane_keeper", duration = settings.duration, scenarios = {
        { name = "nominal", road = { angles = { 0, 10, -10, 0 } } },
        { name = "moved", road = { angles = { 0, 10, -10, 0 } }, perturbations = { "translate_image@4" } },
    } })
"#;

fn simulator(name: &str, more: Value) -> String {
    let mut simulator = json!({
        "name": name, "width": 80, "height": 60, "rate": 20, "field_of_view": 75, "camera_height": 1.35, "camera_pitch": 8,
    });
    simulator.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
    simulator.to_string()
}

fn beamng(port: u16) -> String {
    simulator("beamng", json!({"port": port, "start_seconds": 5, "answer_seconds": 3}))
}

fn run(folder: &Path, record: &str, simulator: &str) -> Pdk {
    let source = pipeline(folder, PIPELINE);
    Pdk::new(["run", "--out"])
        .arg(folder.join(record))
        .arg(source)
        .set("simulator", simulator)
        .set("workers", 1)
}

fn outcomes(folder: &Path, record: &str) -> Vec<Value> {
    json_lines(&folder.join(record).join("scenarios.jsonl"))
}

#[test]
fn a_scenario_over_the_wire_comes_out_as_one_without_it() {
    let folder = temp();
    let game = BeamNgGame::start(Setup::default());
    run(folder.path(), "beamng", &beamng(game.port())).set("duration", 30).succeed();
    let lane = simulator("lane", json!({"initial_speed": 0, "oncoming": 0}));
    run(folder.path(), "lane", &lane).set("duration", 30).succeed();
    let (found, expected) = (outcomes(folder.path(), "beamng"), outcomes(folder.path(), "lane"));
    for (found, expected) in found.iter().zip(&expected) {
        for field in ["name", "success", "cause"] {
            assert_eq!(found[field], expected[field], "{expected}\n{found}");
        }
        let number = |outcome: &Value, field: &str| outcome[field].as_f64().unwrap();
        assert!((number(found, "frames") - number(expected, "frames")).abs() <= 6.0, "{expected}\n{found}");
        assert!(number(found, "max_cross_track_error") - number(expected, "max_cross_track_error") < 0.2);
    }
    assert!(game.is_untouched(), "{:?}", game.calls());
}

#[test]
fn what_goes_wrong_is_said() {
    let free = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let mut tried = vec![("not there".to_owned(), None, free, "lost", "BeamNG.tech is not at 127.0.0.1:")];
    let version = BeamNgGame::start(Setup { protocol: "v1.23", ..Setup::default() });
    let port = version.port();
    tried.push((
        "version".to_owned(),
        Some(version),
        port,
        "configuration",
        "speaks version v1.23 of its protocol",
    ));
    for (fault, kind, part) in [
        (Fault::Close, "lost", "closed the connection"),
        (Fault::Half, "lost", "closed the connection in the middle"),
        // It still hangs when it is connected to again.
        (Fault::Hang, "late", "within 3 s"),
        (Fault::Garbage, "nonsense", "not a MessagePack map"),
        (Fault::Huge, "nonsense", "a message of more than"),
    ] {
        let game = BeamNgGame::start(Setup { fault: Some((fault, 12)), ..Setup::default() });
        let port = game.port();
        tried.push((format!("{fault:?}"), Some(game), port, kind, part));
    }
    for (what, game, port, kind, part) in tried {
        let folder = temp();
        let began = Instant::now();
        let ran = run(folder.path(), "record", &beamng(port)).run();
        // Where there is no simulator at all, the run ends without an outcome.
        let outcome = outcomes(folder.path(), "record").into_iter().next().unwrap_or(Value::Null);
        let error =
            if outcome.is_null() { &ran.stderr } else { outcome["error"].as_str().unwrap_or_default() };
        println!("{what}: exit code {:?} after {:.1} s: {error}", ran.code, began.elapsed().as_secs_f64());
        if error.is_empty() {
            // It was driven again, with a new connection.
            assert!(kind == "lost" && ran.stderr.contains(part), "{what}: {}", ran.stderr);
            assert!(game.unwrap().is_untouched());
            continue;
        }
        assert_eq!(ran.code, Some(1), "{what}: {error}");
        assert!(outcome.is_null() || outcome["error_kind"] == kind, "{what}: {outcome}");
        assert!(error.contains(part), "{what}: {error}");
    }
}
