//! A run that was killed goes on where it was, and ends as if nothing had happened.

#![allow(clippy::unwrap_used)]

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use pdk_tests::process::pipeline;
use pdk_tests::{Pdk, temp};

/// Two drives of eight scenarios each, of which the second needs what the first returned.
const SOURCE: &str = r#"
    local settings = pdk.settings({ duration = 2, tuning = { level = 1 } })
    local simulator = { name = "lane", width = 80, height = 60, rate = 20 }
    local road = { angles = { 0, 4, -4, 4, -4 }, segment = 10 }
    local function drive(level)
        local scenarios = {}
        for seed = 1, 8 do
            table.insert(scenarios, { road = road, seed = seed, perturbations = { "gaussian_noise@" .. level, "contrast@1" } })
        end
        return pdk.drive({ simulator = simulator, driver = "lane_keeper", duration = settings.duration, scenarios = scenarios })
    end
    local first = drive(settings.tuning.level)
    pdk.show(drive(first[1].max_cross_track_error < 100 and 2 or 3))
"#;

fn run(script: &Path, out: &Path) -> Pdk {
    Pdk::new(["run", "--threads", "2", "--out"]).arg(out).arg(script)
}

/// All files of a record but the one with times.
fn files(record: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let entries = |folder: &Path| fs::read_dir(folder).unwrap().map(|entry| entry.unwrap().path());
    entries(record)
        .chain(entries(&record.join("traces")))
        .filter(|path| path.is_file() && !path.ends_with("performance.json"))
        .map(|path| (path.strip_prefix(record).unwrap().to_owned(), fs::read(path).unwrap()))
        .collect()
}

fn assert_equal(record: &Path, expected: &BTreeMap<PathBuf, Vec<u8>>) {
    let files = files(record);
    assert_eq!(files.keys().collect::<Vec<_>>(), expected.keys().collect::<Vec<_>>());
    for (path, bytes) in files {
        assert!(bytes == expected[&path], "{} differs", path.display());
    }
}

/// Runs until so many lines are recorded, and kills.
fn killed_after(script: &Path, out: &Path, lines: usize) {
    let mut child = run(script, out).spawn();
    let started = Instant::now();
    let count = || fs::read_to_string(out.join("scenarios.jsonl")).map_or(0, |text| text.lines().count());
    while count() < lines && child.try_wait().unwrap().is_none() {
        assert!(started.elapsed() < Duration::from_secs(60), "line {lines} did not come");
        std::thread::sleep(Duration::from_millis(1));
    }
    child.kill().unwrap();
    child.wait().unwrap();
}

#[test]
fn a_killed_run_goes_on_and_ends_like_an_undisturbed_one() {
    let folder = temp();
    let script = pipeline(folder.path(), SOURCE);
    let whole = folder.path().join("whole");
    run(&script, &whole).succeed();
    let expected = files(&whole);
    for lines in [0, 1, 5, 8, 11, 15] {
        let out = folder.path().join(format!("killed-{lines}"));
        killed_after(&script, &out, lines);
        run(&script, &out).succeed();
        assert_equal(&out, &expected);
    }
    // Killed again and again.
    let out = folder.path().join("often");
    for lines in [1, 4, 9] {
        killed_after(&script, &out, lines);
    }
    run(&script, &out).succeed();
    assert_equal(&out, &expected);
}

#[test]
fn what_was_in_flight_is_driven_again() {
    let folder = temp();
    let script = pipeline(folder.path(), SOURCE);
    let out = folder.path().join("record");
    run(&script, &out).succeed();
    let expected = files(&out);
    // Six scenarios are complete, the seventh line is cut off and its trace ends early; there is no summary yet.
    let lines = out.join("scenarios.jsonl");
    let text = fs::read_to_string(&lines).unwrap();
    let end: usize = text.split_inclusive('\n').take(6).map(str::len).sum();
    fs::write(&lines, &text[..end + 40]).unwrap();
    for index in 7..16 {
        fs::remove_file(out.join(format!("traces/{index:04}.mcap"))).unwrap();
    }
    fs::write(out.join("traces/0006.mcap"), b"half a trace").unwrap();
    fs::remove_file(out.join("summary.json")).unwrap();
    let ran = run(&script, &out).succeed();
    assert!(
        ran.stdout.contains("6 of 8 scenarios are in the record already; driving the other 2"),
        "{}",
        ran.stdout
    );
    assert_equal(&out, &expected);
}

#[test]
fn a_finished_record_is_shown_again() {
    let folder = temp();
    let script = pipeline(folder.path(), SOURCE);
    let out = folder.path().join("record");
    let first = run(&script, &out).succeed();
    let (expected, times) = (files(&out), fs::read(out.join("performance.json")).unwrap());
    let second = run(&script, &out).succeed();
    assert!(second.stdout.contains("8 of 8 scenarios are in the record already; nothing is left to drive"));
    let table = |text: &str| {
        text.lines().filter(|line| line.contains("gaussian_noise@2")).map(str::to_owned).collect::<Vec<_>>()
    };
    assert_eq!(table(&first.stdout).len(), 8);
    assert_eq!(table(&first.stdout), table(&second.stdout));
    assert_equal(&out, &expected);
    assert_eq!(fs::read(out.join("performance.json")).unwrap(), times);
}

#[test]
fn the_record_of_another_run_is_refused_and_kept() {
    let folder = temp();
    let script = pipeline(folder.path(), SOURCE);
    let out = folder.path().join("record");
    run(&script, &out).succeed();
    let expected = files(&out);
    let again = || run(&script, &out);
    again().args(["--seed", "7"]).fail(1, &["another run: the seed was 0 and is 7", "--out"]);
    again().set("tuning.level", 2).fail(1, &["the setting `tuning.level` was 1 and is 2", "--out"]);
    let other = folder.path().join("other");
    fs::create_dir(&other).unwrap();
    let other = pipeline(&other, &SOURCE.replace("contrast@1", "contrast@2"));
    run(&other, &out).fail(1, &["the text of the pipeline", "--out"]);
    assert_equal(&out, &expected);

    // The record says something else of a scenario, or of a component.
    let lines = out.join("scenarios.jsonl");
    let text = fs::read_to_string(&lines).unwrap();
    fs::write(&lines, text.replacen("\"seed\":3", "\"seed\":4", 1)).unwrap();
    again().fail(1, &["scenario 2 ", "was recorded as another one", "--out"]);
    fs::write(&lines, &text).unwrap();
    let manifest = out.join("manifest.json");
    let kept = fs::read_to_string(&manifest).unwrap();
    let start = kept.find("\"blake3\": \"").unwrap() + 11;
    fs::write(&manifest, format!("{}{}{}", &kept[..start], "0".repeat(64), &kept[start + 64..])).unwrap();
    again().fail(1, &["the file of the", "is another", "--out"]);
    fs::write(&manifest, kept).unwrap();
    assert_equal(&out, &expected);

    fs::write(out.join("notes.txt"), "mine").unwrap();
    again().fail(1, &["is not empty", "--out"]);
    fs::remove_file(out.join("notes.txt")).unwrap();
    fs::write(out.join("results.jsonl"), "").unwrap();
    again().fail(1, &["holds results of pdk.evaluate, which cannot be continued", "--out"]);
}

#[test]
fn two_processes_do_not_write_to_one_record() {
    let folder = temp();
    let script = pipeline(folder.path(), &SOURCE.replace("seed = 1, 8", "seed = 1, 2000"));
    let out = folder.path().join("record");
    let mut child = run(&script, &out).spawn();
    let started = Instant::now();
    while !out.join("scenarios.jsonl").exists() {
        assert!(started.elapsed() < Duration::from_secs(60), "the run did not begin");
        std::thread::sleep(Duration::from_millis(5));
    }
    run(&script, &out).fail(1, &["another process is writing to", "--out"]);
    child.kill().unwrap();
    child.wait().unwrap();
}
