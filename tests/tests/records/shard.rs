//! Runs in parts: put together they are the run as a whole, and what cannot be put together is said.

use std::path::{Path, PathBuf};

use pdk_tests::process::{json_lines, pipeline};
use pdk_tests::records::{assert_equal, files};
use pdk_tests::{Pdk, datasets, temp};

const SOURCE: &str = r#"
    local settings = pdk.settings({ scenarios = 7, levels = { 1, 3 } })
    for _, level in settings.levels do
        local scenarios = {}
        for number = 1, settings.scenarios do
            table.insert(scenarios, { ["repeat"] = number, perturbations = { "gaussian_noise@" .. level } })
        end
        pdk.show(pdk.drive({
            simulator = { name = "lane", width = 64, height = 48 }, driver = "lane_keeper", duration = 0.5, images_every = 5,
            scenarios = scenarios,
        }))
    end
"#;

fn run(script: &Path, out: &Path) -> Pdk {
    Pdk::new(["run", "--out"]).arg(out).arg(script)
}

fn merge(parts: &[PathBuf], out: &Path) -> Pdk {
    Pdk::new(["merge", "--out"]).arg(out).args(parts)
}

/// Runs all parts, and returns their folders.
fn parts(script: &Path, folder: &Path, of: usize) -> Vec<PathBuf> {
    (1..=of)
        .map(|index| {
            let out = folder.join(format!("{index}of{of}"));
            let finished = run(script, &out).args(["--shard", &format!("{index}/{of}")]).succeed();
            assert!(
                finished.stdout.contains(&format!("part {index}/{of} of the run")),
                "{}",
                finished.stdout
            );
            // What a part would show is not what the whole shows.
            assert!(!finished.stdout.contains("gaussian_noise"), "{}", finished.stdout);
            out
        })
        .collect()
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn parts_put_together_are_the_whole() {
    let folder = temp();
    let script = pipeline(folder.path(), SOURCE);
    let whole = folder.path().join("whole");
    run(&script, &whole).succeed();
    let expected = files(&whole);
    // More parts than scenarios leave some parts with nothing to do.
    for of in [1, 3, 16] {
        let parts = parts(&script, folder.path(), of);
        let out = folder.path().join(format!("merged{of}"));
        let finished = merge(&parts, &out).succeed();
        assert!(finished.stdout.contains(&format!("14 scenarios of {of} parts")), "{}", finished.stdout);
        let ledger = |out: &Path| std::fs::read_to_string(out.join("scenarios.jsonl")).unwrap();
        assert_eq!(ledger(&out), ledger(&whole));
        let finished = run(&script, &out).succeed();
        assert!(
            finished.stdout.contains("14 of 14 scenarios were in the record already"),
            "{}",
            finished.stdout
        );
        assert_equal(&out, &expected);
    }
    let replayed = Pdk::new(["replay"]).arg(folder.path().join("merged3")).succeed();
    assert!(replayed.stdout.contains("14 of 14 equal"), "{}", replayed.stdout);
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn evaluations_in_parts_put_together_are_the_whole() {
    let folder = temp();
    datasets::folder(&folder.path().join("data"), 9, 32, 24);
    // One image that cannot be read is said by the whole, and by the part that has it.
    std::fs::write(folder.path().join("data/4_camera.jpg"), "no image").unwrap();
    let source = "
        local function evaluate(levels)
            pdk.show(pdk.evaluate({
                dataset = pdk.path('data'), driver = 'lane_keeper', perturbations = { 'gaussian_noise' }, levels = levels,
            }))
        end
        evaluate({ 1, 3 })
        pdk.drive({
            simulator = { name = 'lane', width = 64, height = 48 }, driver = 'lane_keeper', duration = 0.5, scenarios = { {} },
        })
        evaluate({ 2 })
    ";
    let script = pipeline(folder.path(), source);
    let whole = folder.path().join("whole");
    run(&script, &whole).succeed();
    let expected = files(&whole);
    for of in [2, 12] {
        let parts = parts(&script, folder.path(), of);
        let out = folder.path().join(format!("merged{of}"));
        let finished = merge(&parts, &out).succeed();
        assert!(finished.stdout.contains("1 scenarios and 18 evaluated frames"), "{}", finished.stdout);
        let results = |out: &Path| std::fs::read_to_string(out.join("results.jsonl")).unwrap();
        assert_eq!(results(&out), results(&whole));
        run(&script, &out).succeed();
        assert_equal(&out, &expected);
    }
    // A part that has lost a line.
    let part = folder.path().join("1of2");
    let results = std::fs::read_to_string(part.join("results.jsonl")).unwrap();
    std::fs::write(part.join("results.jsonl"), results.split_once('\n').unwrap().0).unwrap();
    let both = [part, folder.path().join("2of2")];
    merge(&both, &folder.path().join("out")).fail(1, &["no part has frame", "--out"]);
}

#[test]
fn a_part_goes_on_as_itself_only() {
    let folder = temp();
    let script = pipeline(folder.path(), SOURCE);
    let out = folder.path().join("out");
    run(&script, &out).args(["--shard", "2/3"]).succeed();
    let before = files(&out);
    let finished = run(&script, &out).set("shard", "2/3").succeed();
    assert!(finished.stdout.contains("5 of 14 scenarios were in the record already"), "{}", finished.stdout);
    assert_equal(&out, &before);
    run(&script, &out).args(["--shard", "1/3"]).fail(1, &["the part of the run was 2/3 and is 1/3"]);
    run(&script, &out).fail(1, &["the part of the run was 2/3 and is the whole"]);
}

#[test]
fn shards_that_do_not_belong_together_are_reported() {
    let folder = temp();
    let script = pipeline(folder.path(), SOURCE);
    let parts = parts(&script, folder.path(), 3);
    let out = folder.path().join("out");
    let whole = folder.path().join("whole");
    run(&script, &whole).succeed();
    merge(&parts[..2], &out).fail(1, &["of 3 parts these are missing: 3"]);
    merge(&[parts[0].clone(), parts[0].clone()], &out).fail(1, &["are the same part, 1/3"]);
    merge(std::slice::from_ref(&whole), &out).fail(1, &["is the record of a whole run"]);
    merge(&[folder.path().join("nothing")], &out).fail(1, &["holds no record"]);
    merge(&parts, &whole).fail(1, &["holds a record already"]);
    let other = folder.path().join("other");
    run(&script, &other).args(["--shard", "3/3", "--seed", "1"]).succeed();
    merge(&[parts[0].clone(), parts[1].clone(), other], &out).fail(1, &["is of another run", "the seed was"]);
    let quarter = folder.path().join("quarter");
    run(&script, &quarter).args(["--shard", "3/4"]).succeed();
    merge(&[parts[0].clone(), quarter], &out).fail(1, &["another division of the run"]);
    // A part that was killed.
    std::fs::remove_file(parts[2].join("shard.json")).unwrap();
    merge(&parts, &out).fail(1, &["part 3/3", "has not come to its end", "--out"]);
    assert!(!out.exists());
}

#[test]
fn a_pipeline_that_looks_at_outcomes_is_not_put_together() {
    let folder = temp();
    let shared =
        "simulator = { name = 'lane', width = 64, height = 48 }, driver = 'lane_keeper', duration = 0.5";
    let source = format!(
        "local first = pdk.drive({{ {shared}, scenarios = {{ {{}}, {{ ['repeat'] = 1 }}, {{ ['repeat'] = 2 }} }} }})
         for number, outcome in first do
             if outcome.cause == 'time_out' then
                 pdk.drive({{ {shared}, scenarios = {{ {{ ['repeat'] = 10 + number }} }} }})
             end
         end"
    );
    let script = pipeline(folder.path(), &source);
    let both = [1, 2].map(|index| {
        let out = folder.path().join(index.to_string());
        run(&script, &out).args(["--shard", &format!("{index}/2")]).succeed();
        out
    });
    merge(&both, &folder.path().join("out")).fail(1, &["decides by outcomes what to drive", "--pool"]);
    let search = Pdk::new(["run", "search", "--shard", "1/2", "--out"]).arg(folder.path().join("search"));
    search.fail(
        1,
        &["pdk.search decides by outcomes", "leave out --shard", "grid, latin_hypercube, random, sobol"],
    );
    run(&script, &folder.path().join("no"))
        .set("shard", "3")
        .fail(1, &["--set shard: `3` is not a part of a run"]);
}

#[test]
fn a_search_that_learns_nothing_is_run_in_parts() {
    let folder = temp();
    let source = |stop: &str| {
        format!(
            "local found = pdk.search({{
                 space = {{ level = {{ real = {{ 0, 4 }} }}, name = {{ choice = {{ 'gaussian_noise', 'fog_filter' }} }} }},
                 objectives = {{ max_cross_track_error = 'maximise' }},
                 strategy = 'sobol',
                 stop = {{ {stop} }},
                 simulator = {{ name = 'lane', width = 64, height = 48 }}, driver = 'lane_keeper', duration = 0.5,
                 evaluate = function(values)
                     return {{ perturbations = {{ {{ name = values.name, level = values.level }} }} }}
                 end,
             }})
             pdk.show(pdk.drive({{
                 simulator = {{ name = 'lane', width = 64, height = 48 }}, driver = 'lane_keeper', duration = 0.5,
                 scenarios = {{ {{ ['repeat'] = #found.tests }} }},
             }}))"
        )
    };
    let script = pipeline(folder.path(), &source("evaluations = 7"));
    let whole = folder.path().join("whole");
    run(&script, &whole).succeed();
    let parts = [1, 2, 3].map(|index| {
        let out = folder.path().join(index.to_string());
        run(&script, &out).args(["--shard", &format!("{index}/3")]).set("workers", index).succeed();
        out
    });
    assert_eq!(parts.each_ref().map(|part| json_lines(&part.join("scenarios.jsonl")).len()), [3, 3, 2]);
    let merged = folder.path().join("merged");
    merge(&parts, &merged).succeed();
    let finished = run(&script, &merged).succeed();
    assert!(finished.stdout.contains("8 of 8 scenarios were in the record already"), "{}", finished.stdout);
    for file in ["scenarios.jsonl", "search.json", "search.csv"] {
        let [a, b] = [&whole, &merged].map(|record| std::fs::read_to_string(record.join(file)).unwrap());
        assert_eq!(a, b, "{file}");
    }
    let script = pipeline(folder.path(), &source("evaluations = 7, seconds = 60"));
    run(&script, &folder.path().join("late"))
        .args(["--shard", "1/3"])
        .fail(1, &["`seconds`", "let it stop by `evaluations`"]);
}
