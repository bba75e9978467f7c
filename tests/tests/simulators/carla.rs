//! The adapter `carla` against a server that has the embedded simulator inside, and against one that only answers.
//! `PDK_SHOW=1` prints what each way to go wrong came to.

use std::io::Write;
use std::net::TcpListener;
use std::path::Path;
use std::time::{Duration, Instant};

use pdk_tests::carla::{CarlaServer, Fault, Setup};
use pdk_tests::process::{LIMIT, json_file, json_lines, pipeline};
use pdk_tests::processes::{BusFolder, comes_true, ended_within, signal, signal_taken};
use pdk_tests::stand_in::free_ports;
use pdk_tests::tried::{self, Tried};
use pdk_tests::{Pdk, pixels, repository, temp};
use rustix::process::Signal;
use serde_json::{Value, json};

/// The camera of `lane`, small.
pub fn simulator(port: u16, more: Value) -> String {
    let mut simulator = json!({
        "name": "carla", "port": port, "width": 80, "height": 60, "rate": 20, "field_of_view": 75, "camera_height": 1.35,
        "camera_pitch": 8, "initial_speed": 8, "start_seconds": 40, "answer_seconds": 40,
        "exposure_seconds": 0,
    });
    simulator.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
    simulator.to_string()
}

fn greedy(out: &Path, simulator: &str) -> Pdk {
    Pdk::new(["run", "--out"])
        .arg(out)
        .arg("greedy")
        .set("simulator", simulator)
        .set("perturbations", "translate_image")
        .set("levels", "0,4")
        .set("search", "climb")
        .set("limit", 10)
}

/// Drives a short road for a second, and another one after it.
const SHORT: &str = r#"
    local settings = pdk.settings({ simulator = "carla", roads = 1, driver = "lane_keeper", duration = 1 })
    local scenarios = {}
    for road = 1, settings.roads do
        table.insert(scenarios, { name = "road " .. road, road = { angles = { 0, 5 + road % 20, -5, 0 } } })
    end
    pdk.drive({ simulator = settings.simulator, driver = settings.driver, duration = settings.duration, scenarios = scenarios })
"#;

fn short(folder: &Path, simulator: &str) -> Pdk {
    short_with(folder, simulator, 1)
}

fn short_with(folder: &Path, simulator: &str, workers: usize) -> Pdk {
    let source = pipeline(folder, SHORT);
    Pdk::new(["run", "--out"])
        .arg(folder.join("record"))
        .arg(source)
        .set("simulator", simulator)
        .set("workers", workers)
}

/// The outcomes of a run in this folder.
pub fn outcomes(folder: &Path) -> Vec<Value> {
    json_lines(&folder.join("record/scenarios.jsonl"))
}

/// Nothing of pdk is left at a server.
pub fn assert_left_as_it_was(server: &CarlaServer) {
    assert_eq!(server.actors(), Vec::<String>::new());
    assert!(!server.is_synchronous());
}

/// As [`assert_left_as_it_was`], if a process of pdk may have been ended before it could leave: then a copy of it tidies up after its end.
fn assert_will_be_left_as_it_was(server: &CarlaServer) {
    let is_left = || server.actors().is_empty() && !server.is_synchronous();
    assert!(comes_true(LIMIT, is_left), "{:?}, synchronous: {}", server.actors(), server.is_synchronous());
}

#[test]
fn a_greedy_test_over_the_wire_comes_out_as_one_without_it() {
    let folder = temp();
    let lane = folder.path().join("lane");
    let embedded =
        json!({"name": "lane", "width": 80, "height": 60, "oncoming": 0, "straight_ends": 0}).to_string();
    greedy(&lane, &embedded).set("roads", 1).succeed();
    let expected = json_lines(&lane.join("scenarios.jsonl"));
    let seed = expected[0]["scenario"]["seed"].as_u64().unwrap();

    let server = CarlaServer::start(Setup { seed, ..Setup::default() });
    let carla = folder.path().join("carla");
    greedy(&carla, &simulator(server.port(), json!({}))).set("roads", 1).set("workers", 1).succeed();
    let found = json_lines(&carla.join("scenarios.jsonl"));
    assert_eq!(found.len(), expected.len());
    assert!(
        expected.iter().any(|outcome| outcome["success"] == false),
        "nothing failed, so nothing is compared"
    );
    for (expected, found) in expected.iter().zip(&found) {
        for field in ["name", "success", "cause"] {
            assert_eq!(found[field], expected[field], "{expected}\n{found}");
        }
        let number = |outcome: &Value, field: &str| outcome[field].as_f64().unwrap();
        // Positions have 32 bits on the wire, and the end of the road counts as reached half a metre before it.
        assert!((number(found, "frames") - number(expected, "frames")).abs() <= 3.0, "{expected}\n{found}");
        for field in ["mean_cross_track_error", "max_cross_track_error", "progress"] {
            assert!(
                (number(found, field) - number(expected, field)).abs() < 0.05,
                "{field}\n{expected}\n{found}"
            );
        }
    }
    let level = |out: &Path| {
        let saved = json_file(&out.join("greedy.json"));
        let results = saved["results"].as_array().unwrap().clone();
        results.into_iter().map(|result| result["failing_level"]["level"].clone()).collect::<Vec<_>>()
    };
    assert_eq!(level(&carla), level(&lane));
    assert_left_as_it_was(&server);
}

/// What is perturbed by what pixels show, or by how far away they are, has its own camera, and only then.
#[test]
fn labels_and_distances_have_cameras_where_they_are_needed() {
    const MASKED: &str = r#"
        local settings = pdk.settings({ simulator = "carla" })
        local scenarios = {}
        for name, where in { plain = {}, road = { label = { "road", "marking" } }, far = { farther = 20 }, wrong = { label = "rode" } } do
            local inverted = { name = "false_color_filter", level = 3, where = where }
            table.insert(scenarios, {
                name = name,
                seed = 5,
                road = { angles = { 0, 5, -5, 0 } },
                perturbations = if name == "plain" then {} else { inverted },
            })
        end
        table.sort(scenarios, function(a, b) return a.name < b.name end)
        pdk.drive({ simulator = settings.simulator, driver = "lane_keeper", duration = 0.5, scenarios = scenarios })
    "#;
    for version in ["0.9.13", "0.9.16"] {
        let folder = temp();
        let server = CarlaServer::start(Setup { version, ..Setup::default() });
        let finished = Pdk::new(["run", "--out"])
            .arg(folder.path().join("record"))
            .arg(pipeline(folder.path(), MASKED))
            .set("simulator", simulator(server.port(), json!({})))
            .set("workers", 1)
            .run();
        let found = outcomes(folder.path());
        let causes: Vec<_> = found.iter().map(|outcome| outcome["cause"].as_str().unwrap()).collect();
        assert_eq!(causes, ["time_out", "time_out", "time_out", "error"], "{version}: {finished:?}");
        let error = found[3]["error"].to_string();
        assert!(error.contains("has no label `rode`; it has `other`, `road`, `sidewalk`"), "{error}");
        // The sky, and the asphalt in front of the vehicle, of 60 rows.
        let [far, plain, road] = [0, 1, 2].map(|scenario| {
            let trace = format!("record/traces/{}.mcap", found[scenario]["id"].as_str().unwrap());
            let changes = pixels::changes(&folder.path().join(trace));
            [0..10, 50..60].map(|rows| pixels::changed(&changes, rows))
        });
        assert!(far[0] > 0.5 && far[1] == 0.0, "{version}: {far:?}");
        assert_eq!(plain, [0.0, 0.0], "{version}");
        assert!(road[0] == 0.0 && road[1] > 0.5, "{version}: {road:?}");
        let count = |kind: &str| server.spawned().iter().filter(|spawned| *spawned == kind).count();
        let cameras = ["sensor.camera.rgb", "sensor.camera.semantic_segmentation", "sensor.camera.depth"];
        assert_eq!(cameras.map(count), [4, 2, 1], "{version}");
        assert_left_as_it_was(&server);
    }
}

#[test]
fn two_workers_have_a_server_each_and_find_what_one_finds() {
    let folder = temp();
    let port = free_ports(4);
    let [first, second] = [port, port + 2].map(|port| CarlaServer::start(Setup { port, ..Setup::default() }));
    let mut records = Vec::new();
    for workers in [1, 2] {
        let record = folder.path().join(format!("{workers}"));
        std::fs::create_dir(&record).unwrap();
        let simulator = simulator(first.port(), json!({"port_step": 2}));
        short_with(&record, &simulator, workers).set("roads", 6).succeed();
        records.push(std::fs::read_to_string(record.join("record/scenarios.jsonl")).unwrap());
    }
    assert_eq!(records[0], records[1]);
    assert!(second.calls().iter().any(|call| call == "tick_cue"), "the second server had nothing to do");
    assert_left_as_it_was(&first);
    assert_left_as_it_was(&second);
}

#[test]
fn a_scenario_is_the_same_in_every_version() {
    let mut digests = Vec::new();
    for version in ["0.9.13", "0.9.14", "0.9.15", "0.9.16"] {
        let folder = temp();
        let server = CarlaServer::start(Setup { version, ..Setup::default() });
        short(folder.path(), &simulator(server.port(), json!({"weather": "HardRainNoon"}))).succeed();
        let outcome = outcomes(folder.path()).remove(0);
        assert_eq!(
            (&outcome["cause"], &outcome["frames"]),
            (&json!("time_out"), &json!(21)),
            "{version}: {outcome}"
        );
        digests.push(outcome["digest"].clone());
        assert_left_as_it_was(&server);
        assert_eq!(server.cloudiness(), 15.0, "the weather was not put back");
        assert!(server.calls().iter().any(|call| call == "set_weather_parameters"));
    }
    assert!(digests.windows(2).all(|pair| pair[0] == pair[1]), "{digests:?}");
}

/// The server closes a stream over which it has sent nothing for 10 s.
#[test]
fn streams_that_were_closed_are_made_again_and_nothing_is_missed() {
    let mut digests = Vec::new();
    for fault in [None, Some((Fault::CloseStreams, 20))] {
        let folder = temp();
        let server = CarlaServer::start(Setup { fault, ..Setup::default() });
        short(folder.path(), &simulator(server.port(), json!({}))).succeed();
        let outcome = outcomes(folder.path()).remove(0);
        assert_eq!((&outcome["cause"], &outcome["frames"]), (&json!("time_out"), &json!(21)), "{outcome}");
        digests.push(outcome["digest"].clone());
        // World, map, camera, collisions; on a slow machine that of collisions is renewed.
        assert!(server.subscriptions() >= if fault.is_some() { 7 } else { 4 });
    }
    assert_eq!(digests[0], digests[1]);
}

/// A camera that was just spawned adapts its exposure for seconds, and no driver is to see that.
#[test]
fn a_camera_adapts_before_the_scenario_begins() {
    let mut digests = Vec::new();
    // Two seconds of frames; then not at all, and so long as it takes.
    for (adapts, exposure) in [(0, json!(0)), (40, Value::Null), (40, json!(0))] {
        let folder = temp();
        let server = CarlaServer::start(Setup { adapts, ..Setup::default() });
        let mut simulator: Value = serde_json::from_str(&simulator(server.port(), json!({}))).unwrap();
        match exposure {
            Value::Null => simulator.as_object_mut().unwrap().remove("exposure_seconds"),
            seconds => simulator.as_object_mut().unwrap().insert("exposure_seconds".to_owned(), seconds),
        };
        short(folder.path(), &simulator.to_string()).succeed();
        digests.push(outcomes(folder.path())[0]["digest"].clone());
        assert_left_as_it_was(&server);
    }
    assert_eq!(digests[0], digests[1]);
    assert_ne!(digests[0], digests[2], "the dark frames are not seen");
}

/// Its number of a frame and the camera's frame may come late: what belongs to the frame is waited for.
#[test]
fn a_frame_that_lags_is_waited_for() {
    let mut digests = Vec::new();
    for fault in [None, Some((Fault::Lags, 15))] {
        let folder = temp();
        let server = CarlaServer::start(Setup { fault, ..Setup::default() });
        short(folder.path(), &simulator(server.port(), json!({}))).succeed();
        let outcome = outcomes(folder.path()).remove(0);
        assert_eq!((&outcome["cause"], &outcome["frames"]), (&json!("time_out"), &json!(21)), "{outcome}");
        digests.push(outcome["digest"].clone());
        assert_left_as_it_was(&server);
    }
    assert_eq!(digests[0], digests[1]);
}

/// A server grows with every road that it generates. What is started here only says so: the server behind the port is there already.
#[test]
fn a_server_that_pdk_starts_is_started_again_after_some_worlds() {
    let folder = temp();
    let server = CarlaServer::start(Setup::default());
    let starts = folder.path().join("starts");
    let launch = json!(["sh", "-c", format!("echo start >> {}; exec sleep 1000", starts.display())]);
    let setting = |launch: &Value| simulator(server.port(), json!({"launch": launch, "restart_every": 2}));
    short(folder.path(), &setting(&launch)).set("roads", 5).succeed();
    let causes: Vec<_> = outcomes(folder.path()).iter().map(|outcome| outcome["cause"].clone()).collect();
    assert_eq!(causes, ["time_out"; 5]);
    assert_eq!(std::fs::read_to_string(&starts).unwrap().lines().count(), 3);
    assert_left_as_it_was(&server);

    let alone = wrong(&setting(&Value::Null));
    alone.says(1, &["`restart_every` is set, but pdk can only restart a server that it has started itself"]);
}

#[test]
fn other_vehicles_are_put_where_they_belong_and_taken_away() {
    let folder = temp();
    let server = CarlaServer::start(Setup::default());
    let traffic = json!({"vehicle_ahead": 30, "oncoming": 20});
    short(folder.path(), &simulator(server.port(), traffic)).succeed();
    let outcome = outcomes(folder.path()).remove(0);
    assert_eq!(outcome["cause"], "time_out", "{outcome}");
    let count = |name: &str| server.calls().iter().filter(|call| *call == name).count();
    // Two frames before the first, for its vehicle and its speed.
    assert!(count("set_actor_transform") > 21 && count("set_actor_simulate_physics") > 10);
    assert_left_as_it_was(&server);
}

#[test]
fn what_a_killed_worker_left_is_cleared_away_and_what_others_put_there_is_not() {
    let folder = temp();
    let server = CarlaServer::start(Setup::default());
    server.abandon();
    short(folder.path(), &simulator(server.port(), json!({}))).succeed();
    assert!(!server.is_synchronous());

    // A map that is loaded anew is empty. On one that is not, the other vehicle stays.
    let server = CarlaServer::start(Setup::default());
    server.abandon();
    let source = pipeline(
        folder.path(),
        r#"
        local settings = pdk.settings({ simulator = "carla" })
        local scenarios = { { name = "here", road = { start = 0 } } }
        pdk.drive({ simulator = settings.simulator, driver = "lane_keeper", duration = 0.2, scenarios = scenarios })
        "#,
    );
    let simulator = simulator(server.port(), json!({"initial_speed": 0}));
    Pdk::new(["run", "--out"])
        .arg(folder.path().join("other"))
        .arg(source)
        .set("simulator", simulator)
        .succeed();
    assert_eq!(server.actors(), ["vehicle.tesla.model3"]);
    assert!(!server.is_synchronous());
}

/// How long a simulator is away that comes back.
const AWAY: Duration = Duration::from_secs(1);

/// How many steps the server was asked for.
fn steps(server: &CarlaServer) -> usize {
    server.calls().iter().filter(|call| *call == "tick_cue").count()
}

#[test]
fn an_interrupted_run_leaves_the_server_as_it_was() {
    for (signals, code) in
        [(vec![Signal::INT], 130), (vec![Signal::INT, Signal::INT], 130), (vec![Signal::TERM], 143)]
    {
        let (folder, bus) = (temp(), BusFolder::new());
        let server = CarlaServer::start(Setup::default());
        let (name, value) = bus.variable();
        let run =
            short(folder.path(), &simulator(server.port(), json!({}))).set("duration", 60).set("roads", 50);
        let mut child = run.env(name, value).spawn();
        assert!(comes_true(LIMIT, || steps(&server) >= 30), "it does not drive");
        signals.iter().for_each(|one| signal_taken(&child, *one));
        let status = ended_within(&mut child, LIMIT).expect("it ends");
        assert_eq!(status.code(), Some(code), "{signals:?}");
        let gone = comes_true(LIMIT, || bus.processes().is_empty());
        assert!(gone, "{signals:?}: {:?}", bus.processes());
        let began = Instant::now();
        comes_true(LIMIT, || !server.is_synchronous());
        println!("{signals:?}: put back after {:.1} s", began.elapsed().as_secs_f64());
        assert_will_be_left_as_it_was(&server);
    }
}

#[track_caller]
fn wrong(simulator: &str) -> Tried {
    tried::run(SHORT, &[("simulator", simulator)])
}

#[test]
fn an_unsupported_server_version_is_reported() {
    let free = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().port();
    let absent = wrong(&simulator(free, json!({"start_seconds": 1})));
    absent.says(1, &["the CARLA server is not at 127.0.0.1:", "start it"]);
    assert!(absent.lines.is_empty());

    // Something that answers otherwise, and something that does not answer.
    for (what, said, part) in [
        ("another program", &b"HTTP/1.1 400 Bad Request\r\n\r\n"[..], "what is not MessagePack-RPC"),
        ("silence", b"", "or correct `port`: another program may listen at"),
    ] {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let port = listener.local_addr().unwrap().port();
        let serving = std::thread::spawn(move || {
            let mut kept = Vec::new();
            listener.set_nonblocking(true).unwrap();
            let began = Instant::now();
            while began.elapsed() < LIMIT {
                if let Ok((mut stream, _)) = listener.accept() {
                    let _ = stream.write_all(said);
                    kept.push(stream);
                }
                std::thread::sleep(Duration::from_millis(5));
            }
        });
        let other = wrong(&simulator(port, json!({"start_seconds": if said.is_empty() { 10 } else { 40 }})));
        assert_eq!(other.finished.code, Some(1), "{what}");
        assert!(other.error().contains(part), "{what}: {}", other.error());
        drop(serving);
    }

    for version in ["0.9.12", "0.10.0", "1.0"] {
        let server = CarlaServer::start(Setup { version, ..Setup::default() });
        let other = wrong(&simulator(server.port(), json!({})));
        assert!(other.error().contains("but the adapter speaks 0.9.13 to 0.9.16"), "{}", other.error());
    }
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn a_server_that_breaks_in_mid_scenario_is_reported() {
    for (fault, kinds, part) in [
        (Fault::Close, &["lost"][..], "closed the connection"),
        (Fault::Hang, &["late"], "has not"),
        (Fault::HalfAnswer, &["lost"], "closed the connection"),
        (Fault::HalfFrame, &["late"], "has not sent a camera frame"),
        (Fault::Garbage, &["nonsense"], "not MessagePack-RPC"),
        (Fault::Huge, &["nonsense"], "more than"),
        (Fault::HugeFrame, &["nonsense"], "a message of 100000000 bytes as a camera frame"),
        (Fault::Steps, &["nonsense"], "another client of CARLA steps the same server"),
    ] {
        let server = CarlaServer::start(Setup { fault: Some((fault, 15)), ..Setup::default() });
        // Only what falls silent has to be noticed soon.
        let patience = if kinds == ["late"] { 5 } else { 40 };
        let broken = wrong(&simulator(server.port(), json!({"answer_seconds": patience})));
        // Whatever it did, it goes on by itself, and has nothing of pdk in it: one that only hung hears that later.
        assert!(comes_true(LIMIT, || !server.is_synchronous()), "{fault:?}");
        assert_left_as_it_was(&server);
        // A connection that was lost is made again, and the scenario driven again: the server breaks only once.
        if broken.error().is_empty() {
            broken.says(0, &[part, "driven again"]);
            continue;
        }
        assert_eq!(broken.finished.code, Some(1));
        assert!(broken.kind().is_empty() || kinds.contains(&broken.kind()), "{fault:?}: {}", broken.kind());
        assert!(broken.error().contains(part), "{fault:?}: {}", broken.error());
    }
}

#[test]
fn one_that_comes_back_is_used_again() {
    let folder = temp();
    let server = CarlaServer::start(Setup::default());
    let port = server.port();
    let back = std::thread::spawn(move || {
        assert!(comes_true(LIMIT, || steps(&server) >= 15), "it does not drive");
        drop(server);
        std::thread::sleep(AWAY);
        CarlaServer::start(Setup { port, ..Setup::default() })
    });
    let simulator = simulator(port, json!({"start_seconds": LIMIT.as_secs()}));
    let began = Instant::now();
    // So long that it does not end before the server goes.
    let run = short(folder.path(), &simulator).set("roads", 2).set("duration", 10).run();
    println!(
        "back after {AWAY:?}: exit code {:?} after {:.1} s: {}",
        run.code,
        began.elapsed().as_secs_f64(),
        run.stderr
    );
    let outcomes = outcomes(folder.path());
    assert_eq!(run.code, Some(0), "{}", run.stderr);
    assert!(run.stderr.contains("driven again"), "{}", run.stderr);
    assert!(outcomes.iter().all(|outcome| outcome["cause"] == "finished"), "{outcomes:?}");
    assert_left_as_it_was(&back.join().unwrap());
}

#[test]
fn two_runs_do_not_share_a_server() {
    let folder = temp();
    let server = CarlaServer::start(Setup::default());
    let mut first = short(folder.path(), &simulator(server.port(), json!({})))
        .set("duration", 60)
        .set("roads", 400)
        .spawn();
    assert!(comes_true(LIMIT, || steps(&server) > 0), "it does not drive");
    wrong(&simulator(server.port(), json!({}))).says(1, &["another process of pdk"]);
    signal(&first, Signal::INT);
    assert!(ended_within(&mut first, LIMIT).is_some());
    assert_will_be_left_as_it_was(&server);
}

/// The server that the protocol was worked out with, and what CARLA's own client says to it.
#[test]
fn requests_are_those_of_the_official_client_in_all_versions() {
    let (Some(server), Some(golden)) = (
        pdk_tests::real_data("tools/carla_server.py"),
        pdk_tests::real_data("tools/carla_golden_0.9.16.jsonl"),
    ) else {
        return;
    };
    let python = std::env::var("PDK_TEST_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let has = std::process::Command::new(&python).args(["-c", "import msgpack"]).output();
    if !has.is_ok_and(|output| output.status.success()) {
        eprintln!("skipped: {python} has no msgpack (set PDK_TEST_PYTHON)");
        return;
    }
    for version in ["0.9.13", "0.9.14", "0.9.15", "0.9.16"] {
        let folder = temp();
        let port = CarlaServer::start(Setup::default()).port();
        let calls = folder.path().join("calls.jsonl");
        let mut process = std::process::Command::new(&python)
            .arg(&server)
            .arg(port.to_string())
            .args([calls.as_os_str(), version.as_ref(), "raw".as_ref()])
            .stdout(std::process::Stdio::null())
            .spawn()
            .unwrap();
        let run = short(
            folder.path(),
            &simulator(
                port,
                json!({"width": 32, "height": 16, "initial_speed": 0, "weather": "HardRainNoon"}),
            ),
        )
        .set("driver", r#"{"name":"dave2"}"#)
        .run();
        process.kill().unwrap();
        process.wait().unwrap();
        // It says that the vehicle has hit something in every third frame.
        let outcome = outcomes(folder.path()).remove(0);
        assert_eq!(
            (run.code, &outcome["cause"]),
            (Some(0), &json!("collision")),
            "{}\n{outcome}",
            run.stderr
        );
        if version == "0.9.16" {
            compare(&calls, &golden);
        }
    }
}

/// Compares what was recorded with the requests of the official client, from the name of the request on.
fn compare(calls: &Path, golden: &Path) {
    let recorded: Vec<u8> = std::fs::read_to_string(calls)
        .unwrap()
        .lines()
        .filter_map(|line| serde_json::from_str::<Value>(line).unwrap()["raw_rx"].as_str().map(str::to_owned))
        .flat_map(|hex| bytes(hex.trim_start_matches("bin:")))
        .collect();
    let mut compared = Vec::new();
    for line in json_lines(golden) {
        let name = line["call"].as_str().unwrap();
        // What the official client does not wait for, this one does; and it drives something else, with other settings.
        let chosen = [
            "spawn_actor",
            "spawn_actor_with_parent",
            "get_sensor_token",
            "destroy_actor",
            "load_new_episode",
        ];
        if line["is_async"] == true
            || chosen.contains(&name)
            || !recorded.windows(name.len()).any(|w| w == name.as_bytes())
        {
            continue;
        }
        let request = bytes(line["request_hex"].as_str().unwrap());
        let from = request.windows(name.len()).position(|w| w == name.as_bytes()).unwrap();
        assert!(
            recorded.windows(request.len() - from).any(|w| w == &request[from..]),
            "{name} differs from {line}"
        );
        compared.push(name.to_owned());
    }
    println!("equal to those of the official client: {}", compared.join(", "));
    for name in [
        "version",
        "get_episode_info",
        "get_episode_settings",
        "set_episode_settings",
        "tick_cue",
        "get_actor_definitions",
    ] {
        assert!(compared.iter().any(|compared| compared == name), "{name} was not compared");
    }
}

fn bytes(hex: &str) -> Vec<u8> {
    (0..hex.len() / 2).map(|i| u8::from_str_radix(&hex[2 * i..2 * i + 2], 16).unwrap()).collect()
}

/// Of the pipelines that come with pdk none has to know the simulator.
#[test]
fn the_adapter_is_listed_with_its_parameters() {
    let shown = Pdk::new(["show", "carla"]).succeed().stdout;
    for name in ["port_step", "launch", "weather", "camera_attributes", "start_seconds"] {
        assert!(shown.contains(name), "{name}: {shown}");
    }
    assert!(repository().join("docs/simulators/carla.md").is_file());
}
