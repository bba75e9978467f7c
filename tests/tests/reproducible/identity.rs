//! A scenario is what it is: wherever it stands in a list, beside whatever others, on any number of workers, in a replay and on
//! workers from elsewhere.

use std::collections::BTreeSet;
use std::path::Path;

use pdk_tests::process::{json_file, json_lines, pipeline};
use pdk_tests::records::{assert_equal, files};
use pdk_tests::{Pdk, temp};
use serde_json::Value;

/// The scenario that is looked at, at some place among others.
const AMONG_OTHERS: &str = r#"
    local settings = pdk.settings({ place = 1, others = 5 })
    local scenarios = {}
    for number = 1, settings.others do
        table.insert(scenarios, {
            name = "other " .. number, road = { angles = { 0, number, -number }, segment = 10 },
            perturbations = { "gaussian_noise@" .. number / 2, "contrast@1" }, driver = number == 2 and "dave2" or nil,
            simulator = { name = "lane", width = 80, height = 60 + number % 2 },
        })
    end
    table.insert(scenarios, settings.place, {
        name = "wanted", road = { angles = { 0, 6, -6 }, segment = 10 }, perturbations = { "gaussian_noise@3", "cutout_filter@2" },
    })
    pdk.show(pdk.drive({
        simulator = { name = "lane", width = 80, height = 60 }, driver = "lane_keeper", duration = 2, images_every = 7,
        scenarios = scenarios,
    }))
"#;

fn run(script: &Path, out: &Path, workers: &str) -> Pdk {
    Pdk::new(["run", "--workers", workers, "--out"]).arg(out).arg(script)
}

/// The lines of a record.
fn scenarios(out: &Path) -> Vec<Value> {
    json_lines(&out.join("scenarios.jsonl"))
}

/// The only line with a name.
fn named<'a>(lines: &'a [Value], name: &str) -> &'a Value {
    let mut found = lines.iter().filter(|line| line["name"] == name);
    let line = found.next().unwrap_or_else(|| panic!("no `{name}` in {lines:?}"));
    assert!(found.next().is_none(), "`{name}` is there twice");
    line
}

#[test]
fn a_scenario_comes_out_the_same_wherever_it_is_driven() {
    let folder = temp();
    let script = pipeline(folder.path(), AMONG_OTHERS);
    let mut wanted = BTreeSet::new();
    let mut traces = BTreeSet::new();
    for (place, workers) in [("1", "1"), ("3", "2"), ("6", "7")] {
        let out = folder.path().join(format!("at-{place}"));
        run(&script, &out, workers).set("place", place).succeed();
        let lines = scenarios(&out);
        assert_eq!(lines.len(), 6);
        assert_eq!(
            lines.iter().position(|line| line["name"] == "wanted"),
            Some(place.parse::<usize>().unwrap() - 1)
        );
        let line = named(&lines, "wanted");
        assert!(line["frames"].as_u64().unwrap() >= 30, "{line}");
        let trace = format!("traces/{}.mcap", line["id"].as_str().unwrap());
        traces.insert(std::fs::read(out.join(trace)).unwrap());
        wanted.insert(line.to_string());
    }
    // Workers from elsewhere, as many as they say.
    let out = folder.path().join("pool");
    let pool = format!("'{}' 3", env!("CARGO_BIN_EXE_pool"));
    run(&script, &out, "1").args(["--pool", &pool]).succeed();
    wanted.insert(named(&scenarios(&out), "wanted").to_string());
    // Alone.
    let out = folder.path().join("alone");
    run(&script, &out, "1").set("others", 0).succeed();
    let alone = scenarios(&out);
    assert_eq!(alone.len(), 1);
    wanted.insert(alone[0].to_string());
    assert_eq!(wanted.len(), 1, "{wanted:#?}");
    assert_eq!(traces.len(), 1, "the traces differ");

    // And again, chosen by its id from among others.
    let id = alone[0]["id"].as_str().unwrap();
    let replay = |id: &str| {
        let replayed = Pdk::new(["replay", "--json", "--workers", "2", "--scenario", id])
            .arg(folder.path().join("at-3"));
        replayed.succeed().json()["scenarios"].clone()
    };
    for id in [id, &id[..8]] {
        let replayed = replay(id);
        assert_eq!(replayed.as_array().unwrap().len(), 1, "{replayed}");
        assert_eq!(
            (&replayed[0]["id"], &replayed[0]["equal"]),
            (&alone[0]["id"], &true.into()),
            "{replayed}"
        );
        assert_eq!(replayed[0]["frames"], alone[0]["frames"]);
    }
}

#[test]
fn equal_scenarios_of_a_run_are_driven_once() {
    let folder = temp();
    let script = pipeline(
        folder.path(),
        r#"
        local function scenario(name)
            return { name = name, road = { angles = { 0, 5 }, segment = 10 }, perturbations = { "gaussian_noise@3", "cutout_filter@1" } }
        end
        local common = { simulator = { name = "lane", width = 80, height = 60 }, driver = "lane_keeper", duration = 1 }
        common.scenarios = { scenario("a"), scenario("a"), scenario("a") }
        local three = pdk.drive(common)
        -- What it is called, and how it is written, is not what it is.
        local session = pdk.session({ simulator = common.simulator, driver = { name = "lane_keeper" }, duration = 1.0 })
        local again = scenario("another name")
        again.road.angles[2] = 5.0
        local fourth = session:wait(session:submit(again))
        assert(fourth.id == three[1].id and fourth.digest == three[1].digest)
        "#,
    );
    for workers in ["1", "3"] {
        let out = folder.path().join(workers);
        let ran = run(&script, &out, workers).succeed();
        let lines = scenarios(&out);
        assert_eq!(lines.len(), 1, "{lines:?}");
        let rows = json_file(&out.join("summary.json"))["outcomes"].clone();
        let rows = rows.as_array().unwrap();
        assert_eq!(rows.len(), 4);
        assert!(rows[..3].iter().all(|row| *row == rows[0]), "{rows:#?}");
        let mut fourth = rows[3].clone();
        assert_eq!(std::mem::replace(&mut fourth["name"], "a".into()), "another name");
        assert_eq!(fourth, rows[0]);
        assert_eq!((&rows[0]["id"], &rows[0]["digest"]), (&lines[0]["id"], &lines[0]["digest"]));
        let performance = json_file(&out.join("performance.json"));
        assert_eq!(performance["drive"]["stages"]["steps"], lines[0]["frames"], "{performance}");
        // It was not there before this run.
        assert!(!ran.stdout.contains("in the record already"), "{}", ran.stdout);
    }
}

#[test]
fn equal_scenarios_that_fail_are_driven_once_a_run() {
    let folder = temp();
    let script = pipeline(
        folder.path(),
        r#"
        local session = pdk.session({ simulator = "misbehave", driver = { name = "misbehave", how = "abort_in_drive", at = 3 } })
        for count = 1, 3 do
            local outcome = session:wait(session:submit({ name = "bad" }))
            assert(outcome.cause == "error" and outcome.frames == 3)
        end
        pdk.drive({ simulator = "misbehave", driver = "misbehave", scenarios = { {} } })
        "#,
    );
    let out = folder.path().join("out");
    let mut expected = None;
    // The second time it is driven again, because another worker may do better, and comes to the same.
    for _ in 0..2 {
        let ran = run(&script, &out, "2").misbehave().run();
        assert_eq!(ran.code, Some(1), "{}", ran.stderr);
        assert!(ran.stderr.contains("1 of 2 scenarios could not be driven"), "{}", ran.stderr);
        let kept = ran.stdout.contains("1 of 2 scenarios were in the record already");
        assert_eq!(kept, expected.is_some(), "{}", ran.stdout);
        assert_eq!(scenarios(&out).len(), 2);
        match &expected {
            None => expected = Some(files(&out)),
            Some(expected) => assert_equal(&out, expected),
        }
    }
}

#[test]
fn luck_follows_from_the_road_the_repeat_and_the_seed_of_the_run() {
    let folder = temp();
    let script = pipeline(
        folder.path(),
        r#"
        local here, there = { angles = { 0, 5 }, segment = 10 }, { angles = { 0, 6 }, segment = 10 }
        pdk.drive({
            simulator = { name = "lane", width = 80, height = 60 }, driver = "lane_keeper", duration = 0.5,
            scenarios = {
                { name = "nominal", road = here },
                { name = "noise 2", road = here, perturbations = { "gaussian_noise@2" } },
                { name = "noise 3", road = here, perturbations = { "gaussian_noise@3" } },
                { name = "both", road = here, perturbations = { "cutout_filter@3", "gaussian_noise@3" } },
                { name = "longer", road = here, duration = 0.6 },
                { name = "there", road = there },
                { name = "again", road = here, ["repeat"] = 1 },
                { name = "once more", road = here, ["repeat"] = 2 },
                { name = "no road" },
                { name = "own", road = here, seed = 12 },
            },
        })
        "#,
    );
    let seeds = |seed: &str| {
        let out = folder.path().join(seed);
        run(&script, &out, "2").args(["--seed", seed]).succeed();
        let lines = scenarios(&out);
        let ids: BTreeSet<String> = lines.iter().map(|line| line["id"].to_string()).collect();
        assert_eq!((lines.len(), ids.len()), (10, 10));
        move |name: &str| named(&lines, name)["scenario"]["seed"].as_u64().unwrap()
    };
    let (first, second) = (seeds("1"), seeds("2"));
    for name in ["noise 2", "noise 3", "both", "longer"] {
        assert_eq!(first(name), first("nominal"), "{name}");
    }
    let all = ["nominal", "there", "again", "once more", "no road"];
    let all: Vec<u64> = all.iter().flat_map(|name| [first(name), second(name)]).collect();
    assert_eq!(all.iter().collect::<BTreeSet<_>>().len(), all.len(), "{all:?}");
    assert_eq!((first("own"), second("own")), (12, 12));
}

#[test]
fn equal_runs_write_equal_files_on_any_number_of_workers() {
    let folder = temp();
    // Some scenarios take much longer than others, so that they do not end in their order.
    let script = pipeline(
        folder.path(),
        r#"
        local scenarios = {}
        for number, name in { "gaussian_noise@3", "motion_blur@2", "banding@4", "cutout_filter@2", "dirty_lens@1.5", "raindrops_on_lens@3" } do
            for count = 0, 1 do
                table.insert(scenarios, {
                    perturbations = { name }, road = { angles = { 0, 5 * count }, segment = 20 }, ["repeat"] = count,
                    duration = number % 2 == 0 and 4 or 0.5,
                })
            end
        end
        -- One that cannot be built is part of the record.
        table.insert(scenarios, 3, { road = { angels = { 0 } } })
        local outcomes = pdk.drive({
            simulator = { name = "lane", width = 80, height = 60 }, driver = "lane_keeper", images_every = 5,
            scenarios = scenarios,
        })
        pdk.save("causes.json", { first = outcomes[1].cause, third = outcomes[3].cause })
        "#,
    );
    let mut expected = None;
    for workers in ["1", "2", "7"] {
        let out = folder.path().join(workers);
        run(&script, &out, workers).fail(1, &["1 of 13 scenarios", "angels"]);
        let found = files(&out);
        assert_eq!(scenarios(&out).len(), 13);
        assert_eq!(found.keys().filter(|path| path.starts_with("traces")).count(), 13);
        match &expected {
            None => expected = Some(found),
            Some(expected) => assert_equal(&out, expected),
        }
    }
}
