//! A record that comes from elsewhere does not choose what runs on this machine.

use std::fs;
use std::path::{Path, PathBuf};

use pdk_model::component::ComponentSpec;
use pdk_tests::process::pipeline;
use pdk_tests::{Pdk, records, temp, test_library};
use serde_json::{Value, json};

/// A record of a drive that fails.
fn record(folder: &Path, more: impl FnOnce(Pdk) -> Pdk, simulator: &str) -> PathBuf {
    let source = format!(
        r#"pdk.drive({{ simulator = {simulator}, driver = "misbehave", duration = 20,
            scenarios = {{ {{ road = {{ angles = {{ 0, 40, 40 }}, segment = 15 }} }} }} }})"#
    );
    let out = folder.join("record");
    more(Pdk::new(["run", "--out"]).arg(&out).arg(pipeline(folder, &source))).succeed();
    out
}

const LANE: &str = r#"{ name = "lane", width = 80, height = 60, rate = 20 }"#;

fn component(name: &str, parameters: &Value) -> ComponentSpec {
    serde_json::from_value(json!({ "name": name, "parameters": parameters })).unwrap()
}

#[test]
fn no_program_is_started_without_the_users_word() {
    let folder = temp();
    let (original, mark) = (record(folder.path(), Pdk::misbehave, LANE), folder.path().join("mark"));
    let clip = folder.path().join("clip.mp4");
    let cases = [
        ("driver", "process", "command", json!({ "command": ["touch", mark], "start_seconds": 2 })),
        ("simulator", "process", "command", json!({ "command": ["touch", mark], "start_seconds": 2 })),
        (
            "simulator",
            "donkey",
            "launch",
            json!({ "launch": ["touch", mark], "start_seconds": 2, "build": "road_generating" }),
        ),
    ];
    for (kind, name, parameter, parameters) in cases {
        let out = folder.path().join(format!("{kind}-{name}"));
        for (path, bytes) in records::files(&original) {
            fs::create_dir_all(out.join(&path).parent().unwrap()).unwrap();
            fs::write(out.join(path), bytes).unwrap();
        }
        records::change_scenario(&out, 0, |scenario| match kind {
            "driver" => scenario.driver = component(name, &parameters),
            _ => scenario.simulator = component(name, &parameters),
        });
        let program =
            format!("the program [\"touch\",\"{}\"], `{parameter}` of the {kind} `{name}`", mark.display());
        let parts = ["would have this run with your rights", &program, "--trust"];
        let replay = || Pdk::new(["replay"]).arg(&out).misbehave();
        replay().fail(1, &parts);
        replay().arg("--clip").arg(&clip).fail(1, &parts);
        Pdk::new(["shrink", "--scenario", "0", "--out"])
            .arg(folder.path().join("failure.lua"))
            .arg(&out)
            .misbehave()
            .fail(1, &parts);
        Pdk::new(["report", "--out"]).arg(folder.path().join("page.html")).arg(&out).succeed();
        Pdk::new(["report", "--saliency", "--out"]).arg(folder.path().join("page.html")).arg(&out).run();
        assert!(!mark.exists(), "{kind} {name} was started");
        let trusted = replay().arg("--trust").run();
        assert!(
            trusted.stderr.contains(&format!("the record has this run: {program}")),
            "{}",
            trusted.stderr
        );
        assert!(mark.exists(), "{kind} {name} was not started: {}", trusted.stderr);
        fs::remove_file(&mark).unwrap();
    }
}

#[test]
fn no_library_is_opened_that_was_not_opened_before() {
    let folder = temp();
    let theirs = folder.path().join("theirs");
    fs::create_dir(&theirs).unwrap();
    let library = theirs.join("libtheirs.so");
    fs::copy(test_library("misbehave"), &library).unwrap();
    let [here, elsewhere] = ["here", "elsewhere"].map(|name| folder.path().join(name));
    let out = record(folder.path(), |run| run.env("PDK_CACHE", &here).arg("--plugins").arg(&theirs), LANE);
    let replay = |cache: &Path| Pdk::new(["replay"]).arg(&out).env("PDK_CACHE", cache);
    // Whoever has made the record has opened it.
    replay(&here).succeed();
    let asked = format!("the library {}", library.display());
    let whom = format!("{asked}, for the driver `misbehave`");
    let parts = ["would have this run with your rights", &whom, "--trust", "--plugins"];
    replay(&elsewhere).fail(1, &parts);
    Pdk::new(["shrink", "--scenario", "0"]).arg(&out).env("PDK_CACHE", &elsewhere).fail(1, &parts);
    Pdk::new(["report"]).arg(&out).env("PDK_CACHE", &elsewhere).succeed();
    let notes = fs::read_dir(elsewhere.join("inspected-plugins")).unwrap();
    let notes: Vec<_> = notes.map(|note| fs::read_to_string(note.unwrap().path()).unwrap()).collect();
    assert!(!notes.is_empty());
    assert!(!notes.iter().any(|note| note.contains("libtheirs.so")), "it was opened: {notes:?}");
    let third = folder.path().join("third");
    replay(&third).arg("--plugins").arg(&theirs).succeed();
    let trusted = replay(&elsewhere).arg("--trust").succeed();
    assert!(trusted.stderr.contains(&format!("the record has this run: {whom}")), "{}", trusted.stderr);
    // Another one in its place, which this user has opened.
    let mut bytes = fs::read(&library).unwrap();
    bytes.push(0);
    fs::write(&library, bytes).unwrap();
    Pdk::new(["list", "--plugins"]).arg(&theirs).env("PDK_CACHE", &here).succeed();
    let parts =
        [&format!("{asked}, whose content is not the recorded one, for the driver `misbehave`"), "--trust"];
    replay(&here).fail(1, &parts);
    let trusted = replay(&here).arg("--trust").succeed();
    assert!(trusted.stderr.contains("the file of the driver `misbehave`"), "{}", trusted.stderr);
    // The folder that the record names is not searched: what lies there besides is not opened.
    fs::copy(test_library("misbehave"), &library).unwrap();
    Pdk::new(["list", "--plugins"]).arg(&theirs).env("PDK_CACHE", &third).succeed();
    fs::write(theirs.join("libother.so"), "no library").unwrap();
    let replayed = replay(&third).succeed();
    assert!(!replayed.stderr.contains("libother.so"), "{}", replayed.stderr);
}
