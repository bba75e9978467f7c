//! Drivers in another process: Python and C++, and everything that can go wrong. Those whose tools are missing are skipped.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};

use pdk_tests::process::{LIMIT, json_lines, pipeline};
use pdk_tests::processes::{BusFolder, comes_true, ended_within};
use pdk_tests::records::wait_for_scenarios;
use pdk_tests::tried::{self, Tried, python};
use pdk_tests::{Pdk, datasets, repository, target_folder, temp};
use serde_json::{Value, json};

const SOURCE: &str = r#"
    local settings = pdk.settings({ driver = { name = "process" }, scenarios = 2, duration = 1, mode = "lockstep" })
    local scenarios = {}
    for number = 1, settings.scenarios do
        table.insert(scenarios, { name = `drive {number}`, ["repeat"] = number, road = { angles = { 0, number, 0 } } })
    end
    pdk.show(pdk.drive({
        simulator = { name = "lane", width = 320, height = 240 }, driver = settings.driver, duration = settings.duration,
        mode = settings.mode, scenarios = scenarios,
    }))
"#;

/// A driver that holds the middle by the state alone, and goes wrong at frame 10 of its first scenario where it is asked to.
const PILOT: &str = r#"
import os, sys, time
import iceoryx2
import pdk_driver

fault, mark = sys.argv[1], sys.argv[2]

def drive(frame, context):
    assert frame.shape == (240, 320, 3) and not frame.flags.writeable and not frame.flags.owndata
    assert context.speed > 0 or context.frame_index == 0
    if context.frame_index == 10 and fault != "none" and not os.path.exists(mark):
        open(mark, "w").close()
        if fault == "die":
            print("out of memory", file=sys.stderr, flush=True)
            os._exit(3)
        if fault == "hang":
            time.sleep(1000)
        if fault == "nonsense":
            return float("nan"), 0.0
        if fault == "raise":
            raise RuntimeError("no such layer")
        if fault == "half":
            # Ends when the answer has been begun and not sent.
            iceoryx2.SampleMutUninit.write_payload = lambda *_: os._exit(4)
        if fault == "late":
            time.sleep(3)
    return (float(frame[:, 160:, 0].mean()) - float(frame[:, :160, 0].mean())) / 1000.0, 0.25

open(f"{mark}-{os.getpid()}", "w").close()
pdk_driver.serve(drive, exchange=sys.argv[3] if len(sys.argv) > 3 else None)
"#;

#[track_caller]
fn run(driver: &Value, more: &[(&str, &str)]) -> Tried {
    let driver = driver.to_string();
    tried::run(SOURCE, &[&[("driver", driver.as_str())], more].concat())
}

/// The driver in Python, which goes wrong where it is asked to.
fn pilot(folder: &Path, fault: &str) -> Value {
    let script = folder.join("pilot.py");
    std::fs::write(&script, PILOT).unwrap();
    // Only silence has to be noticed soon.
    let patience = if ["hang", "late"].contains(&fault) { 2 } else { 40 };
    json!({
        "name": "process", "command": ["python3", script, fault, folder.join("mark")], "answer_seconds": patience, "start_seconds": 40
    })
}

#[test]
fn a_function_in_python_drives_and_comes_out_the_same() {
    if !python() {
        return;
    }
    let folder = temp();
    let [first, second] = [0, 1].map(|_| run(&pilot(folder.path(), "none"), &[]));
    assert_eq!(first.finished.code, Some(0), "{}", first.finished.stderr);
    assert_eq!(first.lines.len(), 2);
    for (first, second) in first.lines.iter().zip(&second.lines) {
        assert_eq!(first["cause"], "time_out");
        assert_eq!((&first["frames"], &first["digest"]), (&json!(21), &second["digest"]));
    }
    let realtime = run(&pilot(folder.path(), "none"), &[("mode", "realtime")]);
    assert_eq!(realtime.finished.code, Some(0), "{}", realtime.finished.stderr);
}

#[test]
fn one_that_fails_ends_its_scenario_with_that_cause() {
    if !python() {
        return;
    }
    for (fault, kind, says) in [
        ("die", "lost", "ended (exit status: 3), and wrote last: out of memory"),
        ("raise", "lost", "no such layer"),
        ("hang", "late", "has not answered a frame within 2 s"),
        ("nonsense", "nonsense", "it steers NaN with throttle 0"),
        ("half", "lost", "ended (exit status: 4)"),
        // It answers after all: too late.
        ("late", "late", "has not answered a frame within 2 s"),
    ] {
        let folder = temp();
        let run = run(&pilot(folder.path(), fault), &[]);
        assert_eq!(run.finished.code, Some(1), "{fault}: {}", run.finished.stderr);
        assert!(run.finished.stderr.contains(says), "{fault}: {}", run.finished.stderr);
        let found: Vec<_> = run.lines.iter().map(|line| line["cause"].as_str().unwrap()).collect();
        assert_eq!(found, ["error", "time_out"], "{fault}");
        assert_eq!(
            (&run.lines[0]["error_kind"], &run.lines[0]["frames"]),
            (&json!(kind), &json!(10)),
            "{fault}"
        );
    }
}

#[test]
fn a_program_that_cannot_be_started_or_does_not_come_is_reported() {
    let missing = json!({"name": "process", "command": ["/no/such/pilot"]});
    run(&missing, &[("scenarios", "1")])
        .says(1, &["cannot start the driver: there is no program `/no/such/pilot`; correct `command`"]);
    let absent = json!({"name": "process", "exchange": "absent", "start_seconds": 0.5});
    let run = self::run(&absent, &[("scenarios", "1")]);
    run.says(
        1,
        &[
            "no driver is at the exchange `absent`, which was waited for 0.5 s",
            "exchange=\"absent\")",
            "`command`",
        ],
    );
}

/// One that was made for another form of the exchange cannot open it, be that by the type of an answer or by its size.
#[test]
fn another_version_of_the_library_is_reported() {
    if !python() {
        return;
    }
    for (payload, says) in
        [("ctypes.c_uint64", "Incompatible"), ("iceoryx2.Slice[ctypes.c_uint8]", "Incompatible")]
    {
        let folder = temp();
        let script = folder.path().join("other.py");
        let source = format!(
            r#"
import ctypes, os, iceoryx2
iceoryx2.set_log_level(iceoryx2.LogLevel.Fatal)
config = iceoryx2.config.from_file(iceoryx2.FilePath.new(os.environ["PDK_EXCHANGE"] + "/iceoryx2.toml"))
node = iceoryx2.NodeBuilder.new().config(config).create(iceoryx2.ServiceType.Ipc)
service = node.service_builder(iceoryx2.ServiceName.new("pdk/answer")).publish_subscribe({payload}).open()
# It would send 100 MB.
service.publisher_builder().initial_max_slice_len(100_000_000).create()
"#
        );
        std::fs::write(&script, source).unwrap();
        let run = run(
            &json!({"name": "process", "command": ["python3", script], "start_seconds": 30}),
            &[("scenarios", "1")],
        );
        run.says(1, &["the driver `python3", "other.py` ended (exit status: 1), and wrote last:", says]);
        assert_eq!((run.causes(), run.kind()), (vec!["error"], "lost"));
    }
}

fn shared(bus: &BusFolder, folder: &Path, fault: &str) -> Child {
    pilot(folder, fault);
    let (variable, place) = bus.variable();
    Command::new("python3")
        .arg(folder.join("pilot.py"))
        .args([fault, folder.join("mark").to_str().unwrap(), "shared"])
        .env(variable, place)
        .env("PYTHONPATH", repository().join("sdk/python"))
        .spawn()
        .unwrap()
}

/// Ends them, and waits until they are gone.
fn end(drivers: impl IntoIterator<Item = Child>) {
    for mut driver in drivers {
        // It may have ended by itself.
        let _ = driver.kill();
        driver.wait().unwrap();
    }
}

#[test]
fn two_at_once_are_reported() {
    if !python() {
        return;
    }
    let (folder, bus) = (temp(), BusFolder::new());
    let drivers = [0, 1].map(|_| shared(&bus, folder.path(), "none"));
    // Both are there: each leaves a mark, and then connects as soon as there is a run.
    let begun = || drivers.iter().all(|driver| folder.path().join(format!("mark-{}", driver.id())).exists());
    assert!(comes_true(LIMIT, begun));
    let driver = json!({"name": "process", "exchange": "shared"}).to_string();
    let out = folder.path().join("out");
    let (variable, place) = bus.variable();
    let finished = Pdk::new(["run", "--workers", "1", "--out"])
        .arg(&out)
        .arg(pipeline(folder.path(), SOURCE))
        .set("driver", driver)
        // So many that both have connected before the last one.
        .set("scenarios", 40)
        .env(variable, place)
        .run();
    end(drivers);
    assert_eq!(finished.code, Some(1), "{}", finished.stderr);
    let says = "two programs answer as the driver of the exchange `shared`; end one of them";
    assert!(finished.stderr.contains(says), "{}", finished.stderr);
    let lines = json_lines(&out.join("scenarios.jsonl"));
    assert!(lines.iter().any(|line| line["error_kind"] == "nonsense"), "{lines:?}");
    assert!(bus.left().is_empty(), "{:?}", bus.left());
}

#[test]
fn one_that_comes_back_serves_what_follows() {
    if !python() {
        return;
    }
    let (folder, bus) = (temp(), BusFolder::new());
    let mut first = shared(&bus, folder.path(), "die");
    let driver = json!({"name": "process", "exchange": "shared", "answer_seconds": 2}).to_string();
    let out = folder.path().join("out");
    let (variable, place) = bus.variable();
    let mut run = Pdk::new(["run", "--workers", "1", "--out"])
        .arg(&out)
        .arg(pipeline(folder.path(), SOURCE))
        .set("driver", driver)
        .env(variable, place)
        .spawn();
    assert_eq!(ended_within(&mut first, LIMIT).unwrap().code(), Some(3));
    wait_for_scenarios(&mut run, &out, 1);
    let second = shared(&bus, folder.path(), "die");
    let status = ended_within(&mut run, LIMIT);
    end([first, second]);
    assert_eq!(status.unwrap().code(), Some(1));
    // The scenario in which it died has that outcome, and the next one waited until it was back.
    let lines = json_lines(&out.join("scenarios.jsonl"));
    let causes: Vec<_> = lines.iter().map(|line| line["cause"].as_str().unwrap()).collect();
    assert_eq!(causes, ["error", "time_out"], "{lines:?}");
    assert_eq!((&lines[0]["error_kind"], &lines[0]["frames"]), (&json!("late"), &json!(10)));
    assert!(bus.left().is_empty(), "{:?}", bus.left());
}

#[test]
fn one_that_runs_already_serves_all_workers() {
    if !python() {
        return;
    }
    let (folder, bus) = (temp(), BusFolder::new());
    let driver = shared(&bus, folder.path(), "none");
    let (variable, place) = bus.variable();
    let out = folder.path().join("out");
    let command = Pdk::new(["run", "--workers", "2", "--out"]).arg(&out).arg(pipeline(folder.path(), SOURCE));
    let command = command.set("driver", json!({"name": "process", "exchange": "shared"})).set("scenarios", 4);
    let finished = command.env(variable, place).run();
    end([driver]);
    assert_eq!(finished.code, Some(0), "{}", finished.stderr);
    assert_eq!(json_lines(&out.join("scenarios.jsonl")).len(), 4);
}

#[test]
fn the_examples_drive() {
    if !python() {
        return;
    }
    for example in ["function.py", "model.py"] {
        let script = repository().join("sdk/python/examples").join(example);
        let run = run(&json!({"name": "process", "command": ["python3", script]}), &[]);
        assert_eq!(run.finished.code, Some(0), "{example}: {}", run.finished.stderr);
    }
}

/// The program that this source in C++ makes; none if there is no compiler.
fn compiled(folder: &Path, source: &Path) -> Option<PathBuf> {
    let compiler = Command::new("c++").arg("--version").stdout(Stdio::null()).status();
    if !compiler.is_ok_and(|status| status.success()) {
        eprintln!("skipped: there is no c++");
        return None;
    }
    let (library, target, pilot) =
        (repository().join("sdk/pdk-driver-c"), target_folder(), folder.join("pilot"));
    let compiled = Command::new("c++")
        .args(["-O2", "-Wall", "-Wextra", "-Werror", "-I"])
        .arg(library.join("include"))
        .arg(source)
        .arg("-L")
        .arg(&target)
        .arg("-lpdkdriver")
        .arg(format!("-Wl,-rpath,{}", target.display()))
        .arg("-o")
        .arg(&pilot)
        .status()
        .unwrap();
    assert!(compiled.success());
    Some(pilot)
}

/// A driver in C++ that ends at its fifth frame, unless there is a file that says that it has done so once.
const FRAGILE: &str = r#"
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include "pdk_driver.h"

int main(int, char **arguments) {
    pdk_driver *driver = pdk_driver_open(nullptr);
    pdk_frame frame;
    for (int number = 0; driver != nullptr && pdk_driver_next(driver, &frame) == 1; ++number) {
        if (number == 4 && !std::ifstream(arguments[1])) {
            std::ofstream{arguments[1]};
            std::exit(3);
        }
        pdk_driver_answer(driver, number % 2 == 0 ? 0.1 : -0.1, 0.2);
    }
    return 0;
}
"#;

#[test]
fn one_that_ends_at_a_frame_of_a_recording_is_started_again_for_the_next() {
    let folder = temp();
    let source = folder.path().join("fragile.cpp");
    std::fs::write(&source, FRAGILE).unwrap();
    let Some(pilot) = compiled(folder.path(), &source) else { return };
    datasets::folder(&folder.path().join("data"), 12, 32, 24);
    let source = r#"
        local settings = pdk.settings({ data = "", driver = { name = "process" } })
        local request = { dataset = settings.data, driver = settings.driver, perturbations = { "contrast" }, levels = { 1 }, trust = true }
        local result = pdk.evaluate(request)
        assert(result.frames == 11, `{result.frames} frames`)
        -- The same worker starts the program once more for a drive, and then again for a recording.
        pdk.drive({
            simulator = { name = "lane", width = 64, height = 48 }, driver = settings.driver, duration = 0.2, scenarios = { {} },
        })
        result = pdk.evaluate(request)
        assert(result.frames == 12, `{result.frames} frames`)
    "#;
    let driver = json!({"name": "process", "command": [pilot, folder.path().join("mark")]}).to_string();
    let data = folder.path().join("data").display().to_string();
    let run = tried::run(source, &[("driver", &driver), ("data", &data)]);
    assert_eq!(run.finished.code, Some(0), "{}", run.finished.stderr);
    assert_eq!(run.causes(), ["time_out"]);
    assert!(run.finished.stderr.contains("ended (exit status: 3)"), "{}", run.finished.stderr);
}

/// The topics of a program are not those of the run, and the process that made them cannot remove them.
#[test]
fn nothing_is_left_of_one_whose_perturbation_ends_the_process() {
    let (folder, bus) = (temp(), BusFolder::new());
    let source = folder.path().join("fragile.cpp");
    std::fs::write(&source, FRAGILE).unwrap();
    let Some(pilot) = compiled(folder.path(), &source) else { return };
    std::fs::write(folder.path().join("mark"), "").unwrap();
    let script = pipeline(
        folder.path(),
        r#"
        pdk.drive({
            simulator = { name = "lane", width = 64, height = 48 }, duration = 1,
            driver = { name = "process", command = pdk.settings({ command = {} }).command },
            scenarios = { { perturbations = { { name = "misbehave", level = 1, how = "abort_in_apply", at = 5 } } } },
        })
        "#,
    );
    let (variable, place) = bus.variable();
    let finished = Pdk::new(["run", "--workers", "1", "--out"])
        .arg(folder.path().join("out"))
        .arg(script)
        .set("command", json!([pilot, folder.path().join("mark")]))
        .env(variable, place)
        .misbehave()
        .run();
    assert!(finished.stderr.contains("SIGABRT"), "{}", finished.stderr);
    assert!(comes_true(LIMIT, || bus.processes().is_empty()), "{:?}", bus.processes());
    assert!(bus.left().is_empty(), "{:?}", bus.left());
}

#[test]
fn a_driver_in_cpp_drives() {
    let folder = temp();
    let example = repository().join("sdk/pdk-driver-c/example/pilot.cpp");
    let Some(pilot) = compiled(folder.path(), &example) else { return };
    let run = run(&json!({"name": "process", "command": [pilot]}), &[]);
    assert_eq!(run.finished.code, Some(0), "{}", run.finished.stderr);
    assert_eq!(run.lines.len(), 2);
    assert_eq!(run.lines[0]["frames"], 21);
}
