//! Ctrl-C, TERM and scripts that do not end: what is in flight is finished, what is recorded is whole, and goes on later.

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::{Path, PathBuf};
use std::process::Child;
use std::time::Duration;

use pdk_tests::process::{LIMIT, json_file, json_lines, pipeline};
use pdk_tests::processes::{BusFolder, comes_true, ended_within, signal, takes};
use pdk_tests::records::{assert_equal, files, lines, partial, wait_for_lines, wait_for_scenarios};
use pdk_tests::{Pdk, datasets, temp};
use rustix::process::Signal;

/// Many scenarios, all at once.
const AT_ONCE: &str = r#"
    local scenarios = {}
    for number = 1, 24 do
        table.insert(scenarios, { road = { angles = { 0, number % 9 }, segment = 20 }, ["repeat"] = number, duration = number % 2 + 3 })
    end
    pdk.drive({
        simulator = { name = "lane", width = 160, height = 120 }, driver = "lane_keeper", images_every = 10, scenarios = scenarios,
    })
"#;

/// The same in a session, of which the last outcome is waited for first.
const IN_A_SESSION: &str = r#"
    local session = pdk.session({ simulator = { name = "lane", width = 160, height = 120 }, driver = "lane_keeper", images_every = 10 })
    local last
    for number = 1, 24 do
        last = session:submit({ road = { angles = { 0, number % 9 }, segment = 20 }, ["repeat"] = number, duration = number % 2 + 3 })
    end
    session:wait(last)
    while session:next() do
    end
"#;

/// What an interrupted run says.
const SAID: &str = "the run was interrupted; what was recorded is kept, and the same command with --out and the folder of the record goes on";

fn run(script: &Path, out: &Path) -> Pdk {
    Pdk::new(["run", "--workers", "2", "--out"]).arg(out).arg(script)
}

/// Waits for the end of a run that was told to end; the exit code, and what it reported as its error.
#[track_caller]
fn end(mut child: Child) -> (Option<i32>, Vec<String>) {
    let status = ended_within(&mut child, LIMIT);
    if status.is_none() {
        child.kill().unwrap();
    }
    let output = child.wait_with_output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr).into_owned();
    let status = status.unwrap_or_else(|| panic!("it has not ended after {} s: {stderr}", LIMIT.as_secs()));
    let said =
        stderr.lines().filter_map(|line| line.strip_prefix("pdk: error: ")).map(str::to_owned).collect();
    (status.code(), said)
}

/// Makes sure that a record that was broken off has a whole trace for each line, and nothing else. How many lines it has.
#[track_caller]
fn is_whole(record: &Path) -> usize {
    let lines = json_lines(&record.join("scenarios.jsonl"));
    for line in &lines {
        let path = record.join(format!("traces/{}.mcap", line["id"].as_str().unwrap()));
        let bytes = fs::read(&path).unwrap();
        let messages =
            mcap::MessageStream::new(&bytes).unwrap().inspect(|message| assert!(message.is_ok())).count();
        assert!(
            messages as u64 > line["frames"].as_u64().unwrap(),
            "{}: {messages} messages",
            path.display()
        );
    }
    let traces = files(record).into_keys().filter(|path| path.starts_with("traces")).count();
    assert_eq!(traces, lines.len());
    assert_eq!(partial(record), Vec::<PathBuf>::new());
    lines.len()
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn the_first_interrupt_lets_what_is_in_flight_finish() {
    let folder = temp();
    for (name, source) in [("at-once", AT_ONCE), ("session", IN_A_SESSION)] {
        let place = folder.path().join(name);
        fs::create_dir(&place).unwrap();
        let script = pipeline(&place, source);
        let whole = place.join("whole");
        run(&script, &whole).succeed();
        let bus = BusFolder::new();
        let (variable, value) = bus.variable();
        // Now and then both workers have just finished when the signal comes, and nothing is in flight.
        let interrupted = (0..10).find_map(|attempt| {
            let out = place.join(format!("record-{attempt}"));
            let mut child = run(&script, &out).env(variable, value).spawn();
            wait_for_scenarios(&mut child, &out, 4);
            signal(&child, Signal::INT);
            let at_signal = lines(&out.join("scenarios.jsonl"));
            let (code, said) = end(child);
            assert_eq!(code, Some(130), "{name}: {said:?}");
            assert_eq!(said.len(), 1, "{name}: {said:?}");
            assert!(said[0].contains(SAID), "{name}: {said:?}");
            let recorded = is_whole(&out);
            // Two workers were at work, and each was given no other scenario than that at hand.
            assert!(
                (at_signal..=at_signal + 3).contains(&recorded),
                "{name}: {at_signal} lines at the signal, {recorded} at the end"
            );
            (recorded > at_signal).then_some((out, recorded))
        });
        let (out, recorded) = interrupted.expect("what was in flight was never finished");
        let summary = json_file(&out.join("summary.json"));
        assert_eq!(summary["outcomes"].as_array().unwrap().len(), recorded, "{name}: {summary}");
        assert!(comes_true(LIMIT, || bus.processes().is_empty()), "{name}: {:?}", bus.processes());
        assert_eq!(bus.left(), Vec::<PathBuf>::new(), "{name}");
        let ran = run(&script, &out).succeed();
        let kept = format!("{recorded} of 24 scenarios were in the record already");
        assert!(ran.stdout.contains(&kept), "{name}: {}", ran.stdout);
        assert_equal(&out, &files(&whole));
    }
}

#[test]
fn the_second_interrupt_and_term_drop_what_is_in_flight() {
    let folder = temp();
    // Some short scenarios, and then some that take a day.
    let source = r#"
        local settings = pdk.settings({ long = true })
        local scenarios = {}
        for number = 1, 4 do
            table.insert(scenarios, { ["repeat"] = number, duration = 0.5 })
        end
        local simulator = { name = "lane", width = 64, height = 48 }
        pdk.drive({ simulator = simulator, driver = "lane_keeper", scenarios = scenarios })
        if settings.long then
            local stands = { name = "misbehave", how = "hang_in_reset" }
            pdk.drive({ simulator = simulator, driver = stands, scenarios = { { ["repeat"] = 1 }, { ["repeat"] = 2 }, { ["repeat"] = 3 } } })
        end
    "#;
    let script = pipeline(folder.path(), source);
    for (name, code) in [("int", 130), ("term", 143)] {
        let bus = BusFolder::new();
        let (variable, value) = bus.variable();
        let out = folder.path().join(name);
        let mut child = run(&script, &out).misbehave().env(variable, value).spawn();
        wait_for_scenarios(&mut child, &out, 4);
        // Both workers are at it: the traces of the short scenarios are whole by now.
        assert!(
            comes_true(LIMIT, || partial(&out.join("traces")).len() == 2),
            "{name}: {:?}",
            partial(&out.join("traces"))
        );
        if code == 130 {
            signal(&child, Signal::INT);
            assert!(
                ended_within(&mut child, Duration::from_secs(2)).is_none(),
                "it does not wait for what is in flight"
            );
            signal(&child, Signal::INT);
        } else {
            signal(&child, Signal::TERM);
        }
        let (found, said) = end(child);
        assert_eq!(found, Some(code), "{name}: {said:?}");
        assert!(said.len() == 1 && said[0].contains(SAID), "{name}: {said:?}");
        // What was dropped has no line, as it would have if the run had waited until its patience with the driver was over.
        assert_eq!(is_whole(&out), 4);
        assert!(out.join("summary.json").is_file());
        assert!(comes_true(LIMIT, || bus.processes().is_empty()), "{name}: {:?}", bus.processes());
        assert_eq!(bus.left(), Vec::<PathBuf>::new(), "{name}");
    }
    // What is there is what a run has that was never interrupted.
    let ledger = |name: &str| fs::read(folder.path().join(name).join("scenarios.jsonl")).unwrap();
    run(&script, &folder.path().join("short")).misbehave().set("long", "false").succeed();
    assert!(ledger("int") == ledger("short") && ledger("term") == ledger("short"));
}

/// Whether a run has come so far, from its record and its processes.
type Come = fn(&Child, &BusFolder, &Path) -> bool;

/// What a run does at its beginning, in this order.
const BEGINNING: [Come; 7] = [
    |_, _, _| true,
    |child, _, _| takes(child, Signal::INT) && takes(child, Signal::TERM),
    |_, bus, _| bus.processes().iter().any(|process| process.command.ends_with(" worker")),
    |_, bus, _| bus.processes().iter().any(|process| process.command.ends_with(" worker --components")),
    |_, _, out| out.is_dir(),
    |_, bus, _| !bus.buses().is_empty(),
    |_, _, out| !partial(out).is_empty(),
];

#[test]
fn a_run_that_has_hardly_begun_can_be_ended() {
    let folder = temp();
    let script = pipeline(folder.path(), AT_ONCE);
    for (sent, code) in [(Signal::INT, 130), (Signal::TERM, 143)] {
        for (number, when) in BEGINNING.into_iter().enumerate() {
            let bus = BusFolder::new();
            let (variable, value) = bus.variable();
            let out = folder.path().join(format!("{code}-{number}"));
            let child = run(&script, &out).env(variable, value).spawn();
            assert!(comes_true(LIMIT, || when(&child, &bus, &out)), "{number} has not begun");
            signal(&child, sent);
            let (found, said) = end(child);
            // Before it watches for signals, they end it like any program.
            assert!(
                found == Some(code) && said.len() == 1 || number == 0 && found.is_none() && said.is_empty(),
                "{number}: {found:?} {said:?}"
            );
            if out.join("scenarios.jsonl").is_file() {
                json_lines(&out.join("scenarios.jsonl"));
                assert_eq!(partial(&out), Vec::<PathBuf>::new(), "{number}");
            }
            assert!(comes_true(LIMIT, || bus.processes().is_empty()), "{number}: {:?}", bus.processes());
            assert_eq!(bus.left(), Vec::<PathBuf>::new(), "{number}");
        }
    }
}

#[test]
fn what_is_dropped_keeps_what_an_earlier_process_recorded() {
    let folder = temp();
    let script = pipeline(
        folder.path(),
        r#"
        pdk.drive({ simulator = "misbehave", scenarios = {
            { name = "hangs", driver = { name = "misbehave", how = "hang_in_reset" } },
            { name = "aborts", driver = { name = "misbehave", how = "abort_in_drive" } },
        } })
        "#,
    );
    let out = folder.path().join("record");
    // First one worker hangs and the other one aborts; then there is one worker, which hangs, so that what may go better now waits.
    let mut expected = None;
    for workers in ["2", "1"] {
        let mut child =
            Pdk::new(["run", "--workers", workers, "--out"]).arg(&out).arg(&script).misbehave().spawn();
        wait_for_scenarios(&mut child, &out, 1);
        assert!(comes_true(LIMIT, || !partial(&out.join("traces")).is_empty()), "nothing is driven");
        signal(&child, Signal::TERM);
        let (code, said) = end(child);
        assert_eq!(code, Some(143), "{said:?}");
        assert_eq!(is_whole(&out), 1);
        let mut found = files(&out);
        // It holds the results of this process.
        found.remove(Path::new("summary.json"));
        match &expected {
            None => expected = Some(found),
            Some(expected) => assert!(found == *expected, "{:?}", found.keys()),
        }
    }
}

#[test]
fn a_terminated_run_goes_on() {
    let folder = temp();
    let script = pipeline(folder.path(), AT_ONCE);
    let whole = folder.path().join("whole");
    run(&script, &whole).succeed();
    let out = folder.path().join("record");
    for count in [1, 9] {
        let mut child = run(&script, &out).spawn();
        wait_for_scenarios(&mut child, &out, count);
        signal(&child, Signal::TERM);
        let (code, said) = end(child);
        assert_eq!(code, Some(143), "{said:?}");
        assert!((count..24).contains(&is_whole(&out)));
    }
    run(&script, &out).succeed();
    assert_equal(&out, &files(&whole));
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn a_script_that_does_not_end_is_ended() {
    let folder = temp();
    let endless = pipeline(
        folder.path(),
        "local count = 0\nlocal function spin()\n  while true do\n    count = count + 1\n  end\nend\npdk.table({ 'begun' }, {}) spin()\n",
    );
    for (sent, code) in [(Signal::INT, 130), (Signal::TERM, 143)] {
        let mut child = run(&endless, &folder.path().join("never")).spawn();
        // The table shows that the script is at work.
        let mut output = BufReader::new(child.stdout.take().unwrap()).lines();
        assert!(output.any(|line| line.unwrap().contains("begun")));
        signal(&child, sent);
        let (found, said) = end(child);
        assert_eq!(found, Some(code), "{said:?}");
        assert!(said.len() == 1 && said[0].contains("the run was interrupted"), "{said:?}");
    }
    // By its own time limit, with the line at which it was.
    let said = run(&endless, &folder.path().join("limit"))
        .env("PDK_SCRIPT_SECONDS", "1")
        .fail(1, &["pipeline.lua:"]);
    assert!(["pipeline.lua:3", "pipeline.lua:4"].iter().any(|line| said.contains(line)), "{said}");
    assert!(said.contains("1 s") && said.contains("PDK_SCRIPT_SECONDS"), "{said}");

    // The time that scenarios take is not the script's.
    let patient = pipeline(
        folder.path(),
        r#"
        for number = 1, 2 do
            pdk.drive({
                simulator = { name = "lane", width = 64, height = 48 }, driver = "lane_keeper", duration = 1.5, mode = "realtime",
                scenarios = { { ["repeat"] = number } },
            })
        end
        "#,
    );
    run(&patient, &folder.path().join("patient")).env("PDK_SCRIPT_SECONDS", "1").succeed();

    // What was driven before a script is ended stays, and goes on.
    let source = |end: &str| {
        format!(
            "local common = {{ simulator = {{ name = 'lane', width = 64, height = 48 }}, driver = 'lane_keeper', duration = 0.5 }}
             for number = 1, 3 do common.scenarios = {{ {{ ['repeat'] = number }} }} pdk.drive(common) end {end}"
        )
    };
    let stuck = pipeline(folder.path(), &source("while true do end"));
    let out = folder.path().join("stuck");
    run(&stuck, &out).env("PDK_SCRIPT_SECONDS", "1").fail(1, &["pipeline.lua:2"]);
    assert_eq!(is_whole(&out), 3);
    assert_eq!(json_file(&out.join("summary.json"))["outcomes"].as_array().unwrap().len(), 3);
}

#[test]
fn an_evaluation_that_is_killed_or_interrupted_goes_on() {
    let folder = temp();
    let data = folder.path().join("data");
    datasets::folder(&data, 110, 96, 72);
    // Gaps divide it into six sequences, and lines are written for each when it is done.
    for number in (0..110).filter(|number| number / 10 % 2 == 1) {
        fs::remove_file(data.join(format!("{number}_camera.jpg"))).unwrap();
        fs::remove_file(data.join(format!("record_{number}.json"))).unwrap();
    }
    let script = pipeline(
        folder.path(),
        r#"
        local function evaluate(levels)
            return pdk.evaluate({
                trust = true, dataset = pdk.path("data"), driver = "lane_keeper", perturbations = { "gaussian_noise", "motion_blur", "fog_filter" },
                levels = levels,
            })
        end
        local first = evaluate({ 1, 2.5, 4 })
        evaluate({ first.frames / 20 })
        "#,
    );
    let whole = folder.path().join("whole");
    run(&script, &whole).succeed();
    let expected = files(&whole);
    let all = lines(&whole.join("results.jsonl"));
    assert_eq!(all, 60 * 9 + 60 * 3);
    let out = folder.path().join("record");
    let results = out.join("results.jsonl");
    // The third one in the middle of the second evaluation.
    for (number, count) in [20, 300, 600].into_iter().enumerate() {
        let mut child = run(&script, &out).spawn();
        wait_for_lines(&mut child, &results, count);
        if number == 1 {
            signal(&child, Signal::INT);
            let (code, said) = end(child);
            assert_eq!(code, Some(130), "{said:?}");
            assert!(said.len() == 1 && said[0].contains(SAID), "{said:?}");
        } else {
            child.kill().unwrap();
            child.wait().unwrap();
        }
        let found = lines(&results);
        assert!((count..all).contains(&found), "{found} of {all} lines");
        let text = fs::read(&results).unwrap();
        assert!(expected[Path::new("results.jsonl")].starts_with(&text));
    }
    run(&script, &out).succeed();
    assert_equal(&out, &expected);
}
