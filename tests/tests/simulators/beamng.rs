//! The adapter `beamng` against a game that has the embedded simulator inside.
//! `PDK_SHOW=1` prints what each way to go wrong came to.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::time::Duration;

use pdk_model::component::ComponentSpec;
use pdk_sdk::prelude::{Control, Scenario, State};
use pdk_tests::beamng::{BeamNgGame, Fault, Setup};
use pdk_tests::process::{LIMIT, json_lines, pipeline};
use pdk_tests::processes::{comes_true, ended_within, signal};
use pdk_tests::stand_in::free_ports;
use pdk_tests::{Pdk, temp, tried};
use rustix::process::Signal;
use serde_json::{Value, json};

const PIPELINE: &str = r#"
    local settings = pdk.settings({ simulator = "beamng", duration = 3, more = 0 })
    local scenarios = {
        { name = "nominal", road = { angles = { 0, 10, -10, 0 } } },
        { name = "moved", road = { angles = { 0, 10, -10, 0 } }, perturbations = { "translate_image@4" } },
    }
    for number = 1, settings.more do
        table.insert(scenarios, { name = "more " .. number, ["repeat"] = number, road = { angles = { 0, 10, -10, 0 } } })
    end
    pdk.drive({ simulator = settings.simulator, driver = "lane_keeper", duration = settings.duration, scenarios = scenarios })
"#;

fn simulator(name: &str, more: Value) -> String {
    let mut simulator = json!({
        "name": name, "width": 80, "height": 60, "rate": 20, "field_of_view": 75, "camera_height": 1.35, "camera_pitch": 8,
    });
    simulator.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
    simulator.to_string()
}

fn beamng(port: u16) -> String {
    waiting(port, 40)
}

/// The adapter that waits this many seconds for an answer: few if none will come.
fn waiting(port: u16, seconds: u64) -> String {
    simulator("beamng", json!({"port": port, "start_seconds": 40, "answer_seconds": seconds}))
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
    let lane = simulator("lane", json!({"initial_speed": 0, "oncoming": 0, "straight_ends": 0}));
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

/// Accelerates for two seconds and brakes for four, without pdk's loop; the states while it brakes.
fn braked(setup: Setup) -> Vec<State> {
    let game = BeamNgGame::start(setup);
    let parameters = serde_json::from_str(&beamng(game.port())).unwrap();
    let Value::Object(mut parameters) = parameters else { panic!("not an object") };
    parameters.remove("name");
    let mut simulator = pdk_tests::carla::simulator("beamng", &Value::Object(parameters));
    let spec = ComponentSpec::new;
    let road = json!({"angles": [0, 0, 0, 0]});
    simulator.reset(&Scenario { road, ..Scenario::new(spec("beamng"), spec("brake")) }, 0).unwrap();
    let mut act = |throttle| simulator.act(Control { steering: 0.0, throttle }).unwrap();
    let fast = (0..40).map(|_| act(1.0)).last().unwrap();
    assert!(fast.speed > 2.0, "{fast:?}");
    (0..80).map(|_| act(-1.0)).collect()
}

/// In the game's default shift mode, a brake that is held at rest is the throttle of the reverse gear.
#[test]
fn a_brake_that_is_held_only_brakes() {
    for manual in [false, true] {
        let states = braked(Setup { manual, ..Setup::default() });
        let last = states.last().unwrap();
        assert!(last.speed.abs() < 0.05, "{manual}: {last:?}");
        assert!(states.is_sorted_by(|a, b| b.position[2] >= a.position[2] - 1e-6), "{manual}: {states:?}");
    }
}

#[test]
fn a_vehicle_that_drives_backwards_has_a_negative_speed() {
    let states = braked(Setup { arcade: true, ..Setup::default() });
    let last = states.last().unwrap();
    assert!(last.speed < -1.0, "{last:?}");
}

/// The game says when a picture is ready, and sends three or four bytes a pixel.
#[test]
fn a_picture_is_waited_for_however_it_is_sent() {
    let digests = [(0, 4), (3, 3)].map(|(asks, channels)| {
        let folder = temp();
        let game = BeamNgGame::start(Setup { asks, channels, ..Setup::default() });
        run(folder.path(), "record", &beamng(game.port())).set("duration", 1).succeed();
        outcomes(folder.path(), "record")
            .into_iter()
            .map(|outcome| outcome["digest"].clone())
            .collect::<Vec<_>>()
    });
    assert_eq!(digests[0], digests[1]);
    assert_ne!(digests[0][0], digests[0][1], "the second scenario is perturbed");
}

#[test]
fn damage_is_a_collision_from_a_threshold_on() {
    // Thirty in each of 60 frames.
    for (damage, cause) in [(None, "collision"), (Some(1_000), "collision"), (Some(10_000), "time_out")] {
        let game = BeamNgGame::start(Setup { wear: 30.0, ..Setup::default() });
        let mut simulator: Value = serde_json::from_str(&beamng(game.port())).unwrap();
        if let Some(damage) = damage {
            simulator["collision_damage"] = json!(damage);
        }
        let tried = tried::run(PIPELINE, &[("simulator", &simulator.to_string())]);
        assert_eq!(tried.causes(), [cause; 2], "{damage:?}");
    }
    // What a vehicle suffers from driving is none.
    let game = BeamNgGame::start(Setup { wear: 1.0, ..Setup::default() });
    assert_eq!(tried::run(PIPELINE, &[("simulator", &beamng(game.port()))]).causes(), ["time_out"; 2]);
}

/// It has no road for the simulator.
#[test]
fn doctor_says_what_it_found() {
    let game = BeamNgGame::start(Setup::default());
    let finished = Pdk::new(["doctor", "--simulator", "beamng"]).set("port", game.port()).succeed();
    for part in
        ["`beamng` was ready after", "waits for the driver", "protocol: v1.27", "frames of 320x160 pixels"]
    {
        assert!(finished.stdout.contains(part), "{part}: {}", finished.stdout);
    }
    assert!(game.is_untouched(), "{:?}", game.calls());
}

#[test]
fn one_that_is_not_there_is_waited_for_and_said() {
    let mut simulator: Value = serde_json::from_str(&beamng(free_ports(2))).unwrap();
    simulator["start_seconds"] = json!(1);
    let tried = tried::run(PIPELINE, &[("simulator", &simulator.to_string())]);
    tried.says(1, &["BeamNG.tech is not at 127.0.0.1:", "it was tried for 1 s", "`launch`"]);
    assert!(tried.lines.is_empty(), "{:?}", tried.lines);
}

#[test]
fn another_program_at_the_port_is_reported() {
    for (greeting, says) in [
        ("HTTP/1.0 400 Bad Request\r\n\r\n", "is another program at this port?"),
        ("", "or correct `port`: another program may listen at"),
    ] {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        std::thread::spawn(move || {
            while let Ok((mut stream, _)) = listener.accept() {
                let _ = stream.write_all(greeting.as_bytes());
                std::thread::spawn(move || stream.read_to_end(&mut Vec::new()));
            }
        });
        let mut simulator: Value = serde_json::from_str(&beamng(port)).unwrap();
        simulator["start_seconds"] = json!(if greeting.is_empty() { 5 } else { 40 });
        let tried = tried::run(PIPELINE, &[("simulator", &simulator.to_string())]);
        tried.says(1, &["BeamNG.tech at 127.0.0.1:", says]);
    }
}

#[test]
fn another_version_is_reported() {
    let game = BeamNgGame::start(Setup { protocol: "v1.23", ..Setup::default() });
    let tried = tried::run(PIPELINE, &[("simulator", &beamng(game.port()))]);
    tried.says(
        1,
        &["speaks version v1.23 of its protocol, but v1.27 was asked for", "set `protocol` to v1.23"],
    );
    // It says nothing about a scenario.
    assert!(tried.lines.is_empty(), "{:?}", tried.lines);
}

#[test]
fn a_scenario_whose_game_is_lost_is_driven_again() {
    for (fault, says) in [
        (Fault::Close, "has closed the connection, so that a scenario was driven again"),
        (Fault::Half, "has closed the connection in the middle of a message"),
    ] {
        let game = BeamNgGame::start(Setup { fault: Some((fault, 12)), ..Setup::default() });
        let tried = tried::run(PIPELINE, &[("simulator", &beamng(game.port()))]);
        tried.says(0, &[says, "driven again from its beginning, once"]);
        assert_eq!(tried.causes(), ["time_out"; 2], "{fault:?}");
        assert!(tried.lines.iter().all(|line| line["frames"] == 61), "{fault:?}: {:?}", tried.lines);
        assert!(game.is_untouched(), "{fault:?}: {:?}", game.calls());
    }
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn one_that_hangs_ends_the_run() {
    let game = BeamNgGame::start(Setup { fault: Some((Fault::Hang, 12)), ..Setup::default() });
    let tried = tried::run(PIPELINE, &[("simulator", &waiting(game.port(), 3))]);
    // It still hangs when it is connected to again.
    tried.says(1, &["simulator `beamng`", "has not answered `Hello` within 3 s"]);
    assert!(tried.lines.is_empty(), "{:?}", tried.lines);
}

#[test]
fn nonsense_is_the_outcome_of_its_scenario() {
    for (fault, says) in
        [(Fault::Garbage, "is not a MessagePack map"), (Fault::Huge, "a message of more than 83886080 bytes")]
    {
        let game = BeamNgGame::start(Setup { fault: Some((fault, 12)), ..Setup::default() });
        let tried = tried::run(PIPELINE, &[("simulator", &beamng(game.port())), ("memory", "400")]);
        tried.says(1, &["1 of 2 scenarios", says, "is another program at this port?"]);
        assert_eq!(tried.causes(), ["error", "time_out"], "{fault:?}");
        assert_eq!(tried.kind(), "nonsense", "{fault:?}");
        assert!(game.is_untouched(), "{fault:?}: {:?}", game.calls());
    }
}

/// How long a simulator is away that comes back.
const AWAY: Duration = Duration::from_secs(1);

#[test]
fn one_that_comes_back_is_used_again() {
    let game = BeamNgGame::start(Setup::default());
    let port = game.port();
    let back = std::thread::spawn(move || {
        assert!(comes_true(LIMIT, || game.steps() >= 12));
        drop(game);
        std::thread::sleep(AWAY);
        BeamNgGame::start(Setup { port, ..Setup::default() })
    });
    let mut simulator: Value = serde_json::from_str(&beamng(port)).unwrap();
    simulator["start_seconds"] = json!(LIMIT.as_secs());
    let tried = tried::run(PIPELINE, &[("simulator", &simulator.to_string())]);
    tried.says(0, &["so that a scenario was driven again from its beginning, once"]);
    assert_eq!(tried.causes(), ["time_out"; 2]);
    assert!(tried.took >= AWAY, "{:?}", tried.took);
    let game = back.join().unwrap();
    assert!(game.is_untouched(), "{:?}", game.calls());
}

#[test]
fn two_clients_at_once_do_not_meet() {
    let folder = temp();
    let game = BeamNgGame::start(Setup::default());
    let mut first = run(folder.path(), "first", &beamng(game.port())).set("more", 400).spawn();
    assert!(comes_true(LIMIT, || game.steps() >= 12));
    // Another run of pdk leaves it alone.
    let second = tried::run(PIPELINE, &[("simulator", &beamng(game.port()))]);
    second.says(1, &["another process of pdk", &format!("port {}", game.port()), "set `port`"]);
    assert!(second.lines.is_empty());
    // So may any other client: the game serves both.
    let mut other = TcpStream::connect(("127.0.0.1", game.port())).unwrap();
    other.write_all(b"\0\0\0\x11\x82\xa4type\xa5Hello\xa3_id\x07").unwrap();
    let mut length = [0; 4];
    other.read_exact(&mut length).unwrap();
    let before = game.steps();
    assert!(comes_true(LIMIT, || game.steps() > before + 100));
    signal(&first, Signal::INT);
    assert_eq!(ended_within(&mut first, LIMIT).unwrap().code(), Some(130));
    let outcomes = outcomes(folder.path(), "first");
    assert!(outcomes.iter().all(|outcome| outcome["cause"] != "error"), "{outcomes:?}");
    assert!(outcomes.len() > 2, "{outcomes:?}");
    assert!(game.is_untouched(), "{:?}", game.calls());
}
