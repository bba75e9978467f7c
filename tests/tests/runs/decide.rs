//! Pipelines that decide what to drive next by what came out: killed and continued they take the same way.

use std::fs;
use std::path::Path;

use pdk_tests::process::{json_file, json_lines, pipeline};
use pdk_tests::records::{assert_equal, files, lines, wait_for_scenarios};
use pdk_tests::{Pdk, temp};
use serde_json::Value;

/// Looks for the level at which a driver fails, if the picture is moved, on the road of the quickstart.
const BISECTION: &str = r#"
    local simulator = { name = "lane", width = 80, height = 60 }
    local session = pdk.session({ simulator = simulator, driver = "lane_keeper", duration = 40, images_every = 0 })
    local road = { angles = { 0, 12, -18, 10, 20, -15, -8, 0 }, segment = 25 }
    local low, high = 0, 4
    local way = {}
    for step = 1, 12 do
        local level = (low + high) / 2
        local ticket = session:submit({ name = "step " .. step, road = road, perturbations = { { name = "translate_image", level = level } } })
        assert(session:pending() == 1)
        local outcome = session:wait(ticket)
        assert(session:pending() == 0 and outcome.name == "step " .. step)
        table.insert(way, { level = level, success = outcome.success, progress = outcome.progress })
        if outcome.success then
            low = level
        else
            high = level
        end
        pdk.save("way.json", { way = way, low = low, high = high })
    end
"#;

fn run(script: &Path, out: &Path) -> Pdk {
    Pdk::new(["run", "--workers", "2", "--out"]).arg(out).arg(script)
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn a_bisection_that_is_killed_takes_the_same_way() {
    let folder = temp();
    let script = pipeline(folder.path(), BISECTION);
    let whole = folder.path().join("whole");
    run(&script, &whole).succeed();
    let way = json_file(&whole.join("way.json"));
    let steps = way["way"].as_array().unwrap();
    assert_eq!(steps.len(), 12);
    // It did decide: both ways were taken, and what it came to follows from the outcomes.
    let failed = steps.iter().filter(|step| step["success"] == false).count();
    assert!((1..12).contains(&failed), "{way:#}");
    assert_eq!(way["high"].as_f64().unwrap() - way["low"].as_f64().unwrap(), 4.0 / 4096.0);
    let recorded = json_lines(&whole.join("scenarios.jsonl"));
    let levels = |list: &[Value], pointer: &str| -> Vec<f64> {
        list.iter().map(|value| value.pointer(pointer).unwrap().as_f64().unwrap()).collect()
    };
    assert_eq!(levels(&recorded, "/scenario/perturbations/0/level"), levels(steps, "/level"));

    let out = folder.path().join("killed");
    for count in [2, 5] {
        let mut child = run(&script, &out).spawn();
        wait_for_scenarios(&mut child, &out, count);
        child.kill().unwrap();
        assert!(child.wait().unwrap().code().is_none(), "it came to its end before it was killed");
        let ledger = fs::read(whole.join("scenarios.jsonl")).unwrap();
        let so_far = fs::read(out.join("scenarios.jsonl")).unwrap();
        assert!(ledger.starts_with(&so_far) && lines(&out.join("scenarios.jsonl")) >= count);
    }
    let before = lines(&out.join("scenarios.jsonl"));
    let ran = run(&script, &out).succeed();
    assert!(
        ran.stdout.contains(&format!("{before} of 12 scenarios were in the record already")),
        "{}",
        ran.stdout
    );
    assert_equal(&out, &files(&whole));
}

#[test]
fn one_by_one_or_all_at_once_is_the_same() {
    let folder = temp();
    let source = |driving: &str| {
        format!(
            r#"
            local function scenario(number)
                return {{
                    road = {{ angles = {{ 0, number % 7, -number % 5 }}, segment = 10 }}, ["repeat"] = number // 10,
                    perturbations = {{ "gaussian_noise@" .. number % 4, "contrast@1" }}, name = "scenario " .. number,
                }}
            end
            local common = {{
                simulator = {{ name = "lane", width = 64, height = 48 }}, driver = "lane_keeper", duration = 0.5, images_every = 3,
            }}
            {driving}
            "#
        )
    };
    let ways = [
        ("at once", "common.scenarios = {} for number = 1, 24 do table.insert(common.scenarios, scenario(number)) end pdk.drive(common)"),
        ("one by one", "for number = 1, 24 do common.scenarios = { scenario(number) } pdk.drive(common) end"),
        (
            "in a session",
            "local session = pdk.session(common) for number = 1, 24 do session:wait(session:submit(scenario(number))) end",
        ),
        (
            "as they come",
            "local session = pdk.session(common) for number = 1, 24 do session:submit(scenario(number)) end
             local seen = {} for count = 1, 24 do local outcome = session:next() assert(not seen[outcome.ticket]) seen[outcome.ticket] = true end
             assert(session:next() == nil)",
        ),
        (
            "without waiting",
            "local session = pdk.session(common) for number = 1, 24 do session:submit(scenario(number)) end",
        ),
    ];
    let mut expected = None;
    for (name, driving) in ways {
        let named = folder.path().join(name);
        fs::create_dir(&named).unwrap();
        let script = pipeline(&named, &source(driving));
        let out = named.join("record");
        Pdk::new(["run", "--workers", "1", "--out"]).arg(&out).arg(&script).succeed();
        let mut found = files(&out);
        assert_eq!(lines(&out.join("scenarios.jsonl")), 24);
        // It holds the text of the pipeline.
        found.remove(Path::new("manifest.json"));
        match &expected {
            None => expected = Some(found),
            Some(expected) => assert!(found == *expected, "{name} differs from all at once"),
        }
    }
}
