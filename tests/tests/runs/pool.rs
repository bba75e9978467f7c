//! Workers from elsewhere: a run through a pool is the run without, a pool that does not speak as it should is a sentence, and
//! one that is lost costs nothing but time.

use std::collections::BTreeSet;
use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::Stdio;

use pdk_record::trace::reader::{Entry, TraceReader};
use pdk_tests::process::{LIMIT, json_lines, pipeline};
use pdk_tests::processes::{BusFolder, Process, comes_true, ended_within};
use pdk_tests::records::{assert_equal, files, partial, trace, wait_for_scenarios};
use pdk_tests::{Pdk, datasets, onnx, temp};
use rustix::process::Signal;
use serde_json::json;

const SOURCE: &str = r#"
    local scenarios = {}
    for number = 1, 12 do
        table.insert(scenarios, {
            road = { angles = { 0, number, -number }, segment = 20 }, perturbations = { "gaussian_noise@" .. number / 3 },
        })
    end
    pdk.drive({
        simulator = { name = "lane", width = 160, height = 120 }, driver = "lane_keeper", duration = 4, images_every = 10,
        scenarios = scenarios,
    })
"#;

/// The pool of this test kit.
fn pool(slots: usize) -> String {
    format!("'{}' {slots}", env!("CARGO_BIN_EXE_pool"))
}

fn run(script: &Path, out: &Path) -> Pdk {
    Pdk::new(["run", "--out"]).arg(out).arg(script)
}

#[test]
fn a_run_through_a_pool_is_the_run_without() {
    let folder = temp();
    datasets::folder(&folder.path().join("data"), 9, 32, 24);
    let source = format!(
        "{SOURCE}\n pdk.evaluate({{ dataset = pdk.path('data'), driver = 'lane_keeper', perturbations = {{ 'gaussian_noise' }}, levels = {{ 1, 3 }} }})"
    );
    let script = pipeline(folder.path(), &source);
    let here = folder.path().join("here");
    run(&script, &here).args(["--workers", "1"]).succeed();
    let expected = files(&here);
    assert!(expected.contains_key(Path::new("results.jsonl")));
    for slots in [1, 3] {
        let out = folder.path().join(slots.to_string());
        let pool = pool(slots);
        match slots {
            1 => run(&script, &out).args(["--pool", &pool]).succeed(),
            _ => run(&script, &out).set("pool", &pool).succeed(),
        };
        assert_equal(&out, &expected);
    }
    // A replay may have its workers from there as well.
    let replayed = Pdk::new(["replay", "--pool", &pool(3)]).arg(&here).succeed();
    assert!(replayed.stdout.contains("12 of 12 equal"), "{}", replayed.stdout);
}

/// The version has grown: both sides leave out what they do not know.
#[test]
fn a_pool_of_a_later_pdk_works_with_a_word() {
    let folder = temp();
    let script = pipeline(folder.path(), SOURCE);
    let here = folder.path().join("here");
    run(&script, &here).args(["--workers", "1"]).succeed();
    let to = r#"s/"minor":2,"run"/"minor":99,"later":1,"run"/; s/"slot"/"later":[],"slot"/; /"hello"/a {"later":{"a":1}}"#;
    let from = r#"s/"minor":2,"pdk":"[^"]*"/"minor":99,"pdk":"9.9.9","later":{"a":1}/; /"ready"/!s/"success"/"later":2,"success"/; /"ready"/!s/"frames"/"later":3,"frames"/
        s!"catalog":\[!&{"description":{"kind":"horn","name":"h"},"file":"/h"},!; /"done"/a {"later":{"a":1}}"#;
    let out = folder.path().join("out");
    let later = format!("sed -u '{to}' | {} | sed -u '{from}'", pool(1));
    let said = run(&script, &out).args(["--pool", &later]).succeed().stderr;
    assert!(said.contains("is of pdk 9.9.9") && said.contains("results may differ"), "{said}");
    let left_out = "says `later`, which this pdk does not know and leaves out";
    assert_eq!(said.matches(left_out).count(), 1, "{said}");
    assert!(said.contains("the session says `later`, which this worker does not know"), "{said}");
    assert_equal(&out, &files(&here));
}

/// The version has not grown yet at one end, or at the other.
#[test]
#[ignore = "long: .ci/run runs it"]
fn a_pool_of_an_earlier_pdk_works_without_what_it_does_not_have() {
    let folder = temp();
    let script = pipeline(folder.path(), SOURCE);
    let here = folder.path().join("here");
    run(&script, &here).args(["--workers", "1"]).succeed();
    let strip = r#"sed -u 's/"minor":2,//'"#;
    let earlier = format!("{strip} | {} | {strip}", pool(1));
    let out = folder.path().join("out");
    let said = run(&script, &out).args(["--pool", &earlier]).succeed().stderr;
    assert!(!said.contains("warning"), "{said}");
    assert_equal(&out, &files(&here));

    let data = folder.path().join("data");
    datasets::folder(&data, 4, 8, 8);
    onnx::colours(&folder.path().join("colours.onnx"), 8, 8);
    datasets::folder(&folder.path().join("larger"), 4, 32, 24);
    let evaluate = |data: &str, looking: &str| {
        format!(
            "pdk.evaluate({{ dataset = pdk.path('{data}'), {looking}, perturbations = {{ 'gaussian_noise' }}, levels = {{ 1 }} }})"
        )
    };
    let driver = pipeline(folder.path(), &evaluate("larger", "driver = 'lane_keeper'"));
    run(&driver, &folder.path().join("driver")).args(["--pool", &earlier]).succeed();
    let looking =
        "predictor = { name = 'network', model = pdk.path('colours.onnx'), scale = '0..1', engine = 'pdk' },
        task = { kind = 'function', score = function(seen) return seen.outputs.scores.values[1] end }";
    let predictor = pipeline(folder.path(), &evaluate("data", looking));
    run(&predictor, &folder.path().join("here-too")).succeed();
    let parts = ["speaks version 2.0", "predictors came with version 2.1", "use a later pdk there"];
    run(&predictor, &folder.path().join("predictor")).args(["--pool", &earlier]).fail(1, &parts);
}

/// A field that a worker leaves out of a scenario would be another scenario.
#[test]
fn a_scenario_that_a_worker_understands_otherwise_is_not_driven() {
    let folder = temp();
    let script = pipeline(folder.path(), SOURCE);
    let out = folder.path().join("out");
    let other = format!("sed -u 's/\"scenario\":\"..../\"scenario\":\"0000/' | {}", pool(1));
    let parts =
        ["the session's scenario 0000", "does not know all of its fields", "use the same pdk at both ends"];
    run(&script, &out).args(["--pool", &other]).fail(1, &parts);
    assert_eq!(json_lines(&out.join("scenarios.jsonl")).len(), 0);
}

/// A pool that puts the script of a driver elsewhere changes the scenario for the worker, and says so.
#[test]
fn a_scenario_whose_files_were_moved_is_driven_and_its_trace_has_the_id_of_the_session() {
    let folder = temp();
    let script = pipeline(folder.path(), SOURCE);
    let out = folder.path().join("out");
    let moved = format!("sed -u 's/\"scenario\":\"..../\"moved\":true,\"scenario\":\"0000/' | {}", pool(1));
    run(&script, &out).args(["--pool", &moved]).succeed();
    let lines = json_lines(&out.join("scenarios.jsonl"));
    assert!(!lines.is_empty());
    for line in lines {
        let id = line["id"].as_str().unwrap();
        let trace = std::fs::read(trace(&out, &line)).unwrap();
        let asked = format!("0000{}", &id[4..]);
        let has = |id: &str| trace.windows(id.len()).any(|window| window == id.as_bytes());
        assert!(has(&asked) && !has(id), "{id}");
    }
}

#[test]
fn a_pool_that_does_not_speak_as_it_should_is_a_sentence() {
    let folder = temp();
    let script = pipeline(folder.path(), SOURCE);
    let bus = BusFolder::new();
    let (name, value) = bus.variable();
    let fail = |number: usize, command: &str, parts: &[&str]| {
        let out = folder.path().join(number.to_string());
        let said = run(&script, &out).args(["--pool", command]).env(name, value).fail(1, parts);
        assert!(said.contains(&format!("the pool `{command}`")), "{said}");
        // Nothing was begun, so nothing is left.
        assert!(!out.exists(), "{}", out.display());
    };
    let changed = |from: &str, to: &str| format!("{} | sed -u 's/{from}/{to}/'", pool(1));
    fail(
        0,
        &changed("\"protocol\":2", "\"protocol\":99"),
        &["speaks version 99", "this pdk version 2", "use the same pdk at both ends"],
    );
    fail(1, &changed("\"slots\":1", "\"slots\":0"), &["no slots", "at least one"]);
    fail(2, "exit 3", &["ended before it was ready", "exit status: 3"]);
    fail(3, "kill -9 $$", &["ended before it was ready", "signal: 9"]);
    fail(
        4,
        &format!("'{}' 3", pdk_tests::nothing().display()),
        &["ended before it was ready", "exit status: 127"],
    );
    fail(5, "echo hello; cat > /dev/null", &["says what is not a message"]);
    fail(6, "echo '{\"ready\": 7}'; cat > /dev/null", &["says what is not a message"]);
    // One that takes its worker for whatever is there.
    fail(7, &format!("'{}' 2 /bin/true", env!("CARGO_BIN_EXE_pool")), &["ended before it was ready"]);
    for slots in ["65537", "4294967295"] {
        let many = changed("\"slots\":1", &format!("\"slots\":{slots}"));
        fail(8, &many, &[&format!("it has {slots} slots"), "at most 65536"]);
    }
    // It lives on, but its output is closed.
    let deaf = "exec python3 -c 'import os, time; os.close(1); time.sleep(600)'";
    for (number, command) in [deaf, deaf.strip_prefix("exec ").unwrap()].into_iter().enumerate() {
        fail(9 + number, command, &["closed its output before it was ready"]);
    }
    let said = run(&script, &folder.path().join("both")).args(["--pool", ""]).env(name, value).run();
    assert_eq!(said.code, Some(0), "an empty command means no pool: {}", said.stderr);
    assert!(comes_true(LIMIT, || bus.processes().is_empty()), "{:?}", bus.processes());
    assert_eq!(bus.left(), Vec::<PathBuf>::new());
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn a_pool_that_is_lost_over_every_job_ends_the_run_and_keeps_the_record() {
    let folder = temp();
    let script = pipeline(folder.path(), SOURCE);
    // It is gone as soon as it has said that it is ready.
    let gone = format!("{} | head -n 1", pool(1));
    run(&script, &folder.path().join("gone")).args(["--pool", &gone]).fail(1, &["was lost 3 times over it"]);
    // It says nonsense after some answers: what was recorded until then stays, and another pool goes on from there.
    let out = folder.path().join("nonsense");
    let nonsense = format!("{} | sed -u '/\"driven\"/{{n;n;n;s/.*/what?/}}'", pool(1));
    run(&script, &out).args(["--pool", &nonsense]).fail(1, &["says what is not a message"]);
    let recorded = json_lines(&out.join("scenarios.jsonl")).len();
    assert!((1..12).contains(&recorded), "{recorded}");
    assert_eq!(partial(&out), Vec::<PathBuf>::new());
    let whole = folder.path().join("whole");
    run(&script, &whole).succeed();
    run(&script, &out).args(["--pool", &pool(2)]).succeed();
    assert_equal(&out, &files(&whole));
}

#[test]
fn a_scenario_that_a_pool_gives_up_has_a_trace_that_says_so() {
    let folder = temp();
    let script = pipeline(
        folder.path(),
        r#"
        pdk.drive({
            simulator = "lane", driver = { name = "process", command = { "false" } },
            scenarios = { { name = "given up", duration = 1 } },
        })
        "#,
    );
    // The workers do not learn where the trace goes.
    let pool = format!("sed -u 's/\"trace\":\"[^\"]*\"/\"trace\":null/' | {}", pool(1));
    let out = folder.path().join("out");
    run(&script, &out).args(["--pool", &pool]).fail(1, &["could not be driven"]);
    let line = json_lines(&out.join("scenarios.jsonl")).remove(0);
    let entries = TraceReader::open(&trace(&out, &line)).unwrap().map(|entry| match entry.unwrap() {
        Entry::Event(event) => event.text,
        _ => panic!("there is something besides events in it"),
    });
    assert_eq!(entries.collect::<Vec<_>>(), ["given up", line["error"].as_str().unwrap()]);
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn what_a_lost_slot_was_at_is_done_again() {
    let folder = temp();
    let script = pipeline(folder.path(), SOURCE);
    let whole = folder.path().join("whole");
    run(&script, &whole).succeed();
    let expected = files(&whole);
    let is_worker = |process: &Process| process.command.ends_with(" worker");
    let does_components = |process: &Process| process.command.ends_with(" worker --components");
    let is_pool = |process: &Process| process.command.starts_with(env!("CARGO_BIN_EXE_pool"));
    type Kind<'a> = (&'a str, &'a dyn Fn(&Process) -> bool);
    let kinds: [Kind<'_>; 3] = [("worker", &is_worker), ("components", &does_components), ("pool", &is_pool)];
    for (name, wanted) in kinds {
        let bus = BusFolder::new();
        let (variable, value) = bus.variable();
        let out = folder.path().join(name);
        let mut child = run(&script, &out).args(["--pool", &pool(2)]).env(variable, value).spawn();
        for lines in [1, 6] {
            wait_for_scenarios(&mut child, &out, lines);
            let found: Vec<Process> = bus.processes().into_iter().filter(wanted).collect();
            assert!(!found.is_empty(), "no {name} in {:?}", bus.processes());
            found[0].signal(Signal::KILL);
        }
        let status = ended_within(&mut child, LIMIT).unwrap();
        let output = child.wait_with_output().unwrap();
        assert!(status.success(), "{name}: {}", String::from_utf8_lossy(&output.stderr));
        assert_equal(&out, &expected);
        assert!(comes_true(LIMIT, || bus.processes().is_empty()), "{name}: {:?}", bus.processes());
        assert_eq!(bus.left(), Vec::<PathBuf>::new(), "{name}");
    }
}

#[test]
fn a_scenario_over_which_workers_are_lost_again_and_again_has_a_line_that_says_so() {
    let folder = temp();
    // The first takes its time, so that there is time to kill who drives it.
    let script = pipeline(
        folder.path(),
        r#"
        pdk.drive({
            simulator = { name = "lane", width = 64, height = 48 }, driver = "lane_keeper",
            scenarios = { { name = "long", duration = 20, mode = "realtime" }, { name = "short", duration = 0.5 } },
        })
        "#,
    );
    let bus = BusFolder::new();
    let (variable, value) = bus.variable();
    let out = folder.path().join("out");
    let mut child = run(&script, &out).args(["--workers", "1"]).env(variable, value).spawn();
    let mut killed = BTreeSet::new();
    for _ in 0..3 {
        // It is at the scenario as soon as there is the beginning of a trace of this process.
        let mut at_work = None;
        let found = comes_true(LIMIT, || {
            let processes = bus.processes();
            let names: Vec<String> = partial(&out).iter().map(|path| path.display().to_string()).collect();
            at_work = processes.iter().find_map(|process| {
                let is_worker = process.command.ends_with(" worker") && !killed.contains(&process.id);
                let own = processes.iter().find(|other| other.parent == process.id)?;
                let begun = names.iter().any(|name| name.ends_with(&format!(".{}.part", own.id)));
                (is_worker && begun).then(|| process.clone())
            });
            at_work.is_some()
        });
        assert!(found, "no worker drives: {:?}", bus.processes());
        let worker = at_work.unwrap();
        worker.signal(Signal::KILL);
        killed.insert(worker.id);
    }
    let status = ended_within(&mut child, LIMIT).unwrap();
    let output = child.wait_with_output().unwrap();
    let stderr = String::from_utf8_lossy(&output.stderr);
    assert_eq!(status.code(), Some(1), "{stderr}");
    let said = "a worker was lost 3 times over it (the last: signal: 9 (SIGKILL))";
    assert!(stderr.contains("1 of 2 scenarios") && stderr.contains(said), "{stderr}");
    let lines = json_lines(&out.join("scenarios.jsonl"));
    assert_eq!(
        (&lines[0]["cause"], &lines[0]["error_kind"], &lines[0]["error"]),
        (&"error".into(), &"lost".into(), &said.into())
    );
    assert_eq!(
        (lines.len(), &lines[1]["name"], &lines[1]["cause"]),
        (2, &"short".into(), &"time_out".into())
    );
    // Both have a trace, and nothing else is left.
    let traces: Vec<PathBuf> = files(&out).into_keys().filter(|path| path.starts_with("traces")).collect();
    assert_eq!((traces.len(), partial(&out)), (2, Vec::<PathBuf>::new()), "{traces:?}");
    assert!(comes_true(LIMIT, || bus.processes().is_empty()), "{:?}", bus.processes());
    assert_eq!(bus.left(), Vec::<PathBuf>::new());
}

/// The session learns from it that the scenario is under way, however long the next frame takes.
#[test]
fn a_worker_reports_the_first_frame_at_once() {
    let mut worker = Pdk::new(["worker"]).stdin(Stdio::piped()).spawn();
    let plugin = pdk_tests::test_library("misbehave");
    let search = json!({ "plugins": [plugin], "drop_ins": [] });
    let hello = json!({ "protocol": 2, "minor": 2, "run": "first-frame", "patience": 60.0, "memory": 4096, "search": search });
    let scenario = json!({
        "simulator": { "name": "lane" }, "duration": 5.0, "seed": 7, "perturbations": [],
        "driver": { "name": "misbehave", "parameters": { "how": "hang_in_drive", "at": 1 } },
    });
    let drive = json!({ "scenario": scenario, "name": "slow", "trace": null, "images_every": 0 });
    let job = json!({ "number": 5, "slot": 0, "work": { "drive": drive } });
    let mut input = worker.stdin.take().unwrap();
    writeln!(input, "{}\n{}", json!({ "hello": hello }), json!({ "job": job })).unwrap();
    let mut lines = BufReader::new(worker.stdout.take().unwrap()).lines();
    let first = lines.find(|line| !line.as_ref().unwrap().contains("\"ready\"")).unwrap().unwrap();
    assert_eq!(first, r#"{"progress":{"number":5,"frames":1}}"#);
    drop(input);
    assert!(ended_within(&mut worker, LIMIT).is_some());
}
