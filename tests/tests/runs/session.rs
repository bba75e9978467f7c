//! Pipelines that are programs in other languages: they come out as those in Lua, and mistakes, signals and sudden ends are said.

use std::collections::BTreeSet;
use std::io::{BufRead, BufReader, Write};
use std::path::Path;
use std::process::Stdio;

use pdk_tests::process::{LIMIT, json_lines, pipeline};
use pdk_tests::processes::{BusFolder, comes_true, ended_within, signal_taken};
use pdk_tests::records::{partial, trace};
use pdk_tests::{Finished, Pdk, built, temp};
use rustix::process::{Pid, Signal, kill_process};
use serde_json::{Value, json};

const SHARED: &str = r#"{"simulator":{"width":160,"name":"lane","height":120.0},"driver":"lane_keeper","duration":2.0,"images_every":10}"#;

/// What standard output says, a message each.
fn told(finished: &Finished) -> Vec<Value> {
    finished.stdout.lines().map(|line| serde_json::from_str(line).unwrap()).collect()
}

fn session(out: &Path, calls: &[Value]) -> Pdk {
    let input: String = calls.iter().map(|call| format!("{call}\n")).collect();
    Pdk::new(["session", "--seed", "3", "--workers", "2", "--out"]).arg(out).input(&input)
}

/// The lines of a ledger as they are written.
fn lines(out: &Path) -> BTreeSet<String> {
    let text = std::fs::read_to_string(out.join("scenarios.jsonl")).unwrap();
    text.lines().map(str::to_owned).collect()
}

#[test]
fn a_program_records_what_a_script_records() {
    let folder = temp();
    let script = pipeline(
        folder.path(),
        r#"
        local scenarios = {}
        for number = 1, 6 do
            table.insert(scenarios, {
                road = { angles = { 0, number, -number }, segment = 20 }, perturbations = { { name = "fog_filter", level = number / 2 } },
                failure = { lane_departure = 3 },
            })
        end
        pdk.drive({
            simulator = { name = "lane", width = 160, height = 120 }, driver = "lane_keeper", duration = 2, images_every = 10,
            scenarios = scenarios,
        })
        "#,
    );
    let (lua, other) = (folder.path().join("lua"), folder.path().join("other"));
    Pdk::new(["run", "--seed", "3", "--out"]).arg(&lua).arg(script).succeed();
    // In another order, with other keys first and other ways to write numbers.
    let scenario = |number: u32| {
        let number = f64::from(number);
        json!({
            "perturbations": [{"level": number / 2.0, "name": "fog_filter"}], "failure": {"lane_departure": 3.0},
            "road": {"segment": 20.0, "angles": [-0.0, number, -number]},
        })
    };
    let all: Vec<Value> = (1..=6).rev().map(scenario).collect();
    let shared: Value = serde_json::from_str(SHARED).unwrap();
    let finished =
        session(&other, &[json!({"defaults": shared}), json!({"submit": all}), json!({"end": {}})]).succeed();
    assert_eq!((lines(&lua).len(), lines(&lua)), (6, lines(&other)));
    for line in json_lines(&lua.join("scenarios.jsonl")) {
        assert_eq!(std::fs::read(trace(&lua, &line)).unwrap(), std::fs::read(trace(&other, &line)).unwrap());
    }
    let messages = told(&finished);
    assert_eq!(messages[0]["ready"]["slots"], 2);
    assert!(messages.contains(&json!({"returned": [1, 2, 3, 4, 5, 6]})), "{messages:?}");
    let end = &messages.last().unwrap()["end"];
    assert_eq!((end["failure"].is_null(), end["summary"]["outcomes"].as_array().unwrap().len()), (true, 6));
}

#[test]
fn calls_are_answered_in_order_and_a_mistake_costs_nothing_but_its_call() {
    let folder = temp();
    let out = folder.path().join("out");
    let shared: Value = serde_json::from_str(SHARED).unwrap();
    let calls = [
        json!({"settings": {"level": 1}}),
        json!({"defaults": {"simulater": "lane"}}),
        json!({"defaults": shared}),
        json!({"submit": [{"lenght": 1}]}),
        json!({"what": 1}),
        json!({"submit": [{"name": "a"}, {"name": "b", "seed": (1_u64 << 53) - 1}]}),
        json!({"next": {}}),
        json!({"next": {}}),
        json!({"next": {}}),
        json!({"wait": 2}),
        json!({"wait": 3}),
        json!({"save": {"name": "x.json", "value": {"b": 1.0, "a": 2}}}),
        json!({"road": {"angles": [0, 10, -10]}}),
        json!({"rate": "lane"}),
        json!({"catalog": {}}),
        json!({"end": {}}),
    ];
    let finished = session(&out, &calls).set("level", 7).succeed();
    let answers: Vec<Value> = told(&finished)
        .into_iter()
        .filter(|message| message.get("returned").or(message.get("failed")).is_some())
        .collect();
    assert_eq!(answers.len(), calls.len() - 1, "{answers:?}");
    let failed = |number: usize, says: &str| {
        let message = answers[number]["failed"]["message"].as_str().unwrap_or_default();
        assert!(message.contains(says), "{}", answers[number]);
    };
    assert_eq!(answers[0], json!({"returned": {"level": 7}}));
    failed(1, "there is no field `simulater`; did you mean `simulator`?");
    failed(3, "scenario 0: there is no field `lenght`");
    failed(4, "what came is not a call");
    assert_eq!(answers[5], json!({"returned": [1, 2]}));
    let names: BTreeSet<&str> = (6..8).map(|n| answers[n]["returned"]["name"].as_str().unwrap()).collect();
    assert_eq!(names, BTreeSet::from(["a", "b"]));
    assert_eq!(answers[8], json!({"returned": null}));
    assert_eq!(answers[9]["returned"]["name"], "b");
    failed(10, "wait takes a ticket that was given for a scenario, not 3");
    assert_eq!(answers[13], json!({"returned": 20.0}));
    assert!(answers[14]["returned"].as_array().unwrap().len() > 50);
    assert_eq!(json_lines(&out.join("scenarios.jsonl"))[1]["scenario"]["seed"], (1_u64 << 53) - 1);
}

#[test]
fn a_key_that_occurs_twice_and_a_seed_that_is_too_large_are_refused() {
    let folder = temp();
    let input = format!(
        "{}\n{}\n{}\n{}\n",
        r#"{"submit":[{"simulator":"lane","driver":"lane_keeper","duration":1,"duration":2}]}"#,
        r#"{"submit":[{"simulator":{"name":"lane","width":64,"width":128},"driver":"lane_keeper"}]}"#,
        r#"{"submit":[{"simulator":"lane","driver":"lane_keeper","seed":9007199254740992}]}"#,
        r#"{"end":{}}"#
    );
    let finished = Pdk::new(["session"]).input(&input).folder(folder.path()).succeed();
    let said: Vec<String> = told(&finished)
        .iter()
        .filter_map(|message| message["failed"]["message"].as_str().map(str::to_owned))
        .collect();
    assert_eq!(said.len(), 3, "{said:?}");
    assert!(said[0].contains("the key `duration` occurs twice"), "{said:?}");
    assert!(said[1].contains("the key `width` occurs twice"), "{said:?}");
    assert!(said[2].contains("scenario 0: `seed` is 9007199254740992, but has to be"), "{said:?}");
    assert!(!folder.path().join("runs").exists());
}

/// Equal scenarios are driven once, and their outcomes are handed out one by one.
#[test]
#[ignore = "long: .ci/run runs it"]
fn very_many_equal_scenarios_are_ended_by_a_signal() {
    const COUNT: usize = 300_000;
    let folder = temp();
    let out = folder.path().join("out");
    let mut command = std::process::Command::new(built("pdk"));
    command.args(["session", "--workers", "1", "--out"]).arg(&out);
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::null());
    let mut child = command.spawn().unwrap();
    let mut input = child.stdin.take().unwrap();
    let shared = r#"{"defaults":{"simulator":{"name":"lane","width":64,"height":48},"driver":"lane_keeper","duration":0.3}}"#;
    writeln!(input, "{shared}\n{{\"submit\":[{}{{}}]}}\n{{\"end\":{{}}}}", "{},".repeat(COUNT - 1)).unwrap();
    let mut output = BufReader::new(child.stdout.take().unwrap());
    let mut line = String::new();
    while !line.starts_with(r#"{"returned":[1,2,3,"#) {
        line.clear();
        assert!(output.read_line(&mut line).unwrap() > 0, "the scenarios were not submitted");
    }
    kill_process(Pid::from_child(&child), Signal::TERM).unwrap();
    // What it says from here on is of no interest, but has to be read.
    let rest = std::thread::spawn(move || std::io::copy(&mut output, &mut std::io::sink()));
    let ended = ended_within(&mut child, LIMIT);
    if ended.is_none() {
        child.kill().unwrap();
    }
    rest.join().unwrap().unwrap();
    assert_eq!(ended.expect("it has not ended").code(), Some(143));
}

#[test]
fn a_program_that_is_gone_takes_its_run_along() {
    let folder = temp();
    let bus = BusFolder::new();
    let (variable, value) = bus.variable();
    let out = folder.path().join("out");
    let shared: Value = serde_json::from_str(SHARED).unwrap();
    let long = json!({"submit": [{"duration": 600, "mode": "realtime"}]});
    let finished = session(&out, &[json!({"defaults": shared}), long]).env(variable, value).run();
    assert_eq!(finished.code, Some(1), "{}", finished.stderr);
    assert!(finished.stderr.contains("the run was interrupted"), "{}", finished.stderr);
    assert!(comes_true(LIMIT, || bus.processes().is_empty()), "{:?}", bus.processes());
    assert!(bus.left().is_empty(), "{:?}", bus.left());
    // The same for a pipeline in Lua.
    let script = pipeline(
        folder.path(),
        "pdk.drive({ simulator = 'lane', driver = 'lane_keeper', mode = 'realtime', duration = 600, scenarios = { {} } })",
    );
    let finished = Pdk::new(["session"]).arg(script).env(variable, value).folder(folder.path()).run();
    assert_eq!(finished.code, Some(1), "{}", finished.stderr);
}

#[test]
fn ctrl_c_lets_what_is_under_way_finish() {
    let folder = temp();
    let out = folder.path().join("out");
    let mut command = std::process::Command::new(built("pdk"));
    command.args(["session", "--workers", "1", "--out"]).arg(&out);
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let mut child = command.spawn().unwrap();
    let mut input = child.stdin.take().unwrap();
    let mut output = BufReader::new(child.stdout.take().unwrap()).lines();
    let mut ask = |call: Value| {
        writeln!(input, "{call}").unwrap();
        let mut messages = output.by_ref().map(|line| serde_json::from_str::<Value>(&line.unwrap()).unwrap());
        messages
            .find(|message| ["returned", "failed", "end"].iter().any(|kind| message.get(kind).is_some()))
            .unwrap()
    };
    let scenario = |repeat: u32| json!({"simulator": "lane", "driver": "lane_keeper", "mode": "realtime", "duration": 2, "repeat": repeat});
    let submitted = ask(json!({"submit": [scenario(0), scenario(1), scenario(2)]}));
    assert_eq!(submitted, json!({"returned": [1, 2, 3]}));
    assert!(comes_true(LIMIT, || !partial(&out.join("traces")).is_empty()), "nothing is under way");
    signal_taken(&child, Signal::INT);
    let refused = ask(json!({"wait": 3}));
    let end = ask(json!({"end": {}}));
    for failure in [&refused["failed"], &end["end"]["failure"]] {
        assert!(failure["message"].as_str().unwrap().contains("interrupted"), "{refused} {end}");
    }
    assert_eq!(ended_within(&mut child, LIMIT).unwrap().code(), Some(130));
    // On a busy machine the second one may have begun before the signal.
    let driven = json_lines(&out.join("scenarios.jsonl")).len();
    assert!((1..3).contains(&driven), "{driven}");
}

#[test]
fn a_pipeline_in_lua_is_sent_line_by_line() {
    let folder = temp();
    let script = pipeline(
        folder.path(),
        "local outcomes = pdk.drive({ simulator = 'lane', driver = 'lane_keeper', duration = 1, scenarios = { {} } })
         pdk.show(outcomes)
         pdk.table({ 'a' }, { { 'b\\27[2Jc' } })
         pdk.drive({ simulator = 'lane', driver = 'absent', scenarios = { {} } })",
    );
    // Its input stays open, as that of a program that is there.
    let (input, _open) = std::io::pipe().unwrap();
    let finished =
        Pdk::new(["session", "--out"]).arg(folder.path().join("out")).arg(script).stdin(input).run();
    let messages = told(&finished);
    assert!(
        messages.iter().any(|message| message["text"].as_str().is_some_and(|text| text.contains("nominal")))
    );
    assert!(messages.iter().any(|message| message["progress"]["frames"] == 21), "{messages:?}");
    // What a terminal would obey is shown.
    let told = |part: &str| {
        messages.iter().any(|message| message["text"].as_str().is_some_and(|text| text.contains(part)))
    };
    assert!(told("b\\u{1b}[2Jc") && !told("\u{1b}"), "{messages:?}");
    let end = &messages.last().unwrap()["end"];
    assert!(end["failure"]["message"].as_str().unwrap().contains("there is no driver `absent`"), "{end}");
    assert_eq!(json_lines(&folder.path().join("out/scenarios.jsonl")).len(), 1);
}
