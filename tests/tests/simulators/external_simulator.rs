//! Simulators in another process, and everything that can go wrong. Skipped where Python has not what they need.

use pdk_tests::process::{LIMIT, json_lines, pipeline};
use pdk_tests::processes::{BusFolder, comes_true};
use pdk_tests::tried::python;
use pdk_tests::{Finished, Pdk, repository, temp};
use serde_json::{Value, json};

const SOURCE: &str = r#"
    local settings = pdk.settings({ simulator = { name = "process" }, waypoints = { { 0, 0, 0 }, { 0, 0, 30 } } })
    pdk.drive({
        simulator = settings.simulator, driver = "lane_keeper", duration = 2,
        scenarios = { { road = { waypoints = settings.waypoints } }, { road = { waypoints = settings.waypoints }, ["repeat"] = 1 } },
    })
"#;

/// A straight road. It goes wrong in its first scenario where it is asked to: always, or once if there is a file to note that in.
const TOWN: &str = r#"
import os, sys, time
import pdk_simulator

fault, mark = sys.argv[1], sys.argv[2]

class Town:
    def __init__(self, camera):
        self.camera = camera
        if fault == "make":
            raise RuntimeError("no screen")
        if fault == "start":
            print("no display", file=sys.stderr, flush=True)
            os._exit(4)

    def reset(self, scenario, waypoints, slot):
        assert scenario["simulator"]["name"] == "process" and waypoints[1] == [0.0, 0.0, 30.0], (scenario, waypoints)
        self.first = scenario.get("repeat", 0) == 0 and not os.path.exists(mark)
        self.steps = 0
        if self.first and fault == "reset":
            raise ValueError("no such town")
        return self.state()

    def state(self):
        return pdk_simulator.State(position=(0.1, 0, 8 * self.steps / self.camera.rate), speed=8)

    def act(self, control):
        assert -1 <= control.steering <= 1
        self.steps += 1
        if self.first and self.steps == 5:
            if fault == "once":
                open(mark, "w").close()
            if fault in ("die", "once"):
                print("out of memory", file=sys.stderr, flush=True)
                os._exit(3)
            if fault == "hang":
                time.sleep(1000)
            if fault == "nonsense":
                return {"position": [0, 0], "speed": 8}
        return self.state()

    def frame(self, into):
        assert into.shape == (48, 64, 3)
        into[:] = 90
        into[:, 30:34] = 250

pdk_simulator.serve(Town, exchange=sys.argv[3] if len(sys.argv) > 3 else None)
"#;

/// The run with this fault, and the lines of its ledger.
#[track_caller]
fn run(fault: &str) -> (Finished, Vec<Value>) {
    let (folder, bus) = (temp(), BusFolder::new());
    let script = folder.path().join("town.py");
    std::fs::write(&script, TOWN).unwrap();
    let out = folder.path().join("out");
    // Only silence has to be noticed soon.
    let patience = if fault == "hang" { 2 } else { 40 };
    let simulator = json!({
        "name": "process", "command": ["python3", script, fault, folder.path().join("mark")],
        "width": 64, "height": 48, "rate": 10, "answer_seconds": patience, "start_seconds": 40,
    });
    let (variable, place) = bus.variable();
    let command = Pdk::new(["run", "--workers", "1", "--out"]).arg(&out).arg(pipeline(folder.path(), SOURCE));
    let command = command.set("simulator", simulator).env("PYTHONPATH", repository().join("sdk/python"));
    let finished = command.env(variable, place).run();
    assert!(comes_true(LIMIT, || bus.processes().is_empty()), "{:?}", bus.processes());
    assert!(bus.left().is_empty(), "{:?}", bus.left());
    let lines = out.join("scenarios.jsonl");
    (finished, if lines.exists() { json_lines(&lines) } else { Vec::new() })
}

#[test]
fn a_class_in_python_simulates_and_comes_out_the_same() {
    if !python() {
        return;
    }
    let [first, second] = [0, 1].map(|_| run("none"));
    assert_eq!(first.0.code, Some(0), "{}", first.0.stderr);
    for (first, second) in first.1.iter().zip(&second.1) {
        assert_eq!((&first["digest"], &first["measures"]), (&second["digest"], &second["measures"]));
        // It goes straight, although it does not say so.
        assert_eq!(first["measures"]["max_lateral_acceleration"], 0.0);
    }
    // Cross-track error, time and progress follow from the road.
    assert_eq!(
        (&first.1[0]["cause"], &first.1[0]["frames"], &first.1[0]["time"]),
        (&json!("time_out"), &json!(21), &json!(2.0))
    );
    assert!((first.1[0]["max_cross_track_error"].as_f64().unwrap() - 0.1).abs() < 1e-6);
    assert!((first.1[0]["progress"].as_f64().unwrap() - 16.0 / 30.0).abs() < 1e-6);
}

#[test]
fn one_that_is_lost_in_the_middle_is_started_again() {
    if !python() {
        return;
    }
    let (finished, lines) = run("once");
    assert_eq!(finished.code, Some(0), "{}", finished.stderr);
    assert!(
        finished.stderr.contains("out of memory, so that a scenario was driven again"),
        "{}",
        finished.stderr
    );
    assert_eq!(lines.iter().map(|line| &line["cause"]).collect::<Vec<_>>(), ["time_out", "time_out"]);
}

#[test]
fn one_that_fails_ends_its_scenario_with_that_cause() {
    if !python() {
        return;
    }
    for (fault, kind, says) in [
        ("reset", "failed", "failed: ValueError: no such town"),
        ("die", "lost", "ended (exit status: 3), and wrote last: out of memory"),
        ("hang", "late", "has not answered within 2 s"),
        ("nonsense", "nonsense", "answered with the position [0,0]"),
    ] {
        let (finished, lines) = run(fault);
        assert_eq!(finished.code, Some(1), "{fault}: {}", finished.stderr);
        assert!(finished.stderr.contains(says), "{fault}: {}", finished.stderr);
        let found: Vec<_> = lines.iter().map(|line| line["cause"].as_str().unwrap()).collect();
        assert_eq!(found, ["error", "time_out"], "{fault}: {}", finished.stderr);
        assert_eq!(lines[0]["error_kind"], kind, "{fault}");
    }
}

#[test]
fn one_that_is_not_to_be_had_ends_the_run() {
    if !python() {
        return;
    }
    let (finished, lines) = run("start");
    assert_eq!((finished.code, lines.len()), (Some(1), 0), "{}", finished.stderr);
    assert!(finished.stderr.contains("wrote last: no display"), "{}", finished.stderr);
    // One that is there and says why it cannot is the error of each scenario.
    let (finished, lines) = run("make");
    assert_eq!((finished.code, lines.len()), (Some(1), 2), "{}", finished.stderr);
    assert!(finished.stderr.contains("2 of 2 scenarios"), "{}", finished.stderr);
    assert!(finished.stderr.contains("RuntimeError: no screen"), "{}", finished.stderr);
}
