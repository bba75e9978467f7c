//! The pipelines that come with pdk: what they save agrees with the record, and two runs are equal.

#![allow(clippy::unwrap_used)]

use std::fs;
use std::path::Path;

use pdk_tests::process::{json_file, json_lines, pipeline};
use pdk_tests::{Pdk, repository, temp};
use serde_json::{Value, json};

/// Small frames: 80 x 60 pixels, 20 a second.
const SIMULATOR: &str = r#"{"name":"lane","width":80,"height":60,"rate":20}"#;

fn tiny(script: &str, out: &Path) -> Pdk {
    Pdk::new(["run", "--out"])
        .arg(out)
        .arg(repository().join("scripts").join(script))
        .set("simulator", SIMULATOR)
        .set("perturbations", "contrast,translate_image")
        .set("levels", "0,4")
        .set("limit", "10")
}

/// The outcome of a scenario by its name.
fn outcome<'a>(outcomes: &'a [Value], name: &str) -> &'a Value {
    outcomes.iter().find(|outcome| outcome["name"] == name).expect(name)
}

#[test]
fn greedy_climbs_until_the_first_failure() {
    let folder = temp();
    let outs = ["a", "b"].map(|name| folder.path().join(name));
    let ran = tiny("greedy.lua", &outs[0]).succeed();
    tiny("greedy.lua", &outs[1]).set("workers", 1).succeed();
    let read = |out: &Path| fs::read_to_string(out.join("greedy.json")).unwrap();
    assert_eq!(read(&outs[0]), read(&outs[1]));
    assert!(ran.stdout.contains("translate_image") && ran.stdout.contains("fails at"), "{}", ran.stdout);

    let outcomes = json_lines(&outs[0].join("scenarios.jsonl"));
    let greedy = json_file(&outs[0].join("greedy.json"));
    let results = greedy["results"].as_array().unwrap();
    assert_eq!(results.len(), 2);
    let mut driven = 1;
    for result in results {
        let name = result["perturbation"].as_str().unwrap();
        for step in result["driven"].as_array().unwrap() {
            driven += 1;
            let outcome = outcome(&outcomes, &format!("{name}@{}, road 1", step["level"]));
            assert_eq!(outcome["mean_cross_track_error"], step["metres"]);
            let failing = result.get("first_failing_level") == Some(&step["level"]);
            assert_eq!(outcome["success"], json!(!failing), "{outcome}");
        }
    }
    assert_eq!(outcomes.len(), driven, "something was driven that no result speaks of");
    let translate = results.iter().find(|result| result["perturbation"] == "translate_image").unwrap();
    assert!(translate["first_failing_level"].is_number(), "{translate}");
}

#[test]
fn roads_that_fail_without_perturbation_are_left_out() {
    let folder = temp();
    let out = folder.path().join("record");
    tiny("greedy.lua", &out).set("duration", 1).fail(1, &["managed no road"]);
    let study = folder.path().join("study");
    tiny("study.lua", &study).set("duration", 1).set("roads", 1).fail(1, &["managed no road"]);
}

#[test]
fn levels_are_climbed_from_the_lowest_and_nothing_counts_twice() {
    let folder = temp();
    let out = folder.path().join("greedy");
    let names = "translate_image,contrast,translate_image";
    tiny("greedy.lua", &out).set("perturbations", names).set("levels", "4,0,4").succeed();
    let greedy = json_file(&out.join("greedy.json"));
    let results = greedy["results"].as_array().unwrap();
    assert_eq!(results.len(), 2);
    for result in results {
        assert_eq!(result["driven"][0]["level"], 0);
    }
    let out = folder.path().join("study");
    tiny("study.lua", &out).set("roads", 1).set("perturbations", names).set("levels", "4,0,4").succeed();
    let ranking = json_file(&out.join("ranking.json"));
    let counts: Vec<_> =
        ranking["ranking"].as_array().unwrap().iter().map(|entry| entry["scenarios"].clone()).collect();
    assert_eq!(counts, [2, 2]);
    for (setting, value) in [("levels", "[]"), ("roads", "0")] {
        for script in ["greedy.lua", "study.lua"] {
            let out = folder.path().join(format!("{script}-{setting}"));
            tiny(script, &out).set(setting, value).fail(1, &[setting]);
        }
    }
}

#[test]
fn bisection_narrows_the_level_at_which_failing_begins_with_few_drives() {
    let folder = temp();
    let out = folder.path().join("greedy");
    let greedy = |out: &Path| {
        tiny("greedy.lua", out).set("method", "bisection").set("precision", 0.5).set("repeats", 3)
    };
    greedy(&out).succeed();
    let results = json_file(&out.join("greedy.json"))["results"].clone();
    let contrast = &results[0];
    // The highest level passes, so nothing else is driven.
    assert_eq!(
        (contrast["driven"].as_array().unwrap().len(), contrast.get("first_failing_level")),
        (1, None)
    );
    let translate = &results[1];
    let level = |name: &str| translate[name].as_f64().unwrap();
    assert!(level("first_failing_level") - level("highest_passing_level") <= 0.5, "{translate}");
    let driven = translate["driven"].as_array().unwrap();
    assert!(driven.len() <= 5, "two ends and three halves: {translate}");
    let at = |level: &Value| driven.iter().find(|step| step["level"] == *level).unwrap();
    let fails = |step: &Value| 2 * step["failures"].as_u64().unwrap() >= step["drives"].as_u64().unwrap();
    assert!(fails(at(&translate["first_failing_level"])) && !fails(at(&translate["highest_passing_level"])));
    assert!(level("failed_share_low") < level("failed_share"), "{translate}");
    assert_eq!(json_lines(&out.join("scenarios.jsonl")).len(), 1 + 3 * (1 + driven.len()));
    for (setting, value, said) in [
        ("method", "luck", "method is luck"),
        ("precision", "0", "precision is 0"),
        ("repeats", "0", "repeats is 0"),
    ] {
        greedy(&folder.path().join(setting)).set(setting, value).fail(1, &[said]);
    }
}

#[test]
fn an_error_of_a_component_is_no_failure_of_the_driver() {
    let folder = temp();
    let source =
        "return { doc = 'breaks', apply = function(_, cx) if cx.time > 0.3 then error('broken') end end }";
    fs::write(folder.path().join("breaks.lua"), source).unwrap();
    let run = |script: &str| {
        let out = folder.path().join(script);
        let run = tiny(script, &out).set("perturbations", "breaks,contrast").set("roads", 1);
        // What a component breaks is told at the end.
        run.arg("--plugins").arg(folder.path()).fail(1, &["breaks"]);
        out
    };
    let greedy = json_file(&run("greedy.lua").join("greedy.json"));
    let breaks = &greedy["results"][0];
    assert_eq!((&breaks["cause"], breaks.get("first_failing_level")), (&json!("error"), None), "{breaks}");
    assert_eq!(breaks["driven"], json!([]), "it goes no further");
    let ranking = json_file(&run("study.lua").join("ranking.json"));
    assert_eq!(ranking["not_driven"], json!(["breaks"]));
    let entries = ranking["ranking"].as_array().unwrap();
    assert_eq!((entries.len(), &entries[0]["perturbation"]), (1, &json!("contrast")));
}

#[test]
fn the_study_ranks_by_failures() {
    let folder = temp();
    let outs = ["a", "b"].map(|name| folder.path().join(name));
    for (out, workers) in outs.iter().zip([2, 1]) {
        tiny("study.lua", out).set("roads", 1).set("repeats", 2).set("workers", workers).succeed();
    }
    let read = |out: &Path| fs::read_to_string(out.join("ranking.json")).unwrap();
    assert_eq!(read(&outs[0]), read(&outs[1]));

    let outcomes = json_lines(&outs[0].join("scenarios.jsonl"));
    let ranking = json_file(&outs[0].join("ranking.json"));
    let entries = ranking["ranking"].as_array().unwrap();
    assert_eq!((entries.len(), &entries[0]["perturbation"]), (2, &json!("translate_image")));
    for entry in entries {
        let name = entry["perturbation"].as_str().unwrap();
        let of_entry: Vec<&Value> = outcomes
            .iter()
            .filter(|outcome| outcome["name"].as_str().unwrap().starts_with(&format!("{name}@")))
            .collect();
        let failed = of_entry.iter().filter(|outcome| outcome["success"] == false).count();
        assert_eq!((entry["scenarios"].as_u64(), entry["failures"].as_u64()), (Some(4), Some(failed as u64)));
        assert_eq!(of_entry.len(), 4);
        for by_level in entry["by_level"].as_array().unwrap() {
            let name = format!("{name}@{}, ", by_level["level"]);
            let of_level =
                of_entry.iter().filter(|outcome| outcome["name"].as_str().unwrap().starts_with(&name));
            let failed = of_level.filter(|outcome| outcome["success"] == false).count();
            assert_eq!((&by_level["scenarios"], &by_level["failures"]), (&json!(2), &json!(failed)));
        }
        let number = |field: &str| entry[field].as_f64().unwrap();
        let share = failed as f64 / 4.0;
        assert_eq!(number("failed_share"), share);
        assert!(number("failed_share_low") <= share && share <= number("failed_share_high"));
        let increase: f64 = of_entry
            .iter()
            .map(|outcome| {
                let road = outcome["name"].as_str().unwrap().split(", ").nth(1).unwrap();
                let nominal = self::outcome(&outcomes, &format!("nominal, {road}"));
                let error = |outcome: &Value| outcome["mean_cross_track_error"].as_f64().unwrap();
                error(outcome) - error(nominal)
            })
            .sum::<f64>()
            / 4.0;
        assert!((number("mean_cross_track_error_increase") - increase).abs() < 1e-12);
    }
}

#[test]
fn a_pipeline_saves_files_of_its_own_only() {
    let folder = temp();
    let early = r#"pdk.save("a.json", {})"#;
    let run = |name: &str, source: &str| {
        let place = folder.path().join(name);
        fs::create_dir(&place).unwrap();
        Pdk::new(["run", "--out"]).arg(place.join("record")).arg(pipeline(&place, source)).misbehave()
    };
    run("early", early).fail(1, &["pdk.save has to come after the first pdk.drive"]);
    let drive = r#"pdk.drive({ simulator = "misbehave", driver = "misbehave", scenarios = { {} } })"#;
    run("own", &format!("{drive}\npdk.save('manifest.json', 1)")).fail(1, &["a file of the record itself"]);
    run("good", &format!("{drive}\npdk.save('a.json', {{ b = 1, a = {{ 2 }} }})")).succeed();
    assert_eq!(json_file(&folder.path().join("good/record/a.json")), json!({"a": [2], "b": 1}));
}

#[test]
fn the_ranking_that_comes_along_is_of_the_default_set() {
    let ranking = json_file(&repository().join("scripts/ranking.json"));
    let entries = ranking["ranking"].as_array().unwrap();
    let mut ranked: Vec<&str> = entries.iter().map(|entry| entry["perturbation"].as_str().unwrap()).collect();
    ranked.sort_unstable();
    let listed = Pdk::new(["list", "--json"]).succeed().json();
    let default = |component: &&Value| {
        component["description"]["kind"] == "perturbation" && component["description"]["default"] == true
    };
    let mut names: Vec<&str> = listed
        .as_array()
        .unwrap()
        .iter()
        .filter(default)
        .map(|c| c["description"]["name"].as_str().unwrap())
        .collect();
    names.sort_unstable();
    assert_eq!(ranked, names, "measure it anew: pdk run scripts/study.lua");
    let shares: Vec<f64> = entries.iter().map(|entry| entry["failed_share"].as_f64().unwrap()).collect();
    assert!(shares.is_sorted_by(|a, b| a >= b));
    assert!(entries.iter().all(|entry| entry["scenarios"] == 50), "five levels on ten roads");
}
