//! Failures that are explained: the parts of a drive that suffice and that are needed, each with a drive that proves it.

use std::fs;
use std::path::{Path, PathBuf};

use pdk_tests::planted::{self, Cause};
use pdk_tests::process::{json_lines, pipeline};
use pdk_tests::{Pdk, temp};
use serde_json::{Value, json};

/// A failure that needs one of two perturbations, a drive without any, one that fails without any, one that is limited, a failure that comes later without the
/// perturbation that it does not need, and one of a drive that would not end in time without any.
const SOURCE: &str = r#"
    local road = { angles = { 0, 5, 20, -20, 5, 0, 0 }, segment = 10 }
    local simulator = { name = "lane", width = 64, height = 48, rate = 10 }
    pdk.drive({ simulator = simulator, driver = "lane_keeper", duration = 20, images_every = 0,
        scenarios = { { road = road, perturbations = { "translate_image@4", "gaussian_noise@0" } }, { road = road } } })
    pdk.drive({ simulator = simulator, driver = "lane_keeper", duration = 1, images_every = 0,
        scenarios = { { road = road, perturbations = { "gaussian_noise@0" } },
            { road = road, perturbations = { { name = "translate_image", level = 4, during = { from = 1 } } } },
            { duration = 20, road = { angles = { 0, 5, 20, -20, 5, 0, 0 }, segment = 10 }, perturbations = { "rotate_image@4", "gaussian_noise@4" } },
            { duration = 6, road = road, perturbations = { "translate_image@4" } } } })
"#;

fn record(folder: &Path) -> PathBuf {
    let out = folder.join("record");
    Pdk::new(["run", "--out"]).arg(&out).arg(pipeline(folder, SOURCE)).succeed();
    out
}

fn why(record: &Path, folder: &Path, scenario: &str) -> Pdk {
    Pdk::new(["why"]).arg(record).args(["--scenario", scenario, "--out"]).arg(folder.join("why"))
}

/// The outcome of the only scenario of a pipeline.
fn outcome(script: &Path, out: &Path) -> Value {
    Pdk::new(["run", "--out"]).arg(out).arg(script).succeed();
    json_lines(&out.join("scenarios.jsonl")).remove(0)
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn both_parts_are_proven_by_drives_that_anyone_can_repeat() {
    let folder = temp();
    let record = record(folder.path());
    let before = json_lines(&record.join("scenarios.jsonl"))[0].clone();
    assert_eq!(before["cause"], "lane_departure", "{before}");
    let with = |workers: &str| {
        let ran = why(&record, folder.path(), "0").args(["--json", "--workers", workers]).succeed();
        serde_json::from_str::<Value>(&ran.stdout).unwrap()
    };
    let found = with("2");
    assert_eq!(found["not_needed"], json!(["gaussian_noise@0"]));
    assert_eq!(with("1"), found);
    // A sentence for each perturbation: at such a level, a little more or less changes nothing.
    let sentences = found["derivative"]["sentences"].as_array().unwrap();
    assert!(
        sentences[0].as_str().unwrap().starts_with("translate_image: a little more or less"),
        "{sentences:?}"
    );
    assert_eq!((sentences.len(), &found["derivative"]["unknown"]), (2, &Value::Null));
    let frames = |what: &str, place: usize| found[what]["frames"][place].as_u64().unwrap();
    let all = before["frames"].as_u64().unwrap();
    for what in ["sufficient", "necessary"] {
        assert!(frames(what, 0) <= frames(what, 1) && frames(what, 1) < all, "{found}");
    }
    assert!(frames("sufficient", 1) - frames("sufficient", 0) + 1 < all, "{found}");
    // Each is what it is called, in a run of its own.
    let script = |what: &str| folder.path().join(format!("why/{what}.lua"));
    let sufficient = outcome(&script("sufficient"), &folder.path().join("first"));
    assert_eq!(
        (&sufficient["cause"], &sufficient["digest"]),
        (&json!("lane_departure"), &found["sufficient"]["outcome"]["digest"])
    );
    let necessary = outcome(&script("necessary"), &folder.path().join("second"));
    assert_eq!(
        (&necessary["success"], &necessary["digest"]),
        (&json!(true), &found["necessary"]["outcome"]["digest"])
    );
    // One frame less at the end does not suffice.
    let text = fs::read_to_string(script("sufficient")).unwrap();
    let to = found["sufficient"]["scenario"]["perturbations"][0]["during"]["to"].as_f64().unwrap();
    let shorter = folder.path().join("shorter.lua");
    let fewer = text.replacen(&format!("to = {to}"), &format!("to = {}", to - 0.1), 1);
    assert_ne!(fewer, text);
    fs::write(&shorter, fewer).unwrap();
    assert_ne!(outcome(&shorter, &folder.path().join("third"))["cause"], "lane_departure");
    // And in words, with clips.
    let ran = why(&record, folder.path(), "0").arg("--clips").succeed();
    for part in [
        "gaussian_noise@0 is not needed.",
        "Sufficient: translate_image in frame",
        "Necessary: translate_image in frame",
    ] {
        assert!(ran.stdout.contains(part), "{}", ran.stdout);
    }
    for clip in ["sufficient.mp4", "necessary.mp4"] {
        assert!(fs::metadata(folder.path().join("why").join(clip)).unwrap().len() > 1000);
    }
}

#[test]
fn what_is_left_of_a_chain_may_fail_later() {
    let folder = temp();
    let record = record(folder.path());
    let before = json_lines(&record.join("scenarios.jsonl"))[4].clone();
    let found = why(&record, folder.path(), "4").arg("--json").succeed().json();
    assert_eq!(found["not_needed"], json!(["rotate_image@4"]));
    let [sufficient, necessary] = ["sufficient", "necessary"].map(|what| &found[what]);
    assert_eq!(
        (&sufficient["outcome"]["cause"], &before["cause"]),
        (&json!("lane_departure"), &json!("lane_departure"))
    );
    assert_eq!(necessary["outcome"]["success"], true, "{found}");
    assert!(sufficient["outcome"]["frames"].as_u64() > before["frames"].as_u64(), "{found}");
}

#[test]
fn what_has_no_cause_in_a_perturbation_is_reported() {
    let folder = temp();
    let record = record(folder.path());
    let ask = |scenario: &str| why(&record, folder.path(), scenario);
    ask("1").fail(1, &["was a success, so there is no failure to explain"]);
    ask("2").fail(1, &["without perturbations scenario", "ends with time", "so they are not the cause"]);
    ask("3").fail(1, &["is limited by `during` already"]);
    ask("5").fail(
        1,
        &[
            "ends with time-out at 6.00 s, so there is no drive that passes",
            "drive it again with a longer `duration`",
        ],
    );
    ask("9").fail(1, &["holds no scenario 9"]);
}

/// `cargo bench --bench causes` does the same with two hundred.
#[test]
fn a_planted_cause_is_found() {
    let folder = temp();
    let causes = Cause::drawn(3, 1, [0.25, 0.75]);
    let record = planted::record(folder.path(), &causes);
    for (number, cause) in causes.iter().enumerate() {
        let found = planted::why(&record, folder.path(), number);
        let [sufficient, necessary] = ["sufficient", "necessary"].map(|what| Cause::found(&found[what]));
        assert_eq!(sufficient.frames, cause.frames, "{cause:?} {found}");
        assert!(sufficient.overlap(cause) > 0.9, "{cause:?} {found}");
        // All of the cause has to be black, so the least of it is needed.
        assert!(necessary.is_a_cell() && necessary.meets(cause), "{cause:?} {found}");
    }
}
