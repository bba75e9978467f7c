//! A picture that drives show, trained by the derivative of the drives, as a user asks for it.

use std::fs;
use std::path::{Path, PathBuf};

use pdk_tests::process::{json_lines, pipeline};
use pdk_tests::{Pdk, repository, temp};
use serde_json::Value;

/// A drive with these perturbations.
fn drive(perturbations: &str) -> String {
    drive_of("dave2", perturbations)
}

fn drive_of(driver: &str, perturbations: &str) -> String {
    format!(
        "{{ simulator = 'lane', road = {{ angles = {{ 0, 4, -6, 3, 5 }}, segment = 25 }}, duration = 2, driver = '{driver}', \
         perturbations = {{ {perturbations} }} }}"
    )
}

fn record(folder: &Path, drives: &[String]) -> PathBuf {
    fs::copy(repository().join("scripts/attacks/dave2_patch.png"), folder.join("start.png")).unwrap();
    let source = format!("pdk.drive({{ images_every = 0, scenarios = {{ {} }} }})", drives.join(", "));
    let out = folder.join("record");
    Pdk::new(["run", "--out"]).arg(&out).arg(pipeline(folder, &source)).folder(folder).succeed();
    out
}

fn attack(record: &Path, folder: &Path, arguments: &[&str]) -> Pdk {
    Pdk::new(["attack", "drives"]).arg(record).args(arguments).folder(folder)
}

/// A patch of 2 m that is always there.
const PATCH: &str = "{ name = 'adversarial_patch', picture = 'start.png', size = 2 }";

/// What the attack says of its drives.
fn drives(trained: &Value) -> &Vec<Value> {
    trained["drives"].as_array().unwrap()
}

fn error(drive: &Value, when: &str) -> f64 {
    drive[when]["mean_error_to_goal"].as_f64().unwrap()
}

#[test]
fn a_picture_learns_to_move_the_vehicle_and_comes_out_the_same_again() {
    let folder = temp();
    let record = record(folder.path(), &[drive(PATCH), drive(&format!("'gaussian_blur@0', {PATCH}"))]);
    let train = |name: &str, goal: &str| -> Value {
        let arguments = ["-o", name, "--steps", "2", "--goal", goal, "--json"];
        attack(&record, folder.path(), &arguments).succeed().json()
    };
    let (trained, again, right) = (train("a.png", "left"), train("b.png", "left"), train("c.png", "right"));
    let [start, a, b, c] = ["start.png", "a.png", "b.png", "c.png"]
        .map(|name| pdk_image::read(&folder.path().join(name)).unwrap());
    assert!(a == b && a != start && a != c && (a.width(), a.height()) == (48, 48));
    assert_eq!(trained["drives"], again["drives"]);
    let recorded = json_lines(&record.join("scenarios.jsonl"));
    for (number, recorded) in recorded.iter().enumerate() {
        let [left, right] = [&drives(&trained)[number], &drives(&right)[number]];
        assert_eq!(left["before"]["outcome"]["digest"], recorded["digest"]);
        assert_eq!(error(left, "before"), -error(right, "before"));
        assert!(error(left, "after") > error(left, "before") + 0.02, "{left}");
        assert!(error(right, "after") > error(right, "before") + 0.02, "{right}");
    }
    let out = folder.path().join("driven");
    let source = format!("pdk.drive({{ scenarios = {{ {} }} }})", drive(&PATCH.replace("start", "a")));
    Pdk::new(["run", "--out"])
        .arg(&out)
        .arg(pipeline(folder.path(), &source))
        .folder(folder.path())
        .succeed();
    let driven = &json_lines(&out.join("scenarios.jsonl"))[0];
    assert_eq!(driven["digest"], drives(&trained)[0]["after"]["outcome"]["digest"]);
}

#[test]
fn what_becomes_of_the_steering_on_its_way_to_the_vehicle_counts() {
    let folder = temp();
    let reversed = "return { doc = 'Steers to the other side', actuate = function(control) control.steering = -control.steering end }";
    fs::write(folder.path().join("reversed_controls.lua"), reversed).unwrap();
    fs::copy(repository().join("scripts/attacks/dave2_patch.png"), folder.path().join("start.png")).unwrap();
    let plugins = ["--plugins", "reversed_controls.lua"];
    let held = format!("{PATCH}, {{ name = 'limited_controls', steering = 0 }}");
    let hidden = PATCH.replace("size = 2", "size = 2, during = { from = 20, to = 30 }");
    let list = [drive(&format!("{PATCH}, 'reversed_controls@0'")), drive(&held), drive(&hidden)];
    let source = format!("pdk.drive({{ images_every = 0, scenarios = {{ {} }} }})", list.join(", "));
    let record = folder.path().join("record");
    Pdk::new(["run", "--out"])
        .arg(&record)
        .args(plugins)
        .arg(pipeline(folder.path(), &source))
        .folder(folder.path())
        .succeed();
    let trained =
        attack(&record, folder.path(), &["--scenario", "0", "-o", "a.png", "--steps", "1", "--json"]);
    let trained: Value = trained.args(plugins).succeed().json();
    let only = &drives(&trained)[0];
    assert!(error(only, "after") > error(only, "before") + 0.01, "{only}");
    for scenarios in [&["--scenario", "1"][..], &["--scenario", "2"], &["--scenario", "0", "--scenario", "1"]]
    {
        attack(&record, folder.path(), &[scenarios, &["-o", "b.png"]].concat())
            .args(plugins)
            .fail(1, &["the picture has no influence on this drive"]);
        assert!(!folder.path().join("b.png").exists());
    }
}

#[test]
fn drives_whose_picture_cannot_be_trained_are_refused_and_nothing_is_written() {
    let folder = temp();
    for (from, to) in [("dave2_universal.png", "other.png"), ("dave2_patch.png", "mask.png")] {
        fs::copy(repository().join("scripts/attacks").join(from), folder.path().join(to)).unwrap();
    }
    let built_in = PATCH.replace("start.png", "dave2_patch");
    let upper = PATCH.replace("size = 2", "size = 2, where = { label = 'road' }");
    let drives = [
        drive("'gaussian_noise@1'"),
        drive(&built_in),
        drive(&format!("{PATCH}, 'gaussian_noise@1'")),
        drive(&upper),
        drive_of("lane_keeper", PATCH),
        drive(&PATCH.replace("size = 2", "size = 2, show = 'mean'")),
        drive(&PATCH.replace("start", "other")),
        drive(PATCH),
        drive(&format!("{PATCH}, {PATCH}")),
        drive_of("dave2_temporal", PATCH),
        drive(&format!("{{ name = 'gaussian_blur', level = 1, region = {{ mask = 'mask.png' }} }}, {PATCH}")),
    ];
    let record = record(folder.path(), &drives);
    let out = folder.path().join("out.png");
    // What is there stays there, whichever of the drives it is that cannot be trained.
    fs::write(&out, "mine").unwrap();
    let refused = |scenarios: &[&str], parts: &[&str]| {
        let chosen = scenarios.iter().flat_map(|scenario| ["--scenario", scenario]);
        let arguments: Vec<&str> = chosen.chain(["-o", "out.png"]).collect();
        attack(&record, folder.path(), &arguments).fail(1, parts);
        assert_eq!(fs::read(&out).unwrap(), b"mine", "{scenarios:?}");
    };
    refused(&["0"], &["none of its perturbations shows a picture that can be trained"]);
    refused(&["1"], &["`dave2_patch` is not a file", "`pdk attack patch`"]);
    refused(&["2"], &["`gaussian_noise` changes the frame after the picture is shown", "put it before"]);
    refused(&["3"], &["only a picture that is shown whole can be trained", "leave `region`, `where`"]);
    refused(&["4"], &["lane_keeper"]);
    refused(&["5"], &["set `show=picture`"]);
    refused(&["6", "7"], &["other.png and others", "start.png", "--scenario"]);
    refused(&["8"], &["it shows two pictures"]);
    refused(&["7", "9"], &["dave2_temporal", "remembers earlier frames"]);
    refused(&["99"], &["99"]);
    let kept = |name: &str, parts: &[&str]| {
        let before = fs::read(folder.path().join(name)).ok();
        attack(&record, folder.path(), &["--scenario", "10", "--steps", "1", "-o", name]).fail(1, parts);
        assert_eq!(fs::read(folder.path().join(name)).ok(), before, "{name}");
    };
    kept("start.png", &["start.png is a file that the record was made with", "-o"]);
    kept("other.png", &["other.png is a file that the record was made with"]);
    kept("mask.png", &["mask.png is a file that the record was made with"]);
    kept("out.jpg", &["out.jpg is not a PNG file", ".png"]);
    kept("out", &["out is not a PNG file"]);
}
