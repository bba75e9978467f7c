//! Gates on recordings: both drivers see the same blocks of frames.

use std::fs;
use std::path::{Path, PathBuf};

use pdk_gate::verdict::Verdict;
use pdk_tests::process::{json_file, json_lines, pipeline};
use pdk_tests::records::{assert_equal, files};
use pdk_tests::{Pdk, datasets, temp};

const SUITE: &str = r#"
name = "route"
version = 1
perturbations = ["contrast@0.5", "gaussian_noise"]
levels = [0]
nominal = 0.2

[[recording]]
dataset = "drive.mcap"
block = 8
warm_up = 2
steering_error = 0.05

[test]
tolerated = 0.4
ahead = 3
"#;

/// A driver that steers too little.
const LAZY: &str = "lane_keeper,gain=0.2";

/// A folder with a suite and a recording of a drive: the trace of a scenario with all its frames.
fn prepared(suite: &str) -> tempfile::TempDir {
    let folder = temp();
    let source = r#"
        pdk.drive({
            simulator = { name = "lane", width = 64, height = 48, rate = 10 }, driver = "lane_keeper", duration = 60, images_every = 1,
            scenarios = { { road = { angles = { 0, 20, -25, 30, -20, 25, -30, 20, -15, 20, -20, 25 }, segment = 12 }, seed = 1 } },
        })
    "#;
    let record = folder.path().join("drive");
    Pdk::new(["run", "--out"]).arg(&record).arg(pipeline(folder.path(), source)).succeed();
    let trace = fs::read_dir(record.join("traces")).unwrap().next().unwrap().unwrap().path();
    fs::rename(trace, folder.path().join("drive.mcap")).unwrap();
    fs::write(folder.path().join("route.toml"), suite).unwrap();
    folder
}

fn gate(folder: &Path, old: &str, new: &str, out: &str) -> Pdk {
    Pdk::new(["gate", old, new, "--suite", "route.toml", "--out", out]).folder(folder)
}

fn verify(folder: &Path, record: &str) -> Pdk {
    Pdk::new(["verify", record]).folder(folder)
}

#[test]
fn equal_drivers_pass_and_the_number_of_workers_changes_nothing() {
    let folder = prepared(SUITE);
    let at = |name: &str| folder.path().join(name);
    let ran =
        gate(folder.path(), "lane_keeper", "lane_keeper,gain=1", "one").args(["--workers", "1"]).succeed();
    let last = ran.stdout.lines().last().unwrap();
    assert!(
        last.starts_with("passed: lane_keeper,gain=1 against lane_keeper in suite route version 1"),
        "{last}"
    );
    assert!(last.ends_with(" blocks"), "{last}");
    let verdict = json_file(&at("one/verdict.json"));
    let entries = verdict["entries"].as_array().unwrap();
    assert!(entries.iter().all(|entry| entry["cause"] == "kept" || entry["cause"] == "off"), "{entries:?}");
    // A line for each entry. Both drivers have the luck of the block, and no block is drawn twice.
    let lines = json_lines(&at("one/blocks.jsonl"));
    assert_eq!(lines.len(), entries.len());
    let mut starts: Vec<u64> = Vec::new();
    for pair in lines.chunks(2) {
        let scenario = |place: usize| &pair[place]["scenario"];
        for field in ["seed", "road", "perturbations"] {
            assert_eq!(scenario(0)[field], scenario(1)[field]);
        }
        starts.push(scenario(0)["road"]["start"].as_u64().unwrap());
    }
    let in_order = starts.is_sorted();
    starts.sort_unstable();
    assert!(starts.windows(2).all(|pair| pair[0] < pair[1]) && !in_order, "{starts:?}");
    gate(folder.path(), "lane_keeper", "lane_keeper,gain=1", "three").args(["--workers", "3"]).succeed();
    assert_equal(&at("three"), &files(&at("one")));
    // The same command continues a gate that was ended in the middle of a line.
    let text = fs::read_to_string(at("three/blocks.jsonl")).unwrap();
    fs::write(at("three/blocks.jsonl"), &text[..text.len() / 2]).unwrap();
    fs::remove_file(at("three/verdict.json")).unwrap();
    let again = gate(folder.path(), "lane_keeper", "lane_keeper,gain=1", "three").succeed();
    assert!(again.stdout.contains(" blocks were in a record already"), "{}", again.stdout);
    assert_equal(&at("three"), &files(&at("one")));
}

#[test]
fn a_worse_driver_fails_and_what_failed_can_be_repeated() {
    let folder = prepared(SUITE);
    let at = |name: &str| folder.path().join(name);
    let ran = gate(folder.path(), "lane_keeper", LAZY, "out")
        .args(["--markdown", "a.md", "--junit", "a.xml", "--save-suite", "never_again.toml", "--json"])
        .run();
    assert_eq!(ran.code, Some(3), "{}{}", ran.stdout, ran.stderr);
    let found = ran.json();
    assert_eq!(found["verdict"]["decision"]["findings"][0]["state"], "not_met");
    let failures = found["new_failures"].as_array().unwrap();
    let failure = &failures[0];
    assert_eq!(failure["cause"], "off");
    assert!(failure["said"].as_str().unwrap().starts_with("steering off by 0."), "{failure}");
    let command = failure["replay"].as_str().unwrap();
    let words: Vec<&str> = command.split(' ').skip(1).collect();
    let repeated = Pdk::new(words).folder(folder.path()).succeed();
    assert!(
        repeated.stdout.contains("1 of ") && repeated.stdout.contains("came out the same"),
        "{}",
        repeated.stdout
    );
    assert!(fs::read_to_string(at("a.md")).unwrap().contains(command));
    assert!(
        fs::read_to_string(at("a.xml")).unwrap().contains("<failure type=\"not met\" message=\"worse\">")
    );
    // What failed has to pass from now on: the old driver does, the new one does not.
    let again = |driver: &str, out: &str| {
        Pdk::new(["gate", "lane_keeper", driver, "--suite", "never_again.toml", "--out", out])
            .folder(folder.path())
            .run()
    };
    let passed = again("lane_keeper,gain=1", "passed");
    assert!(
        passed.code == Some(0) && passed.stdout.contains("passes all fixed scenarios"),
        "{}",
        passed.stdout
    );
    assert_eq!(again(LAZY, "failed").code, Some(3));
    verify(folder.path(), "failed").succeed();
}

#[test]
fn a_verdict_holds_and_a_forged_one_or_another_recording_does_not() {
    let folder = prepared(SUITE);
    let at = |name: &str| folder.path().join(name);
    gate(folder.path(), "lane_keeper", LAZY, "out").run();
    let held = verify(folder.path(), "out").args(["--probes", "5"]).succeed();
    assert!(
        held.stdout.contains("5 of ") && held.stdout.contains("blocks were repeated and came out the same"),
        "{}",
        held.stdout
    );
    let original = fs::read(at("out/verdict.json")).unwrap();
    let mut forged = Verdict::read(&at("out/verdict.json")).unwrap();
    forged.entries[1].checksum = "0".repeat(32);
    fs::write(at("out/verdict.json"), serde_json::to_string(&forged.sealed()).unwrap()).unwrap();
    let refuted = verify(folder.path(), "out").run();
    assert!(refuted.code == Some(3) && refuted.stdout.contains("entry 1, drawn 1"), "{}", refuted.stdout);
    fs::write(at("out/verdict.json"), original).unwrap();
    verify(folder.path(), "out")
        .args(["--scenario", &"0".repeat(32)])
        .fail(1, &["the verdict has no scenario with the id"]);
    // The recording is part of what is verified, wherever it lies.
    let other = prepared(SUITE);
    fs::rename(at("drive.mcap"), at("moved.mcap")).unwrap();
    fs::copy(other.path().join("drive.mcap"), at("drive.mcap")).unwrap();
    verify(folder.path(), "out").succeed();
    let source = r#"pdk.drive({ simulator = { name = "lane", width = 64, height = 48, rate = 10 }, driver = "lane_keeper", duration = 60,
        images_every = 1, scenarios = { { seed = 7 } } })"#;
    Pdk::new(["run", "--out"]).arg(at("second")).arg(pipeline(folder.path(), source)).succeed();
    let trace = fs::read_dir(at("second/traces")).unwrap().next().unwrap().unwrap().path();
    fs::copy(trace, at("drive.mcap")).unwrap();
    verify(folder.path(), "out").fail(1, &["the recording `mcap", "is not that of the verdict"]);
}

#[test]
fn a_record_stands_for_its_blocks_or_names_the_driver() {
    let folder = prepared(SUITE);
    gate(folder.path(), "lane_keeper,gain=1", "lane_keeper", "first").succeed();
    let ran = gate(folder.path(), "first", "lane_keeper,gain=1.1", "second").succeed();
    assert!(ran.stdout.contains("blocks were in a record already"), "{}", ran.stdout);
    let lines = json_lines(&folder.path().join("second/blocks.jsonl"));
    assert!(lines.iter().all(|line| line["scenario"]["driver"]["parameters"]["gain"] == 1.1), "{lines:?}");
    verify(folder.path(), "second").succeed();
    Pdk::new(["report", "second"])
        .folder(folder.path())
        .fail(1, &["is that of a gate on recordings", "blocks.jsonl"]);
    // The record of an offline run names its driver, and has no blocks.
    let offline = r#"pdk.evaluate({ dataset = "drive.mcap", driver = "lane_keeper", perturbations = { "contrast" }, levels = { 1 }, frames = 5 })"#;
    let pipeline = pipeline(folder.path(), offline);
    Pdk::new(["run", "--out", "offline"]).arg(pipeline).folder(folder.path()).succeed();
    let ran = gate(folder.path(), "offline", "lane_keeper,gain=1", "third").succeed();
    assert!(!ran.stdout.contains("already"), "{}", ran.stdout);
}

#[test]
fn the_command_of_a_failure_names_the_record_that_has_it() {
    let folder = prepared(SUITE);
    gate(folder.path(), "lane_keeper", LAZY, "first").run();
    // Blocks of another version have other draws, so none of them is in the first record.
    fs::write(folder.path().join("route.toml"), SUITE.replace("version = 1", "version = 2")).unwrap();
    for _ in 0..2 {
        // The second time, all of them are in the gate's own record.
        let ran = gate(folder.path(), "lane_keeper", "first", "second").arg("--json").run();
        assert_eq!(ran.code, Some(3), "{}{}", ran.stdout, ran.stderr);
        let failures = ran.json()["new_failures"].clone();
        let command = failures[0]["replay"].as_str().unwrap();
        assert!(command.starts_with("pdk verify second --scenario "), "{command}");
    }
}

#[test]
fn requirements_count_blocks() {
    let requirements = r#"
[[require]]
kind = "measure"
measure = "steering_error"
at = "gaussian_noise@0"
below = 0.05
on = [3, 4]

[[require]]
kind = "no_new_failure"

[[require]]
kind = "not_worse"
by = "perturbation"
tolerated = 0.9
"#;
    let folder = prepared(&format!("{SUITE}{requirements}"));
    let ran = gate(folder.path(), "lane_keeper", "lane_keeper", "out").arg("--json").succeed().json();
    let findings = ran["verdict"]["decision"]["findings"].as_array().unwrap();
    assert_eq!(findings[0]["requirement"], "steering_error at gaussian_noise@0 below 0.05 on 3 of 4 blocks");
    assert_eq!(findings[0]["said"], "3 of 3 blocks, 3 needed");
    // As many blocks as the recording has, though the suite would draw 400.
    let blocks = findings[1]["scenarios"].as_u64().unwrap();
    assert!((10..100).contains(&blocks), "{blocks}");
    assert!(findings.iter().all(|finding| finding["state"] == "met"), "{findings:#?}");
    verify(folder.path(), "out").succeed();
    let shown = Pdk::new(["suite", "route.toml"]).folder(folder.path()).succeed();
    assert!(
        shown.stdout.contains(&format!("at most {blocks} for both drivers, 4 for the new one alone")),
        "{}",
        shown.stdout
    );
}

#[test]
fn mistakes_are_named() {
    let folder = prepared(SUITE);
    let with = |text: &str| {
        fs::write(folder.path().join("route.toml"), text).unwrap();
        // A record of its own each.
        gate(folder.path(), "lane_keeper", "lane_keeper", &format!("out-{}", text.len()))
    };
    with(&SUITE.replace("drive.mcap", "none.mcap"))
        .fail(1, &["there is no file or folder none.mcap to open as a dataset; correct its path"]);
    with(&SUITE.replace("block = 8", "block = 8000"))
        .fail(1, &["no sequence of them is as long as a block of 8000"]);
    with(&SUITE.replace("steering_error = 0.05", "steering_error = 0")).fail(1, &["`steering_error` is 0"]);
    with(&SUITE.replace("[test]", "[[place]]\nsimulator = \"lane\"\n[test]"))
        .fail(1, &["write a suite of each"]);
    let measure = "\n[[require]]\nkind = \"measure\"\nmeasure = \"max_jerk\"\nbelow = 1\non = [1, 2]";
    with(&format!("{SUITE}{measure}")).fail(
        1,
        &["names no measure of outcomes; they are steering_error, max_steering_error, throttle_error"],
    );
    let long =
        format!("{SUITE}{}", measure.replace("max_jerk", "steering_error").replace("[1, 2]", "[1, 2000]"));
    with(&long).fail(1, &["blocks, which is not enough for `requirement 1 ", "set a smaller `block`"]);
    // The first blocks would have decided, but none was looked at.
    assert!(!folder.path().join(format!("out-{}/blocks.jsonl", long.len())).exists());
    with(SUITE).args(["--clips", "clips"]).fail(1, &["clips are of drives"]);
    // Pictures without a recorded steering.
    let pictures: PathBuf = folder.path().join("pictures");
    datasets::tub(&pictures, 20, 64, 48);
    for name in ["manifest.json", "catalog_0.catalog"] {
        fs::remove_file(pictures.join(name)).unwrap();
    }
    with(&SUITE.replace("drive.mcap", "pictures"))
        .fail(1, &["with the old driver: no frame from ", "has a steering that was recorded"]);
}
