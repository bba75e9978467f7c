//! Failures that are shrunk: what is left still fails, is smaller, and can be run by anyone.

use std::fs;
use std::path::{Path, PathBuf};

use pdk_tests::process::{json_lines, pipeline};
use pdk_tests::{Pdk, temp};
use serde_json::Value;

/// A failure that needs one of three perturbations, a drive without any, and one in real time that has too little of it.
const SOURCE: &str = r#"
    local road = { angles = { 0, 5, 20, -20, 5, 0, 0 }, segment = 10 }
    pdk.drive({
        simulator = { name = "lane", width = 64, height = 48, rate = 10 }, driver = "lane_keeper", duration = 20,
        images_every = 0,
        scenarios = {
            { road = road, perturbations = { "contrast@0.5", "translate_image@4", "gaussian_noise@0" } },
            { road = { angles = { 0, 0 }, segment = 10 } },
            { road = road, mode = "realtime", duration = 0.2 },
        },
    })
"#;

fn record(folder: &Path) -> PathBuf {
    let out = folder.join("record");
    Pdk::new(["run", "--out"]).arg(&out).arg(pipeline(folder, SOURCE)).succeed();
    out
}

fn shrink(record: &Path, folder: &Path, scenario: &str) -> Pdk {
    Pdk::new(["shrink"]).arg(record).args(["--scenario", scenario, "--out"]).arg(folder.join("failure.lua"))
}

#[test]
fn what_is_left_of_a_failure_still_fails_and_has_nothing_that_it_does_not_need() {
    let folder = temp();
    let record = record(folder.path());
    let before = json_lines(&record.join("scenarios.jsonl"))[0].clone();
    assert_eq!(before["cause"], "lane_departure", "{before}");
    let clip = folder.path().join("failure.mp4");
    let with = |workers: u32| {
        let ran = shrink(&record, folder.path(), "0").args(["--draws", "4", "--json", "--workers"]);
        let ran = ran.arg(workers.to_string()).arg("--clip").arg(&clip).succeed();
        serde_json::from_str::<Value>(&ran.stdout).unwrap()
    };
    let shrunk = with(2);
    let scenario = &shrunk["scenario"];
    let chain = scenario["perturbations"].as_array().unwrap();
    assert_eq!((chain.len(), &chain[0]["name"]), (1, &Value::from("translate_image")), "{scenario}");
    assert!(chain[0]["level"].as_f64().unwrap() < 4.0);
    let angles = |scenario: &Value| scenario["road"]["angles"].as_array().unwrap().len();
    assert!(angles(scenario) < angles(&before["scenario"]), "{scenario}");
    assert!(scenario["duration"].as_f64().unwrap() < 20.0);
    assert_eq!(
        (&shrunk["outcome"]["cause"], &shrunk["draws"]),
        (&Value::from("lane_departure"), &Value::from(4))
    );
    assert!(fs::metadata(&clip).unwrap().len() > 1000);
    // The number of workers changes nothing.
    assert_eq!(with(1), shrunk);

    let file = folder.path().join("failure.lua");
    let source = fs::read_to_string(&file).unwrap();
    assert!(source.lines().count() < 25, "{source}");
    let out = folder.path().join("again");
    Pdk::new(["run", "--out"]).arg(&out).arg(&file).succeed();
    let again = &json_lines(&out.join("scenarios.jsonl"))[0];
    assert_eq!(again["digest"], shrunk["outcome"]["digest"], "{source}");
}

#[test]
fn a_scenario_that_cannot_be_shrunk_gets_one_sentence() {
    let folder = temp();
    let record = record(folder.path());
    let run = |scenario: &str| shrink(&record, folder.path(), scenario);
    run("1").fail(1, &["was a success, so there is no failure to shrink"]);
    run("2").fail(1, &["was driven in real time", "drive it in lockstep"]);
    run("7").fail(1, &["holds no scenario 7"]);
    run("0").args(["--precision", "0"]).fail(1, &["--precision is 0"]);
    run("0").args(["--clip", "x.gif"]).fail(1, &["has to end in .mp4"]);
    Pdk::new(["shrink"])
        .arg(&record)
        .args(["--scenario", "0", "--out", "x.txt"])
        .fail(1, &["has to end in .lua"]);
    assert!(!folder.path().join("failure.lua").exists());
}
