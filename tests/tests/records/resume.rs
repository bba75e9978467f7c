//! A run that was killed goes on where it was, and ends as if nothing had happened.

use std::fs;
use std::path::Path;

use pdk_tests::process::{json_file, json_lines, pipeline};
use pdk_tests::records::{assert_equal, files, trace, wait_for_lines, wait_for_scenarios};
use pdk_tests::{Pdk, datasets, temp};

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
    Pdk::new(["run", "--workers", "2", "--out"]).arg(out).arg(script)
}

/// Runs until this many lines are recorded, and kills.
fn killed_after(script: &Path, out: &Path, lines: usize) {
    let mut child = run(script, out).spawn();
    wait_for_scenarios(&mut child, out, lines);
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
    let scenarios = json_lines(&out.join("scenarios.jsonl"));
    let lines = out.join("scenarios.jsonl");
    let text = fs::read_to_string(&lines).unwrap();
    let end: usize = text.split_inclusive('\n').take(6).map(str::len).sum();
    fs::write(&lines, &text[..end + 40]).unwrap();
    for scenario in &scenarios[7..] {
        fs::remove_file(trace(&out, scenario)).unwrap();
    }
    let seventh = trace(&out, &scenarios[6]);
    fs::remove_file(&seventh).unwrap();
    fs::write(seventh.with_extension("mcap.part"), b"half a trace").unwrap();
    fs::remove_file(out.join("summary.json")).unwrap();
    let ran = run(&script, &out).succeed();
    assert!(ran.stdout.contains("\n6 of 16 scenarios were in the record already\n"), "{}", ran.stdout);
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
    assert!(second.stdout.contains("\n16 of 16 scenarios were in the record already\n"), "{}", second.stdout);
    assert!(!second.stdout.contains("a second"), "nothing was driven: {}", second.stdout);
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

    // A line was edited, or the record says something else of a component.
    let lines = out.join("scenarios.jsonl");
    let text = fs::read_to_string(&lines).unwrap();
    fs::write(&lines, text.replacen("\"seed\":3", "\"seed\":4", 1)).unwrap();
    again().fail(1, &["scenarios.jsonl:3 is damaged or was edited", "delete it and run the pipeline again"]);
    // As the sentence says.
    let without: String =
        text.split_inclusive('\n').enumerate().filter(|(n, _)| *n != 2).map(|(_, l)| l).collect();
    fs::write(&lines, without).unwrap();
    let ran = again().succeed();
    assert!(ran.stdout.contains("\n15 of 16 scenarios were in the record already\n"), "{}", ran.stdout);
    assert_equal(&out, &expected);
    let manifest = out.join("manifest.json");
    let kept = fs::read_to_string(&manifest).unwrap();
    let start = kept.find("\"blake3\": \"").unwrap() + 11;
    fs::write(&manifest, format!("{}{}{}", &kept[..start], "0".repeat(64), &kept[start + 64..])).unwrap();
    again().fail(1, &["the file of the", "is not that of the plugin", "--out"]);
    fs::write(&manifest, kept).unwrap();
    assert_equal(&out, &expected);

    fs::write(out.join("notes.txt"), "mine").unwrap();
    again().fail(1, &["is not empty", "--out"]);
    fs::remove_file(out.join("notes.txt")).unwrap();
    assert_equal(&out, &expected);
}

/// What another scenario is driven with does not matter to one whose line is there.
#[test]
fn a_pipeline_that_asks_for_more_drives_only_what_is_new() {
    let folder = temp();
    let source = r#"
        -- What decides comes from outside of the text and the settings.
        local known = pcall(require, "./more")
        local scenarios = { { seed = 5 } }
        if known then
            table.insert(scenarios, 1, { seed = 6 })
        end
        local outcomes = pdk.drive({ simulator = "misbehave", driver = "misbehave", scenarios = scenarios })
        for number, outcome in outcomes do
            assert(outcome.number == number - 1)
        end
    "#;
    let script = pipeline(folder.path(), source);
    let out = folder.path().join("record");
    let again = || run(&script, &out).misbehave();
    again().succeed();
    let first = json_lines(&out.join("scenarios.jsonl")).remove(0);
    fs::write(folder.path().join("more.luau"), "return {}").unwrap();
    let ran = again().succeed();
    assert!(
        ran.stdout.contains("1 of 2 scenarios were in the record already\n21 frames in "),
        "{}",
        ran.stdout
    );
    let lines = json_lines(&out.join("scenarios.jsonl"));
    assert_eq!((lines.len(), &lines[1]), (2, &first), "in the order in which they were asked for");
}

#[test]
fn an_offline_run_goes_on_behind_the_last_whole_frame() {
    let folder = temp();
    datasets::folder(&folder.path().join("data"), 12, 32, 24);
    let source = r#"
        local request = { dataset = pdk.path("data"), driver = "misbehave", levels = { 2, 4 },
            perturbations = { "contrast", "gaussian_noise" } }
        pdk.evaluate(request)
        request.frames = 5
        pdk.evaluate(request)
    "#;
    let script = pipeline(folder.path(), source);
    let out = folder.path().join("record");
    let again = || run(&script, &out).misbehave().succeed();
    let whole = again();
    assert!(
        whole.stdout.contains("48 perturbed frames in ") && whole.stdout.contains("20 perturbed frames in ")
    );
    let expected = files(&out);
    let results = fs::read(out.join("results.jsonl")).unwrap();
    let lines: Vec<&[u8]> = results.split_inclusive(|byte| *byte == b'\n').collect();
    assert_eq!(lines.len(), 48 + 20);
    // Within a line, between two lines of a frame, between two frames, and in the second evaluation: the frames of a piece are driven
    // again together.
    for (kept, more, new) in
        [(6, 9, [Some(48), Some(20)]), (9, 0, [Some(48), Some(20)]), (48 + 8, 0, [None, Some(20)])]
    {
        let length = lines[..kept].iter().map(|line| line.len()).sum::<usize>() + more;
        fs::write(out.join("results.jsonl"), &results[..length]).unwrap();
        fs::remove_file(out.join("summary.json")).unwrap();
        let ran = again();
        let said =
            ran.stdout.lines().filter_map(|line| line.split_once(" perturbed frames in ")?.0.parse().ok());
        assert_eq!(
            said.collect::<Vec<u64>>(),
            new.into_iter().flatten().collect::<Vec<_>>(),
            "{}",
            ran.stdout
        );
        assert_equal(&out, &expected);
    }
    let ran = again();
    assert!(!ran.stdout.contains("perturbed frames"), "nothing is left to do: {}", ran.stdout);
    assert_equal(&out, &expected);
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn a_killed_offline_run_loses_only_what_was_under_way() {
    let folder = temp();
    datasets::folder(&folder.path().join("data"), 2200, 24, 16);
    let source = r#"
        pdk.evaluate({ dataset = pdk.path("data"), driver = "misbehave", levels = { 2, 4 }, trust = true,
            perturbations = { "contrast", "gaussian_noise", "gaussian_blur", "poisson_noise" } })
    "#;
    let script = pipeline(folder.path(), source);
    let (undisturbed, out) = (folder.path().join("undisturbed"), folder.path().join("record"));
    run(&script, &undisturbed).misbehave().succeed();
    assert!(!undisturbed.join("results.journal").exists());
    let mut child = run(&script, &out).misbehave().spawn();
    // The frames as they are, in three pieces, and two of the eight cells of the first piece.
    wait_for_lines(&mut child, &out.join("results.journal"), 5);
    child.kill().unwrap();
    child.wait().unwrap();
    let known = fs::read_to_string(out.join("results.journal")).unwrap();
    assert!(!out.join("summary.json").exists(), "it was over before it was killed");
    let known = known.lines().count();
    let ran = run(&script, &out).misbehave().succeed();
    let driven: usize = ran
        .stdout
        .lines()
        .find_map(|line| line.split_once(" perturbed frames in ")?.0.parse().ok())
        .unwrap_or_else(|| panic!("{}", ran.stdout));
    // Of a piece that is among the results already there are no lines any more.
    assert!(driven <= 2200 * 8 - 2 * 1000 || known < 5, "{driven} of {}", 2200 * 8);
    assert!(!out.join("results.journal").exists());
    assert_equal(&out, &files(&undisturbed));
}

#[test]
fn two_processes_do_not_write_to_one_record() {
    let folder = temp();
    let script = pipeline(folder.path(), &SOURCE.replace("seed = 1, 8", "seed = 1, 2000"));
    let out = folder.path().join("record");
    let mut child = run(&script, &out).spawn();
    wait_for_scenarios(&mut child, &out, 1);
    run(&script, &out).fail(1, &["another process is writing to", "--out"]);
    child.kill().unwrap();
    child.wait().unwrap();
}

#[test]
fn the_lock_of_a_record_is_more_than_a_file() {
    let folder = temp();
    let script = pipeline(folder.path(), &SOURCE.replace("seed = 1, 8", "seed = 1, 2000"));
    let out = folder.path().join("record");
    let mut child = run(&script, &out).spawn();
    wait_for_scenarios(&mut child, &out, 1);
    fs::remove_file(out.join(".lock")).unwrap();
    run(&script, &out).fail(1, &["another process is writing to", "--out"]);
    child.kill().unwrap();
    child.wait().unwrap();
}

#[test]
fn a_pipeline_that_was_moved_goes_on() {
    let folder = temp();
    let out = folder.path().join("record");
    run(&pipeline(folder.path(), SOURCE), &out).succeed();
    let scenarios = fs::read(out.join("scenarios.jsonl")).unwrap();
    let moved = folder.path().join("moved");
    fs::create_dir(&moved).unwrap();
    let script = pipeline(&moved, SOURCE);
    let ran = run(&script, &out).succeed();
    assert!(ran.stdout.contains("16 of 16 scenarios were in the record already"), "{}", ran.stdout);
    assert_eq!(fs::read(out.join("scenarios.jsonl")).unwrap(), scenarios);
    assert_eq!(json_file(&out.join("manifest.json"))["pipeline"]["path"], script.to_str().unwrap());
}

#[test]
fn a_scenario_whose_trace_is_not_whole_is_driven_again() {
    let folder = temp();
    let script = pipeline(folder.path(), SOURCE);
    let whole = folder.path().join("whole");
    run(&script, &whole).succeed();
    let expected = files(&whole);
    let scenarios = json_lines(&whole.join("scenarios.jsonl"));
    let traces = [0, 1, 2, 3].map(|number| trace(&whole, &scenarios[number]));
    fs::write(&traces[0], "").unwrap();
    fs::write(&traces[1], "no trace at all").unwrap();
    fs::remove_file(&traces[2]).unwrap();
    let mut damaged = fs::read(&traces[3]).unwrap();
    let middle = damaged.len() / 2;
    damaged[middle] ^= 0x10;
    fs::write(&traces[3], damaged).unwrap();
    let again = run(&script, &whole).succeed();
    assert_eq!(again.stderr.matches("is driven again: the trace ").count(), 4, "{}", again.stderr);
    let kept = format!("{} of {} scenarios were in the record already", scenarios.len() - 4, scenarios.len());
    assert!(again.stdout.contains(&kept), "{}", again.stdout);
    assert_equal(&whole, &expected);
}
