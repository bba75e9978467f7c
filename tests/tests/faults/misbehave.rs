//! Whatever a component does, the run goes on: other scenarios come out as if nothing had happened, and its own line says what
//! it did. `cargo test --release --test faults misbehave:: -- --nocapture` prints what is said about each way to go wrong.

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};

use pdk_tests::process::{json_file, json_lines, pipeline};
use pdk_tests::{Finished, Pdk, temp};
use serde_json::Value;

/// What is looked for in every line.
#[derive(Debug, Clone)]
enum Expected {
    /// The scenario is driven as if it behaved; where it sees and does the same as one that behaves, its digest is that one's.
    Driven { same: bool },
    /// The outcome is an error of this kind, whose sentence has these parts.
    Outcome(&'static str, Vec<String>),
    /// The component cannot be made, so the scenario is refused when it is submitted, with a sentence that has these parts.
    Refused(Vec<String>),
}

/// Somebody who goes wrong.
#[derive(Debug, Clone)]
struct Way {
    who: &'static str,
    how: String,
    expected: Expected,
}

impl Way {
    fn name(&self) -> String {
        format!("{} {}", self.who, self.how)
    }
}

/// The frame at which those misbehave that are called for frames.
const AT: u64 = 3;

/// Every function of a component that pdk calls: the name of what is called, as the plugin has it and as pdk names the call.
/// Size and rate of the camera are asked for when a simulator is made, and its waypoints when it is reset.
const FUNCTIONS: [(&str, &str, &str); 14] = [
    ("simulator", "new", "new"),
    ("simulator", "camera", "new"),
    ("simulator", "drop", "drop"),
    ("simulator", "reset", "reset"),
    ("simulator", "waypoints", "reset"),
    ("simulator", "frame", "frame"),
    ("simulator", "act", "act"),
    ("driver", "new", "new"),
    ("driver", "drop", "drop"),
    ("driver", "reset", "reset"),
    ("driver", "drive", "drive"),
    ("perturbation", "new", "new"),
    ("perturbation", "drop", "drop"),
    ("perturbation", "apply", "apply"),
];

/// Ways to go wrong in a function, with the kind of the error and what is said.
const ENDS: [(&str, &str, &str); 6] = [
    ("panic", "panic", "panicked"),
    ("abort", "lost", "was ended by signal 6 (SIGABRT, it aborted)"),
    ("segfault", "lost", "was ended by signal 11 (SIGSEGV, memory that it may not use)"),
    ("exit", "lost", "ended the process with exit code 0 (a component has to return an error"),
    ("quit", "lost", "ended the process with exit code 0 (a component has to return an error"),
    ("kill", "lost", "was ended by signal 9 (SIGKILL) (killed from outside, or because memory ran out)"),
];

/// These ways in every function.
fn in_every_function(ends: &[(&str, &'static str, &str)]) -> Vec<Way> {
    let mut ways = Vec::new();
    for (who, function, called) in FUNCTIONS {
        for &(end, kind, said) in ends {
            let at = if ["frame", "act", "drive", "apply"].contains(&function) {
                format!(" at frame {AT}")
            } else {
                String::new()
            };
            let parts = match end {
                // The plugin says itself where it was.
                "panic" => {
                    vec![format!("{who} `misbehave"), said.to_owned(), format!("as asked to in `{function}`")]
                }
                _ => vec![format!("{who} `misbehave"), format!("` in `{called}`{at} {said}")],
            };
            let expected = match function {
                // An instance that is kept is dropped when the scenario is over, which it cannot change, nor the next one.
                "drop" if end == "panic" || who != "perturbation" => Expected::Driven { same: true },
                _ => Expected::Outcome(kind, parts),
            };
            ways.push(Way { who, how: format!("{end}_in_{function}"), expected });
        }
    }
    ways
}

/// Drives good scenarios with bad ones between them, in one pipeline.
fn source(ways: &[Way]) -> String {
    let list: String = ways.iter().map(|way| format!("{{ '{}', '{}' }},\n", way.who, way.how)).collect();
    format!(
        r#"
        local settings = pdk.settings({{ bad = true }})
        local ways = {{ {list} }}
        local session = pdk.session({{ simulator = "misbehave", driver = "misbehave", duration = 2, images_every = 4 }})
        local refused = {{}}
        local function good(number)
            session:submit({{
                name = "good " .. number, ["repeat"] = number, duration = 0.5, perturbations = {{ "gaussian_noise@2" }},
                simulator = {{ name = "lane", width = 64, height = 48 }}, driver = "lane_keeper",
            }})
            session:submit({{ name = "behaving " .. number, ["repeat"] = number, perturbations = {{ "misbehave@1" }} }})
        end
        session:submit({{ name = "behave", perturbations = {{ "misbehave@1" }} }})
        for number, way in ways do
            good(number)
            if settings.bad then
                local component = {{ name = "misbehave", how = way[2], at = {AT} }}
                local scenario = {{ name = way[1] .. " " .. way[2], perturbations = {{ "misbehave@1" }} }}
                if way[1] == "perturbation" then
                    component.level = 1
                    scenario.perturbations = {{ component }}
                else
                    scenario[way[1]] = component
                end
                local fine, said = pcall(session.submit, session, scenario)
                if not fine then
                    refused[scenario.name] = tostring(said)
                end
            end
        end
        good(#ways + 1)
        while session:next() do
        end
        pdk.save("refused.json", {{ refused = refused }})
        "#
    )
}

/// What became of a pipeline.
struct Ran {
    finished: Finished,
    out: PathBuf,
}

fn run(folder: &Path, script: &Path, name: &str, set: &[(&str, &str)]) -> Ran {
    let out = folder.join(name);
    let mut command = Pdk::new(["run", "--out"]).arg(&out).arg(script).misbehave().set("workers", 2);
    for (key, value) in set {
        command = command.set(key, value);
    }
    Ran { finished: command.run(), out }
}

/// Drives all of these, and checks the messages, and that no other component was disturbed. Returns standard error.
fn drive(ways: &[Way], set: &[(&str, &str)]) -> String {
    let folder = temp();
    let script = pipeline(folder.path(), &source(ways));
    let undisturbed = run(folder.path(), &script, "undisturbed", &[set, &[("bad", "false")]].concat());
    assert_eq!(undisturbed.finished.code, Some(0), "{}", undisturbed.finished.stderr);
    let Ran { finished, out } = run(folder.path(), &script, "disturbed", set);

    let text = |out: &Path| fs::read_to_string(out.join("scenarios.jsonl")).unwrap();
    let (bad_text, good_text) = (text(&out), text(&undisturbed.out));
    let name = |line: &str| serde_json::from_str::<Value>(line).unwrap()["name"].as_str().unwrap().to_owned();
    let (bad, good): (Vec<&str>, Vec<&str>) =
        bad_text.lines().partition(|line| ways.iter().any(|way| way.name() == name(line)));
    assert_eq!(good, good_text.lines().collect::<Vec<_>>());
    assert_eq!(good.len(), 2 * ways.len() + 3);
    for line in &good {
        let id = serde_json::from_str::<Value>(line).unwrap()["id"].as_str().unwrap().to_owned();
        let trace = |out: &Path| fs::read(out.join(format!("traces/{id}.mcap"))).unwrap();
        assert!(trace(&out) == trace(&undisturbed.out), "the trace of {line} differs");
    }

    let lines: BTreeMap<String, Value> =
        bad.iter().map(|line| (name(line), serde_json::from_str(line).unwrap())).collect();
    let behaving: Value = serde_json::from_str(good[0]).unwrap();
    let refused = json_file(&out.join("refused.json"))["refused"].clone();
    let (mut table, mut wrong, mut failures) = (String::new(), Vec::new(), 0);
    for way in ways {
        let line = lines.get(&way.name()).cloned().unwrap_or_default();
        let refusal = refused.get(way.name()).and_then(Value::as_str);
        let (is_right, said) = judge(way, &line, refusal, &behaving);
        table += &format!("{:<34} {said}\n", way.name());
        failures += usize::from(line["cause"] == "error");
        if !is_right {
            wrong.push(format!("{}: expected {:?}, but: {said}\n  {line}", way.name(), way.expected));
        }
    }
    println!("{table}");
    assert!(wrong.is_empty(), "{}\n{}", wrong.join("\n"), last_lines(&finished.stderr));
    // Every trace of a line is there, and whole.
    for line in json_lines(&out.join("scenarios.jsonl")) {
        let trace = out.join(format!("traces/{}.mcap", line["id"].as_str().unwrap()));
        let bytes = fs::read(&trace).unwrap();
        mcap::MessageStream::new(&bytes).unwrap().for_each(|message| _ = message.unwrap());
    }
    let code = if failures == 0 { 0 } else { 1 };
    assert_eq!(finished.code, Some(code), "{}", last_lines(&finished.stderr));
    if failures > 0 {
        let said = format!(
            "{failures} of {} scenarios could not be driven because a component failed",
            lines.len() + good.len()
        );
        assert!(finished.stderr.contains(&said), "{}", last_lines(&finished.stderr));
    }
    assert!(!finished.stderr.contains("panicked at kernel"), "{}", last_lines(&finished.stderr));
    finished.stderr
}

/// Whether a line, or what was said when it was refused, is as expected; and what it says.
fn judge(way: &Way, line: &Value, refusal: Option<&str>, behaving: &Value) -> (bool, String) {
    let has_all = |text: &str, parts: &[String]| parts.iter().all(|part| text.contains(part));
    let error = line["error"].as_str().unwrap_or_default();
    match (&way.expected, refusal) {
        (Expected::Refused(parts), Some(refusal)) => (
            line.is_null() && has_all(refusal, parts),
            format!("refused: {}", refusal.lines().next().unwrap_or_default()),
        ),
        (Expected::Outcome(kind, parts), None) => {
            let right = line["cause"] == "error" && line["error_kind"] == *kind && has_all(error, parts);
            (right && line["success"] == false, format!("{kind}: {error}"))
        }
        (Expected::Driven { same }, None) => {
            let right = line["cause"] == "finished" && line["frames"] == behaving["frames"];
            (
                right && (!same || line["digest"] == behaving["digest"]),
                format!("driven: {} frames", line["frames"]),
            )
        }
        (_, refusal) => (false, format!("{} {error}{}", line["cause"], refusal.unwrap_or_default())),
    }
}

/// The end of what was written; some components print a lot.
fn last_lines(text: &str) -> &str {
    let start = text.len().saturating_sub(4000);
    text.get(start..).unwrap_or(text)
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn a_component_that_panics_or_ends_the_process_has_a_line_that_says_so() {
    drive(&in_every_function(&ENDS), &[]);
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn a_component_that_does_not_come_back_has_a_line_that_says_so() {
    // A worker that waits for what hangs has nothing to do, so there may be more of them.
    let set = [("patience", "3"), ("workers", "6")];
    drive(&in_every_function(&[("hang", "late", "has not come back for 3 s")]), &set);
}

#[test]
fn whatever_is_done_to_the_process_does_not_reach_the_next_scenario() {
    let mut ways = Vec::new();
    let everybody = ["simulator", "driver", "perturbation"];
    for who in everybody {
        for how in [
            "close_stdout",
            "block_signals",
            "change_directory",
            "change_locale",
            "change_rounding",
            "print_a_lot",
        ] {
            // What is computed in the very call is rounded otherwise.
            let same = how != "change_rounding";
            ways.push(Way { who, how: how.to_owned(), expected: Expected::Driven { same } });
        }
    }
    let stderr = drive(&ways, &[]);
    for changed in [
        "the working directory",
        "the locale",
        "which signals are blocked",
        "how floating-point numbers are rounded",
    ] {
        let said = format!("pdk: warning: a component changed {changed}, which was put back, 3 times");
        assert!(stderr.contains(&said), "no `{said}`: {}", last_lines(&stderr));
    }
    assert!(
        stderr.contains("a component closed standard input, output or error, 3 times"),
        "{}",
        last_lines(&stderr)
    );
    assert!(stderr.len() > 3 * 2 * 9_000_000, "{} bytes were printed", stderr.len());
}

#[test]
fn a_component_that_takes_too_much_memory_has_a_line_that_says_so() {
    let everybody = [("simulator", "frame"), ("driver", "drive"), ("perturbation", "apply")];
    let ways = everybody.map(|(who, function)| {
        let said = format!("` in `{function}` at frame {AT} took more than 300 MiB of memory (the limit is raised with --set memory=MIB)");
        Way { who, how: "eat_memory".to_owned(), expected: Expected::Outcome("lost", vec![format!("{who} `misbehave"), said]) }
    });
    drive(&ways, &[("memory", "300")]);
}

#[test]
fn whatever_cannot_be_is_refused_or_an_error() {
    let way = |who: &'static str, how: &str, expected: Expected| Way { who, how: how.to_owned(), expected };
    let camera = |how: &str, number: &str| {
        let parts = ["simulator `misbehave`", number, "out of range"].map(str::to_owned).to_vec();
        way("simulator", how, Expected::Refused(parts))
    };
    let nonsense = |who, how: &str, said: &str| {
        way(who, how, Expected::Outcome("nonsense", vec![format!("{who} `misbehave`"), said.to_owned()]))
    };
    let ways = [
        camera("no_camera", "0x0"),
        camera("endless_camera", "4294967295"),
        camera("slow_camera", "1e-300"),
        camera("fast_camera", "1e300"),
        nonsense("simulator", "no_number", "its z is NaN m, but has to be from -100000000 to 100000000 m"),
        nonsense("simulator", "infinite_speed", "its speed is inf m/s"),
        nonsense("simulator", "huge_speed", "its speed is 1e200 m/s, but has to be from -1000 to 1000 m/s"),
        nonsense("simulator", "huge_position", "its x is 1e308 m"),
        nonsense("simulator", "huge_error", "its cross track error is 1e308 m"),
        nonsense("simulator", "huge_heading", "its heading is -1e300 rad"),
        nonsense("simulator", "too_far", "its progress is 5.0, but has to be from 0 to 1"),
        nonsense("simulator", "before_the_start", "its progress is -1e300"),
        nonsense("simulator", "huge_time", "its time is 1e308 s"),
        nonsense("simulator", "time_jumps", "its time jumps from 0.1 to 100000.0 s"),
        nonsense("simulator", "time_falls", "its time falls from 0.1 to 0.0 s, in the state of frame 3"),
        nonsense("simulator", "stand_still", "its time advances from 0.0 to 0.0 s with a control"),
        nonsense("simulator", "babble", "answered with what cannot be read"),
        nonsense("driver", "babble", "answered with what cannot be read"),
        nonsense("driver", "no_number", "it steers NaN"),
        way("driver", "wild", Expected::Driven { same: false }),
        way("perturbation", "leave_pixels", Expected::Driven { same: false }),
        way("perturbation", "remember", Expected::Driven { same: false }),
        way("perturbation", "mutter", Expected::Driven { same: true }),
        way("perturbation", "panic_on_thread", Expected::Driven { same: true }),
    ];
    drive(&ways, &[]);
}

/// The ways of a dataset and a driver offline, with the function that is called and what is said.
const OFFLINE: [(&str, &str, &str); 13] = [
    ("dataset", "panic_in_read", "as asked to in `read`"),
    ("dataset", "abort_in_read", "dataset `misbehave` in `read` at frame 2 was ended by signal 6"),
    ("dataset", "segfault_in_read", "dataset `misbehave` in `read` at frame 2 was ended by signal 11"),
    (
        "dataset",
        "exit_in_name",
        "dataset `misbehave` in `name` at frame 2 ended the process with exit code 0",
    ),
    ("dataset", "kill_in_read", "dataset `misbehave` in `read` at frame 2 was ended by signal 9"),
    ("dataset", "hang_in_read", "dataset `misbehave` in `read` at frame 2 has not come back for 3 s"),
    ("driver", "panic_in_drive", "as asked to in `drive`"),
    ("driver", "abort_in_drive", "driver `misbehave` in `drive` at frame 2 was ended by signal 6"),
    ("driver", "segfault_in_drive", "driver `misbehave` in `drive` at frame 2 was ended by signal 11"),
    (
        "driver",
        "quit_in_drive",
        "driver `misbehave` in `drive` at frame 2 ended the process with exit code 0",
    ),
    ("driver", "kill_in_drive", "driver `misbehave` in `drive` at frame 2 was ended by signal 9"),
    ("driver", "hang_in_drive", "driver `misbehave` in `drive` at frame 2 has not come back for 3 s"),
    ("perturbation", "abort_in_apply", "in `apply` at frame 2 was ended by signal 6"),
];

/// Those that cannot even be made, or asked how many frames there are.
const NOT_MADE: [(&str, &str, &str); 6] = [
    ("dataset", "abort_in_new", "dataset `misbehave` in `new` was ended by signal 6"),
    ("dataset", "segfault_in_len", "dataset `misbehave` in `new` was ended by signal 11"),
    ("dataset", "exit_in_drop", "dataset `misbehave` in `drop` ended the process with exit code 0"),
    ("dataset", "hang_in_new", "dataset `misbehave` in `new` has not come back for 3 s"),
    ("driver", "panic_in_new", "as asked to in `new`"),
    ("driver", "hang_in_drop", "driver `misbehave` in `drop` has not come back for 3 s"),
];

#[test]
#[ignore = "long: .ci/run runs it"]
fn offline_a_frame_is_lost_and_the_others_are_evaluated() {
    lose_a_frame(&OFFLINE, &NOT_MADE, &[("patience", "3")]);
}

/// It may take its time: how long depends on what else the machine does.
#[test]
fn offline_a_driver_that_takes_too_much_memory_costs_a_frame() {
    let said = "driver `misbehave` in `drive` at frame 2 took more than 300 MiB";
    lose_a_frame(&[("driver", "eat_memory", said)], &[], &[("memory", "300")]);
}

/// Evaluates a driver on a dataset with each of these ways to lose a frame, and with those that make an evaluation impossible.
fn lose_a_frame(lost: &[(&str, &str, &str)], not_made: &[(&str, &str, &str)], settings: &[(&str, &str)]) {
    let folder = temp();
    let list: String =
        lost.iter().chain(not_made).map(|(who, how, _)| format!("{{ '{who}', '{how}' }},\n")).collect();
    let script = pipeline(
        folder.path(),
        &format!(
            r#"
            local ways = {{ {{ "dataset", "behave" }}, {list} {{ "dataset", "behave" }} }}
            local refused = {{}}
            for _, way in ways do
                local request = {{ dataset = {{ name = "misbehave" }}, driver = {{ name = "misbehave" }},
                    perturbations = {{ {{ name = "misbehave" }}, "gaussian_noise" }}, levels = {{ 1, 3 }} }}
                local component = request[way[1]] or request.perturbations[1]
                component.how = way[2]
                component.at = 2
                local fine, said = pcall(pdk.evaluate, request)
                if not fine then
                    refused[way[1] .. " " .. way[2]] = tostring(said)
                end
            end
            pdk.save("refused.json", {{ refused = refused }})
            "#
        ),
    );
    let ran = run(folder.path(), &script, "out", settings);
    assert_eq!(ran.finished.code, Some(0), "{}", last_lines(&ran.finished.stderr));
    let lines = json_lines(&ran.out.join("results.jsonl"));
    let evaluations = lost.len() + 2;
    let of = |number: usize| -> Vec<Value> {
        let mut lines: Vec<Value> =
            lines.iter().filter(|line| line["evaluation"] == number).cloned().collect();
        lines.iter_mut().for_each(|line| {
            line.as_object_mut().unwrap().remove("evaluation");
            // It has the parameters in it, among them the way to go wrong.
            line.as_object_mut().unwrap().remove("label");
        });
        lines
    };
    let good = of(0);
    assert_eq!(good.len(), 4 * 4);
    assert_eq!(of(evaluations - 1), good);
    assert!(of(evaluations).is_empty());
    for (number, (who, how, said)) in lost.iter().enumerate() {
        let found = of(number + 1);
        let bad: Vec<&Value> = found.iter().filter(|line| line["index"] == 2).collect();
        assert_eq!(bad.len(), 1, "{who} {how}: {bad:?}");
        let error = bad[0]["error"].as_str().unwrap_or_default();
        println!("{:<34} {error}", format!("{who} {how}"));
        assert!(error.contains(said), "{who} {how}: `{error}` does not say `{said}`");
        let others: Vec<&Value> = found.iter().filter(|line| line["index"] != 2).collect();
        assert_eq!(others, good.iter().filter(|line| line["index"] != 2).collect::<Vec<_>>(), "{who} {how}");
        assert!(ran.finished.stderr.contains(&format!("was left out: {error}")), "{who} {how}");
    }
    let refused = &json_file(&ran.out.join("refused.json"))["refused"];
    for (who, how, said) in not_made {
        let refusal = refused[format!("{who} {how}")].as_str().unwrap_or_default();
        println!("{:<34} refused: {}", format!("{who} {how}"), refusal.lines().next().unwrap_or_default());
        assert!(refusal.contains(said), "{who} {how}: `{refusal}` does not say `{said}`");
    }
    // Without any, the table of Lua is empty, which is a list in JSON.
    let count = refused.as_object().map_or(0, serde_json::Map::len);
    assert_eq!(count, not_made.len(), "{refused}");
}
