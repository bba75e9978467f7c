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

#[test]
fn a_picture_learns_to_move_the_vehicle_and_comes_out_the_same_again() {
    let folder = temp();
    let record = record(folder.path(), &[drive(PATCH), drive(&format!("'gaussian_blur@0', {PATCH}"))]);
    let train = |name: &str, goal: &str| -> Value {
        let arguments = ["-o", name, "--steps", "4", "--goal", goal, "--json"];
        attack(&record, folder.path(), &arguments).succeed().json()
    };
    let (trained, again, right) = (train("a.png", "left"), train("b.png", "left"), train("c.png", "right"));
    let [start, a, b, c] = ["start.png", "a.png", "b.png", "c.png"]
        .map(|name| pdk_image::read(&folder.path().join(name)).unwrap());
    assert!(a == b && a != start && a != c && (a.width(), a.height()) == (48, 48));
    assert_eq!((&trained["drives"], &trained["steps"]), (&again["drives"], &4.into()));
    let recorded = json_lines(&record.join("scenarios.jsonl"));
    for (number, recorded) in recorded.iter().enumerate() {
        assert_eq!(trained["drives"][number]["before"]["digest"], recorded["digest"]);
        let error = |trained: &Value, when: &str| {
            trained["drives"][number][when]["mean_cross_track_error"].as_f64().unwrap()
        };
        // The picture of before moves the vehicle to the left.
        assert!(error(&trained, "after") > 1.5 * error(&trained, "before"), "{trained}");
        assert!(error(&right, "after") < error(&right, "before"), "{right}");
    }
    let out = folder.path().join("driven");
    let source = format!("pdk.drive({{ scenarios = {{ {} }} }})", drive(&PATCH.replace("start", "a")));
    Pdk::new(["run", "--out"])
        .arg(&out)
        .arg(pipeline(folder.path(), &source))
        .folder(folder.path())
        .succeed();
    let driven = &json_lines(&out.join("scenarios.jsonl"))[0];
    assert_eq!(driven["digest"], trained["drives"][0]["after"]["digest"]);
}

#[test]
fn drives_whose_picture_cannot_be_trained_are_refused_and_nothing_is_written() {
    let folder = temp();
    fs::copy(repository().join("docs/examples/road.jpg"), folder.path().join("other.png")).unwrap();
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
    ];
    let record = record(folder.path(), &drives);
    let refused = |scenarios: &[&str], parts: &[&str]| {
        let chosen = scenarios.iter().flat_map(|scenario| ["--scenario", scenario]);
        let arguments: Vec<&str> = chosen.chain(["-o", "out.png"]).collect();
        attack(&record, folder.path(), &arguments).fail(1, parts);
        assert!(!folder.path().join("out.png").exists(), "{scenarios:?}");
    };
    refused(&["0"], &["none of its perturbations shows a picture that can be trained"]);
    refused(&["1"], &["`dave2_patch` is not a file", "`pdk attack patch`"]);
    refused(&["2"], &["`gaussian_noise` changes the frame after the picture is shown", "put it before"]);
    refused(&["3"], &["only a picture that is shown whole can be trained", "leave `region`, `where`"]);
    refused(&["4"], &["lane_keeper"]);
    refused(&["5"], &["set `show=picture`"]);
    refused(&["6", "7"], &["some of the drives show other.png and others start.png", "--scenario"]);
    refused(&["99"], &["99"]);
    attack(&record, folder.path(), &["--scenario", "7", "-o", "start.png"])
        .fail(1, &["would replace start.png"]);
}
