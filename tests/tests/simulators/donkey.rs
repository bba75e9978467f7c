//! The Donkey simulator over its wire: a whole greedy test with the same outcome as without it, and everything that can go wrong.
//!
//! The stand-in is the embedded simulator behind the protocol of the other one. `PDK_SHOW=1` prints what each fault came to.

use std::io::{Read, Write};
use std::net::TcpListener;
use std::path::Path;
use std::process::{Command, Stdio};

use pdk_tests::process::{LIMIT, json_file, json_lines, pipeline};
use pdk_tests::processes::{BusFolder, comes_true, ended_within, signal};
use pdk_tests::records::wait_for_scenarios;
use pdk_tests::stand_in::{StandIn, free_ports, program};
use pdk_tests::tried::{self, Tried};
use pdk_tests::{Pdk, real_data, temp};
use rustix::process::Signal;
use serde_json::{Value, json};

/// Scenarios with the driver `lane_keeper`; each is over in a second or two of simulation time.
const SOURCE: &str = r#"
    local settings = pdk.settings({ simulator = { name = "donkey" }, scenarios = 2, duration = 2 })
    local scenarios = {}
    for number = 1, settings.scenarios do
        table.insert(scenarios, { name = `drive {number}`, ["repeat"] = number, road = { angles = { 0, number, 0 } } })
    end
    pdk.show(pdk.drive({
        simulator = settings.simulator, driver = "lane_keeper", duration = settings.duration, scenarios = scenarios,
    }))
"#;

/// The stand-in in lockstep, with a small picture.
fn simulator(port: u16) -> Value {
    json!({
        "name": "donkey", "build": "road_generating", "port": port, "width": 80, "height": 60, "settle_seconds": 0,
        "start_seconds": 40, "answer_seconds": 15
    })
}

#[track_caller]
fn run(simulator: &Value, more: &[(&str, &str)]) -> Tried {
    let simulator = simulator.to_string();
    tried::run(SOURCE, &[&[("simulator", simulator.as_str())], more].concat())
}

fn lines_of(out: &Path) -> Vec<Value> {
    json_lines(&out.join("scenarios.jsonl"))
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn a_greedy_test_through_the_wire_has_the_same_outcome() {
    let folder = temp();
    let greedy = |out: &str, simulator: Value| {
        let out = folder.path().join(out);
        let command = Pdk::new(["run", "greedy", "--workers", "2", "--out"]).arg(&out);
        command
            .set("simulator", simulator.to_string())
            .set("driver", "lane_keeper")
            .set("roads", "2")
            .set("perturbations", "defocus_blur,rotate_image")
            // The stand-in knows one seed for a road, not that of each repeat.
            .set("repeats", "1")
            .set("resolution", "1")
            .set("images_every", "0")
            .succeed();
        out
    };
    let size = json!({"width": 160, "height": 120});
    let mut lane = json!({"name": "lane", "initial_speed": 0, "oncoming": 0, "straight_ends": 0});
    lane.as_object_mut().unwrap().extend(size.as_object().unwrap().clone());
    let without = greedy("without", lane);

    let port = free_ports(2);
    let seeds = without.join("scenarios.jsonl");
    let options = ["--build", "road_generating", "--home", "0,0,0", "--seeds", seeds.to_str().unwrap()];
    let _stand_ins = [0, 1].map(|slot| StandIn::start("donkey", port + slot, &options));
    let mut donkey = simulator(port);
    donkey["encoding"] = json!("png");
    donkey.as_object_mut().unwrap().extend(size.as_object().unwrap().clone());
    let with = greedy("with", donkey);

    let (expected, found) = (lines_of(&without), lines_of(&with));
    assert!(expected.len() > 8, "{}", expected.len());
    assert_eq!(expected.len(), found.len());
    for (expected, found) in expected.iter().zip(&found) {
        // The digest is over every frame that the driver saw and every control it gave.
        for field in
            ["name", "cause", "time", "frames", "digest", "mean_cross_track_error", "max_cross_track_error"]
        {
            assert_eq!(expected[field], found[field], "{field} of {}", expected["name"]);
        }
        assert_eq!(found["scenario"]["mode"], "realtime");
    }
    let results = |out: &Path| json_file(&out.join("greedy.json"))["results"].clone();
    assert_eq!(results(&without), results(&with));
}

#[test]
fn both_builds_are_driven_by_the_clock_too() {
    for (build, road) in [("current", false), ("road_generating", true)] {
        let port = free_ports(1);
        let _stand_in = StandIn::start("donkey", port, &["--build", build, "--rate", "50"]);
        let mut simulator = simulator(port);
        simulator["build"] = json!(build);
        simulator["rate"] = json!(50);
        let source = match road {
            true => SOURCE.to_owned(),
            false => SOURCE.replace("road = { angles = { 0, number, 0 } }", ""),
        };
        let (folder, out) = (temp(), temp());
        Pdk::new(["run", "--workers", "1", "--out"])
            .arg(out.path().join("out"))
            .arg(pipeline(folder.path(), &source))
            .set("simulator", simulator.to_string())
            .succeed();
        for line in lines_of(&out.path().join("out")) {
            let frames =
                line["frames"].as_u64().unwrap() + line["skipped_frames"].as_u64().unwrap_or_default();
            assert_eq!(line["cause"], "time_out", "{line}");
            // By the simulator's own time, which goes on by a frame with each that it sends.
            assert!((95..=104).contains(&frames), "{line}");
            assert!(line["max_cross_track_error"].as_f64().unwrap() < 1.0, "{line}");
        }
    }
}

/// The build reports `done` beyond 2 m from the middle of the lane, as it does at the end of the road.
#[test]
fn a_car_that_leaves_its_lane_has_not_reached_the_end_of_the_road() {
    let port = free_ports(1);
    let _stand_in = StandIn::start("donkey", port, &["--build", "road_generating"]);
    let mut simulator = simulator(port);
    simulator["lane_departure"] = json!(3);
    // Full lock to the right, against which the driver steers in vain.
    let offset = r#"perturbations = { { name = "steering_offset", offset = 1, side = "right" } }, road = {"#;
    let simulator = simulator.to_string();
    let run = tried::run(
        &SOURCE.replace("road = {", offset),
        &[("simulator", simulator.as_str()), ("duration", "10")],
    );
    run.says(0, &[]);
    assert_eq!(run.causes(), ["lane_departure"; 2]);
    assert!(
        run.lines.iter().all(|line| line["max_cross_track_error"].as_f64().unwrap() >= 3.0),
        "{:?}",
        run.lines
    );
}

#[test]
fn a_simulator_with_german_numbers_is_read() {
    let port = free_ports(1);
    let _stand_in = StandIn::start("donkey", port, &["--build", "road_generating", "--numbers", "german"]);
    let run = run(&simulator(port), &[]);
    run.says(0, &[]);
    assert_eq!(run.causes(), ["time_out"; 2]);
}

/// A scenario in the middle of which the simulator is lost says nothing about the driver: it is driven again.
#[test]
fn a_scenario_whose_simulator_is_lost_is_driven_again() {
    for (fault, says, least) in [
        ("close", "has closed the connection", 0.0),
        ("close:5", "has closed the connection", 5.0),
        ("half", "in the middle of a message", 0.0),
    ] {
        let port = free_ports(1);
        let _stand_in = StandIn::start("donkey", port, &["--build", "road_generating", "--fault", fault]);
        let run = run(&simulator(port), &[]);
        run.says(0, &[says, "simulator `donkey`", "driven again from its beginning, once"]);
        assert_eq!(run.causes(), ["time_out"; 2], "{fault}");
        // The trace of the first attempt is not left in that of the second.
        assert!(run.lines.iter().all(|line| line["frames"] == 41), "{:?}", run.lines);
        assert!(run.took.as_secs_f64() >= least, "{fault}: {:?}", run.took);
    }
}

#[test]
fn one_that_is_lost_every_time_is_an_error_of_its_scenario() {
    let port = free_ports(1);
    let _stand_in =
        StandIn::start("donkey", port, &["--build", "road_generating", "--fault", "close", "--times", "3"]);
    let run = run(&simulator(port), &[]);
    run.says(1, &["1 of 2 scenarios", "has closed the connection"]);
    assert_eq!(run.causes(), ["error", "time_out"]);
    assert_eq!((&run.lines[0]["error_kind"], &run.lines[0]["frames"]), (&json!("lost"), &json!(20)));
}

#[test]
fn one_that_pdk_starts_is_started_again() {
    tried::is_started_again(SOURCE, &simulator(1), "donkey", "--build road_generating", 20);
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn one_that_hangs_ends_the_run_and_keeps_what_there_is() {
    let port = free_ports(1);
    let mut simulator = simulator(port);
    simulator["answer_seconds"] = json!(3);
    simulator["start_seconds"] = json!(10);
    // In the second drive, so that there is something to keep: the first has 40 controls.
    let options = ["--build", "road_generating", "--fault", "hang", "--at", "30"];
    let _stand_in = StandIn::start("donkey", port, &options);
    let run = run(&simulator, &[("duration", "1")]);
    // A drive of 20 controls, then one of as many, and no more.
    assert_eq!(run.causes(), ["time_out"; 2]);

    let port = free_ports(1);
    simulator["port"] = json!(port);
    let _stand_in = StandIn::start("donkey", port, &["--build", "road_generating", "--fault", "hang"]);
    let run = self::run(&simulator, &[]);
    run.says(1, &["simulator `donkey`", "has not loaded its scene within"]);
    assert!(run.lines.is_empty(), "{:?}", run.lines);
}

#[test]
fn nonsense_is_the_outcome_of_its_scenario() {
    for (fault, says) in
        [("garbage", "what is not a message of its protocol"), ("flood", "more than 67108864 bytes")]
    {
        let port = free_ports(1);
        let _stand_in = StandIn::start("donkey", port, &["--build", "road_generating", "--fault", fault]);
        let run = run(&simulator(port), &[("memory", "400")]);
        run.says(1, &["1 of 2 scenarios", says, "is another program at this port?"]);
        assert_eq!(run.causes(), ["error", "time_out"], "{fault}");
        assert_eq!(run.lines[0]["error_kind"], "nonsense");
    }
}

#[test]
fn one_that_is_not_there_is_waited_for_and_said() {
    let mut simulator = simulator(free_ports(1));
    simulator["start_seconds"] = json!(1);
    let run = run(&simulator, &[]);
    run.says(1, &["the Donkey simulator is not at 127.0.0.1:", "it was tried for 1 s", "`launch`"]);
    // It is not the fault of the line that waits for it.
    assert!(run.finished.stderr.contains("pdk: error: simulator `donkey`"), "{}", run.finished.stderr);
    assert!(run.lines.is_empty(), "{:?}", run.lines);
}

#[test]
fn another_program_at_the_port_is_reported() {
    // One that says something else, and one that says nothing.
    for (greeting, says) in [
        ("SSH-2.0-OpenSSH_9.9\r\n", "what is not a message of its protocol"),
        ("", "or correct `port`: another program may listen at"),
        ("HTTP/1.0 400 Bad Request\r\n\r\n", "is another program at this port?"),
    ] {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let mut simulator = simulator(listener.local_addr().unwrap().port());
        simulator["start_seconds"] = json!(1);
        std::thread::spawn(move || {
            while let Ok((mut stream, _)) = listener.accept() {
                let _ = stream.write_all(greeting.as_bytes());
                std::thread::spawn(move || stream.read_to_end(&mut Vec::new()));
            }
        });
        run(&simulator, &[]).says(1, &["the Donkey simulator at 127.0.0.1:", says]);
    }
}

#[test]
fn the_other_build_and_a_missing_scene_are_named() {
    for (is, set, scene, says) in [
        ("current", "road_generating", None, "set build=current"),
        ("road_generating", "current", None, "set build=road_generating"),
        ("current", "current", Some("moon"), "has no scene `moon`; it has generated_road, generated_track"),
    ] {
        let port = free_ports(1);
        let _stand_in = StandIn::start("donkey", port, &["--build", is, "--rate", "20"]);
        let mut simulator = simulator(port);
        simulator["build"] = json!(set);
        simulator["start_seconds"] = json!(10);
        if let Some(scene) = scene {
            simulator["scene"] = json!(scene);
        }
        let (folder, source) = (temp(), SOURCE.replace("road = { angles = { 0, number, 0 } }", ""));
        let command = Pdk::new(["run", "--workers", "1", "--out"]).arg(folder.path().join("out"));
        let command = command.arg(pipeline(folder.path(), &source)).set("simulator", simulator.to_string());
        command.fail(1, &[says]);
    }
}

#[test]
fn two_runs_do_not_share_a_simulator() {
    let port = free_ports(1);
    let _stand_in = StandIn::start("donkey", port, &["--build", "road_generating", "--rate", "20"]);
    let folder = temp();
    let script = pipeline(folder.path(), SOURCE);
    let start = |out: &str| {
        let command = Pdk::new(["run", "--workers", "1", "--out"]).arg(folder.path().join(out)).arg(&script);
        command.set("simulator", simulator(port).to_string()).set("duration", "1").set("scenarios", 400)
    };
    let mut first = start("first").spawn();
    let out = folder.path().join("first");
    wait_for_scenarios(&mut first, &out, 1);
    start("second").fail(1, &["another process of pdk", &format!("port {port}"), "set `port`"]);
    // The first one goes on undisturbed.
    let driven = lines_of(&out).len();
    wait_for_scenarios(&mut first, &out, driven + 2);
    signal(&first, Signal::INT);
    assert_eq!(ended_within(&mut first, LIMIT).unwrap().code(), Some(130));
    let lines = lines_of(&out);
    assert!(lines.len() >= driven + 2, "{lines:?}");
    assert!(lines.iter().all(|line| line["cause"] == "time_out"), "{lines:?}");
}

/// Numbers that no vehicle has, and a time that has passed, are not believed.
#[test]
fn a_state_that_cannot_be_is_the_outcome_of_its_scenario() {
    for (fault, says) in [
        ("huge", "its speed is 1e160 m/s, but has to be from -1000 to 1000 m/s"),
        ("back", "its time falls from "),
    ] {
        let port = free_ports(1);
        let _stand_in = StandIn::start("donkey", port, &["--build", "road_generating", "--fault", fault]);
        let run = run(&simulator(port), &[]);
        run.says(1, &["1 of 2 scenarios", "simulator `donkey`", says]);
        assert_eq!(run.causes(), ["error", "time_out"], "{fault}");
        assert_eq!(run.lines[0]["error_kind"], "nonsense");
    }
}

/// The lock of a port is a file there. If it cannot be written, that says nothing about a scenario.
#[test]
fn a_cache_that_cannot_be_written_ends_the_run() {
    let port = free_ports(1);
    let _stand_in = StandIn::start("donkey", port, &["--build", "road_generating"]);
    let folder = temp();
    let (script, out, cache) =
        (pipeline(folder.path(), SOURCE), folder.path().join("out"), folder.path().join("cache"));
    std::fs::write(&cache, "no folder").unwrap();
    let run = || {
        let command = Pdk::new(["run", "--workers", "1", "--out"]).arg(&out).arg(&script);
        command.set("simulator", simulator(port).to_string())
    };
    run().env("PDK_CACHE", &cache).fail(1, &["simulator `donkey`", "cannot write", "ports"]);
    assert_eq!(std::fs::read_to_string(out.join("scenarios.jsonl")).unwrap(), "");
    run().succeed();
    assert_eq!(lines_of(&out).len(), 2);
}

/// Who has started one simulator has one: without `--workers`, no worker looks for another one.
#[test]
fn one_simulator_is_enough_if_the_number_of_workers_is_not_set() {
    let port = free_ports(2);
    let _stand_in = StandIn::start("donkey", port, &["--build", "road_generating"]);
    let folder = temp();
    let mut simulator = simulator(port);
    simulator["start_seconds"] = json!(4);
    let run_for = |out: &str, simulator: &Value, duration: u32| {
        let command = Pdk::new(["run", "--out"]).arg(folder.path().join(out));
        let command = command.arg(pipeline(folder.path(), SOURCE)).set("simulator", simulator);
        command.set("scenarios", 4).set("duration", duration)
    };
    let run = |out: &str, simulator: &Value| run_for(out, simulator, 1);
    run("one", &simulator).succeed();
    let out = folder.path().join("one");
    assert_eq!(lines_of(&out).len(), 4);
    let replayed = Pdk::new(["replay"]).arg(&out).run();
    assert!(!replayed.stderr.contains("is not at"), "{}", replayed.stderr);
    // What fails once in a simulator with its own clock need not fail again, so nothing smaller follows from it.
    Pdk::new(["shrink", "--scenario", "0"])
        .arg(&out)
        .folder(folder.path())
        .fail(1, &["nothing can be shrunk", "simulator `donkey` has its own clock"]);
    // Of two workers the one that finds none leaves its work to the other one, which has enough of it until then, and the only one
    // ends the run.
    let driven = run_for("two", &simulator, 4).set("workers", 2).succeed();
    let said = [
        "pdk: warning: worker 1 gets nothing more to do, and others do its work: simulator `donkey`",
        &format!("is not at 127.0.0.1:{}", port + 1),
        "worker 1 needs a simulator of its own there",
        "--workers 1",
    ];
    assert!(said.iter().all(|part| driven.stderr.contains(part)), "{}", driven.stderr);
    let causes: Vec<Value> =
        lines_of(&folder.path().join("two")).into_iter().map(|mut line| line["cause"].take()).collect();
    assert_eq!(causes, ["time_out"; 4]);
    // With those that pdk starts, every worker has one.
    simulator["launch"] = json!([program(), "donkey", "{port}", "--build", "road_generating"]);
    simulator["port"] = json!(free_ports(4));
    let bus = BusFolder::new();
    let (variable, place) = bus.variable();
    let mut child = run_for("started", &simulator, 20).env(variable, place).spawn();
    let simulators =
        || bus.processes().iter().filter(|process| process.command.contains("stand_in donkey")).count();
    let wanted = std::thread::available_parallelism().unwrap().get().min(4);
    assert!(comes_true(LIMIT, || simulators() >= wanted), "{:?}", bus.processes());
    signal(&child, Signal::TERM);
    assert!(ended_within(&mut child, LIMIT).is_some());
    assert!(comes_true(LIMIT, || bus.processes().is_empty()), "{:?}", bus.processes());
}

/// Nothing is in flight yet that could be finished.
#[test]
fn ctrl_c_ends_the_wait_for_a_simulator() {
    let (folder, bus) = (temp(), BusFolder::new());
    let (variable, place) = bus.variable();
    let command = Pdk::new(["run", "--out"]).arg(folder.path().join("out"));
    let command = command.arg(pipeline(folder.path(), SOURCE)).set("simulator", simulator(free_ports(1)));
    let mut child = command.env(variable, place).spawn();
    // The loop process has its topics before it waits for the simulator.
    assert!(comes_true(LIMIT, || !bus.buses().is_empty()));
    signal(&child, Signal::INT);
    let status = ended_within(&mut child, LIMIT).unwrap();
    let mut said = String::new();
    child.stderr.take().unwrap().read_to_string(&mut said).unwrap();
    assert_eq!(status.code(), Some(130), "{said}");
    // It would report that no client came if it had waited to the end.
    assert!(said.contains("pdk: error: the run was interrupted") && !said.contains("is not at"), "{said}");
    assert!(comes_true(LIMIT, || bus.processes().is_empty()), "{:?}", bus.processes());
    assert!(bus.left().is_empty(), "{:?}", bus.left());
}

/// All processes of a run that started its simulators, killed at once or asked to end.
#[test]
fn simulators_end_with_the_run_however_it_ends() {
    for last in [Signal::KILL, Signal::TERM, Signal::INT] {
        let port = free_ports(2);
        let (folder, bus) = (temp(), BusFolder::new());
        let mut simulator = simulator(port);
        // Behind a shell that waits for it, as simulators are that come with a script.
        let start = format!("{} donkey $0 --build road_generating --rate 20; exit 1", program().display());
        simulator["launch"] = json!(["sh", "-c", start, "{port}"]);
        let (variable, place) = bus.variable();
        let command = Pdk::new(["run", "--workers", "2", "--out"]).arg(folder.path().join("out"));
        let command = command.arg(pipeline(folder.path(), SOURCE)).set("simulator", simulator.to_string());
        let mut child = command.set("duration", "5").env(variable, place).spawn();
        let simulators =
            || bus.processes().iter().filter(|process| process.command.contains("stand_in donkey")).count();
        // Each is one process, its shell, and the guard.
        assert!(comes_true(LIMIT, || simulators() >= 4), "{:?}", bus.processes());
        match last {
            Signal::KILL => {
                // The run and its workers, and not what looks after a simulator when they are gone.
                let is_pdk = |program: &str| program == "pdk" || program.ends_with("/pdk");
                let processes = bus.processes();
                let programs = processes.iter().filter(|p| p.command.split(' ').next().is_some_and(is_pdk));
                programs.for_each(|p| p.signal(last))
            }
            last => signal(&child, last),
        }
        assert!(ended_within(&mut child, LIMIT).is_some());
        assert!(comes_true(LIMIT, || bus.processes().is_empty()), "{last:?}: {:?}", bus.processes());
    }
}

#[test]
fn doctor_says_what_it_found() {
    let port = free_ports(1);
    let _stand_in = StandIn::start("donkey", port, &["--rate", "20"]);
    let set = |text: String| ["--set".to_owned(), text];
    let finished = Pdk::new(["doctor", "--simulator", "donkey"])
        .args(set(format!("port={port}")))
        .args(set("settle_seconds=0".to_owned()))
        .succeed();
    for part in [
        "`donkey` was ready after",
        "has its own clock",
        "version of the protocol: 2",
        "320x240",
        "at 20 Hz",
        "from a control",
    ] {
        assert!(finished.stdout.contains(part), "{part}: {}", finished.stdout);
    }
    let set = |text: &str| ["--set".to_owned(), text.to_owned()];
    let missing = Pdk::new(["doctor", "--simulator", "donkey"]).args(set(&format!("port={}", free_ports(1))));
    missing.args(set("start_seconds=1")).fail(1, &["is not at 127.0.0.1"]);
}

/// The stand-in that keeps to the C# code of both builds byte for byte. It answers and drives nowhere.
#[test]
fn the_parsers_of_the_real_builds_understand_it() {
    let Some(tool) = real_data("tools/donkey_sim.py") else { return };
    let python = Command::new("python3").args(["-c", "import PIL"]).stderr(Stdio::null()).status();
    if !python.is_ok_and(|status| status.success()) {
        eprintln!("skipped: python3 has no pillow");
        return;
    }
    for (mode, build) in [("master", "current"), ("fork", "road_generating")] {
        // pdk waits between two messages, but a stand-in that the machine does not run meanwhile reads both at once. What is lost every time
        // is not lost by chance.
        let mut attempts = (0..5).map(|_| drive_with_the_parser(&tool, mode, build));
        let said =
            attempts.find_map(Result::ok).unwrap_or_else(|| panic!("each of five drives lost a message"));
        for part in ["cam_config", "car_config", "control", "reset_car"] {
            assert!(said.contains(part), "{part}: {said}");
        }
    }
}

/// Drives with the stand-in.
///
/// # Errors
/// What the stand-in wrote, if it lost a message other than a control, the next of which says the same.
fn drive_with_the_parser(tool: &Path, mode: &str, build: &str) -> Result<String, String> {
    let port = free_ports(1);
    let log = temp();
    let log = log.path().join("log");
    let mut child = Command::new("python3")
        .arg(tool)
        .args([&port.to_string(), mode])
        .stdout(std::fs::File::create(&log).unwrap())
        .spawn()
        .unwrap();
    let mut simulator = simulator(port);
    // Its vehicle always moves.
    for (name, value) in [
        ("build", json!(build)),
        ("standing_speed", json!(100)),
        ("width", json!(320)),
        ("height", json!(240)),
    ] {
        simulator[name] = value;
    }
    let source = if mode == "fork" {
        SOURCE.to_owned()
    } else {
        SOURCE.replace("road = { angles = { 0, number, 0 } }", "")
    };
    let folder = temp();
    let out = folder.path().join("out");
    let command =
        Pdk::new(["run", "--workers", "1", "--out"]).arg(&out).arg(pipeline(folder.path(), &source));
    let finished = command
        .set("simulator", simulator.to_string())
        // It never comes back to where it started.
        .set("scenarios", 1)
        .set("duration", 0.5)
        .run();
    child.kill().unwrap();
    child.wait().unwrap();
    let said = std::fs::read_to_string(&log).unwrap();
    let lost = said.lines().filter(|line| line.contains("DROPPED") || line.contains("JSON ERROR"));
    let is_control = |line: &str| !line.replace(r#""msg_type":"control""#, "").contains("msg_type");
    if !lost.clone().all(is_control) {
        eprintln!("{}", lost.collect::<Vec<_>>().join("\n"));
        return Err(said);
    }
    assert_eq!(finished.code, Some(0), "{}{said}", finished.stderr);
    assert_eq!(lines_of(&out).len(), 1);
    Ok(said)
}
