//! Plugins that misbehave, files that are not plugins, and what a plugin author does.

use std::fs;
use std::path::Path;

use pdk_record::trace::reader::read_steps;
use pdk_sdk::prelude::Control;
use pdk_tests::process::{json_lines, pipeline};
use pdk_tests::records::trace;
use pdk_tests::{
    Finished, Pdk, built_in_libraries, datasets, library, onnx, pictures, repository, temp, test_library,
};
use serde_json::{Value, json};

/// Three scenarios with everything from the misbehaving plugin; the perturbation of the second misbehaves.
const THREE_SCENARIOS: &str = r#"
local settings = pdk.settings({
    simulator = { name = "misbehave", how = "behave", at = -1 },
    driver = { name = "misbehave", how = "behave", at = -1 },
    perturbation = { name = "misbehave", how = "behave", level = 0 },
})
pdk.drive({
    simulator = settings.simulator,
    driver = settings.driver,
    duration = 5,
    scenarios = {
        { name = "first", seed = 1 }, { name = "second", seed = 2, perturbations = { settings.perturbation } },
        { name = "third", seed = 3 },
    },
})
"#;

struct Run {
    finished: Finished,
    outcomes: Vec<Value>,
    /// The controls of the driver in each scenario, as its trace has them.
    controls: Vec<Vec<Control>>,
}

/// Drives the three scenarios on one worker, where `who` misbehaves in this manner.
fn three_scenarios(who: &str, how: &str, more: &[(&str, &str)]) -> Run {
    let folder = temp();
    let out = folder.path().join("out");
    let mut command = Pdk::new(["run", "--workers", "1", "--out"])
        .arg(&out)
        .arg(pipeline(folder.path(), THREE_SCENARIOS))
        .misbehave()
        .set(&format!("{who}.how"), how);
    for (key, value) in more {
        command = command.set(key, value);
    }
    let finished = command.run();
    let lines = out.join("scenarios.jsonl");
    let outcomes = if lines.exists() { json_lines(&lines) } else { Vec::new() };
    let controls = |outcome: &Value| {
        let steps = read_steps(&trace(&out, outcome)).unwrap();
        steps.iter().map(|step| step.control).collect()
    };
    let controls = outcomes.iter().map(controls).collect();
    Run { finished, outcomes, controls }
}

fn causes(run: &Run) -> Vec<&str> {
    run.outcomes.iter().map(|outcome| outcome["cause"].as_str().unwrap()).collect()
}

#[track_caller]
fn says(run: &Run, code: i32, parts: &[&str]) {
    let stderr = &run.finished.stderr;
    assert_eq!(run.finished.code, Some(code), "{stderr}");
    let sentence = stderr.lines().find_map(|line| line.strip_prefix("pdk: error: ")).unwrap_or_default();
    for part in parts {
        assert!(sentence.contains(part), "`{stderr}` does not say `{part}`");
    }
}

#[test]
fn a_plugin_that_behaves_is_driven() {
    let run = three_scenarios("perturbation", "behave", &[]);
    assert_eq!(run.finished.code, Some(0), "{}", run.finished.stderr);
    assert_eq!(causes(&run), ["finished"; 3]);
}

#[test]
fn a_panic_ends_its_scenario_only() {
    let run = three_scenarios("perturbation", "panic_in_apply", &[]);
    says(&run, 1, &["1 of 3 scenarios", "`second`", "perturbation `misbehave@0", "as asked to in `apply`"]);
    assert_eq!(causes(&run), ["finished", "error", "finished"]);
    assert!(run.outcomes[1]["error"].as_str().unwrap().contains("panicked"));

    // What was not touched drives as if nothing had happened.
    let undisturbed = three_scenarios("perturbation", "behave", &[]);
    assert_eq!(run.outcomes[2]["digest"], undisturbed.outcomes[2]["digest"]);
}

#[test]
fn a_panic_in_the_middle_of_a_scenario_keeps_what_was_driven() {
    let run = three_scenarios("driver", "panic_in_drive", &[("driver.at", "7")]);
    says(&run, 1, &["3 of 3 scenarios", "driver `misbehave`", "as asked to in `drive`"]);
    assert_eq!(causes(&run), ["error"; 3]);
    assert!(run.outcomes.iter().all(|outcome| outcome["frames"] == 7));
    assert!(run.controls.iter().all(|controls| controls.len() == 7));
}

#[test]
fn a_panic_at_every_entry_point_is_an_error_with_a_name() {
    for (who, how) in [
        ("simulator", "panic_in_reset"),
        ("simulator", "panic_in_waypoints"),
        ("simulator", "panic_in_frame"),
        ("simulator", "panic_in_act"),
        ("driver", "panic_in_reset"),
        ("driver", "panic_in_drive"),
    ] {
        let run = three_scenarios(who, how, &[]);
        let place = how.replace("panic_in_", "as asked to in `") + "`";
        says(&run, 1, &["3 of 3 scenarios", &format!("{who} `misbehave`"), &place]);
        assert_eq!(causes(&run), ["error"; 3], "{who} {how}");
    }
    // Without instances there is nothing to drive, and the others are driven.
    for (who, how) in
        [("simulator", "new"), ("simulator", "camera"), ("driver", "new"), ("perturbation", "new")]
    {
        let run = three_scenarios(who, &format!("panic_in_{how}"), &[]);
        let expected = match who {
            "perturbation" => ["finished", "error", "finished"],
            _ => ["error"; 3],
        };
        assert_eq!(causes(&run), expected, "{who} {how}");
        says(&run, 1, &[&format!("{who} `misbehave`"), "panicked", &format!("as asked to in `{how}`")]);
    }
}

#[test]
fn a_panic_on_a_thread_of_the_plugin_is_reported() {
    let run = three_scenarios("perturbation", "panic_on_thread", &[]);
    assert_eq!(run.finished.code, Some(0), "{}", run.finished.stderr);
    for part in ["panicked at", "perturbation.rs", "as asked to on a thread"] {
        assert!(run.finished.stderr.contains(part), "{}", run.finished.stderr);
    }
    // Those that end as errors are not said twice.
    let run = three_scenarios("perturbation", "panic_in_apply", &[]);
    assert_eq!(run.finished.stderr.matches("as asked to").count(), 1, "{}", run.finished.stderr);
}

/// At every frame, so that whatever file the process opens in between and gets such a number for is closed as well.
#[test]
fn a_plugin_that_closes_files_of_others_is_driven_to_the_end() {
    for who in ["simulator", "driver", "perturbation"] {
        let run = three_scenarios(who, "close_stdout", &[]);
        assert_eq!(run.finished.code, Some(0), "{}", run.finished.stderr);
        assert_eq!(causes(&run), ["finished"; 3], "{who}");
        assert!(run.controls.iter().all(|controls| controls.len() == 21), "{who}");
    }
}

#[test]
fn a_panic_while_an_instance_is_dropped_is_reported_and_harmless() {
    for who in ["simulator", "driver", "perturbation"] {
        let run = three_scenarios(who, "panic_in_drop", &[]);
        assert_eq!(run.finished.code, Some(0), "{}", run.finished.stderr);
        assert!(
            run.finished.stderr.contains("warning: when an instance was dropped"),
            "{}",
            run.finished.stderr
        );
        assert_eq!(causes(&run), ["finished"; 3]);
    }
}

#[test]
fn numbers_that_are_none_are_errors() {
    let run = three_scenarios("driver", "no_number", &[]);
    says(&run, 1, &["driver `misbehave`", "it steers NaN"]);
    let run = three_scenarios("simulator", "no_number", &[]);
    says(&run, 1, &["simulator `misbehave`: its z is NaN m", "in the state of frame 0"]);
    assert_eq!(causes(&run), ["error"; 3]);

    let run = three_scenarios("driver", "wild", &[]);
    assert_eq!(run.finished.code, Some(0), "{}", run.finished.stderr);
    assert!(run.controls.iter().all(|controls| controls.len() == 21));
    assert!(run.controls.iter().flatten().all(|control| control.steering == 1.0));
}

#[test]
fn a_simulator_whose_time_stands_still_does_not_run_for_ever() {
    let run = three_scenarios("simulator", "stand_still", &[]);
    says(&run, 1, &["simulator `misbehave`: its time advances from 0.0 to 0.0 s with a control"]);
    assert_eq!(causes(&run), ["error"; 3]);
}

#[test]
fn cameras_out_of_range_are_refused() {
    for (how, number) in [
        ("no_camera", "0x0"),
        ("endless_camera", "4294967295"),
        ("slow_camera", "1e-300"),
        ("fast_camera", "1e300"),
    ] {
        let run = three_scenarios("simulator", how, &[]);
        says(&run, 1, &["simulator `misbehave`", number, "out of range"]);
    }
}

#[test]
fn pixels_that_were_not_written_are_the_same_every_time() {
    let digests: Vec<_> = (0..2)
        .map(|_| three_scenarios("perturbation", "leave_pixels", &[]).outcomes[1]["digest"].clone())
        .collect();
    assert_eq!(digests[0], digests[1]);
}

/// Each ends its scenario, of which the line says who did what at which frame; the others come out as if nothing had happened.
#[test]
#[ignore = "long: .ci/run runs it"]
fn a_plugin_that_hangs_or_ends_the_process_is_named_and_the_run_continues() {
    let undisturbed = three_scenarios("perturbation", "behave", &[]);
    for (how, kind, said) in [
        (
            "hang_in_apply",
            "late",
            "has not come back for 3 s (the limit is raised with --set patience=SECONDS)",
        ),
        ("exit_in_apply", "lost", "ended the process with exit code 0 (a component has to return an error"),
        ("segfault_in_apply", "lost", "was ended by signal 11 (SIGSEGV, memory that it may not use)"),
        ("abort_in_apply", "lost", "was ended by signal 6 (SIGABRT, it aborted)"),
    ] {
        let run = three_scenarios("perturbation", how, &[("perturbation.at", "7"), ("patience", "3")]);
        let who = format!("in `apply` at frame 7 {said}");
        says(&run, 1, &["1 of 3 scenarios", "scenario 1 `second`: perturbation `misbehave@0", &who]);
        assert_eq!(causes(&run), ["finished", "error", "finished"], "{how}");
        let second = &run.outcomes[1];
        assert_eq!((&second["error_kind"], &second["frames"]), (&json!(kind), &json!(7)), "{how}");
        assert!(second["error"].as_str().unwrap().contains(&who), "{second}");
        for number in [0, 2] {
            assert_eq!(run.outcomes[number], undisturbed.outcomes[number], "{how}");
        }
    }
    for (who, how) in
        [("driver", "exit_in_drive"), ("simulator", "hang_in_frame"), ("simulator", "exit_in_act")]
    {
        let run = three_scenarios(who, how, &[("patience", "3")]);
        let function = how.split_once("_in_").unwrap().1;
        says(&run, 1, &["3 of 3 scenarios", &format!("{who} `misbehave` in `{function}` at frame 0 ")]);
        assert_eq!(causes(&run), ["error"; 3], "{who} {how}");
    }
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn a_component_that_cannot_be_made_is_the_outcome_of_its_scenarios() {
    for (who, how, function) in [
        ("perturbation", "hang_in_drop", "drop"),
        ("perturbation", "exit_in_new", "new"),
        ("driver", "hang_in_new", "new"),
        // The camera is asked for when the simulator is made.
        ("simulator", "exit_in_camera", "new"),
    ] {
        let run = three_scenarios(who, how, &[("patience", "3")]);
        let end = if how.starts_with("hang") { "has not come back for 3 s" } else { "ended the process" };
        let (count, name) = if who == "perturbation" { (1, "second") } else { (3, "first") };
        let said = format!("` in `{function}` {end}");
        says(&run, 1, &[&format!("{count} of 3 scenarios"), &format!("`{name}`: {who} `misbehave"), &said]);
        let lost: Vec<_> = run.outcomes.iter().filter(|outcome| outcome["cause"] == "error").collect();
        assert_eq!(lost.len(), count, "{who} {how}");
        assert!(lost.iter().all(|outcome| outcome["frames"] == 0 && outcome["digest"] == ""), "{lost:?}");
    }
}

/// These verbs call components beside a process that looks after them.
#[test]
fn verbs_that_call_components_survive_them() {
    let folder = temp();
    pictures::write(&folder.path().join("in.png"), 16, 16);
    for (how, function, said) in [
        ("exit_in_apply", "apply` at frame", "ended the process with exit code 0"),
        ("segfault_in_apply", "apply` at frame", "was ended by signal 11 (SIGSEGV"),
        ("kill_in_new", "new`", "was ended by signal 9 (SIGKILL)"),
        ("quit_in_drop", "drop`", "ended the process with exit code 0"),
    ] {
        let with = format!("misbehave@1,how={how}");
        for verb in [["perturb", "out.png"], ["preview", "sheets"]] {
            Pdk::new([verb[0], "in.png", "--with", &with, "-o", verb[1]])
                .folder(folder.path())
                .misbehave()
                .fail(70, &["perturbation `misbehave", &format!(" in `{function}"), said]);
        }
        assert!(how == "quit_in_drop" || !folder.path().join("out.png").exists(), "{how}");
    }
    // A plugin that cannot even be opened is left out, and named.
    for (number, verb) in
        [&["list"][..], &["show", "contrast"], &["doctor"], &["new", "perturbation", "x"]].iter().enumerate()
    {
        let cache = folder.path().join(number.to_string());
        let verb = Pdk::new(*verb).misbehave().folder(folder.path()).env("PDK_CACHE", cache);
        let finished = verb.env("MISBEHAVE", "abort_in_describe").run();
        assert!(matches!(finished.code, Some(0 | 1)), "{finished:?}");
        let said = format!("{}{}", finished.stdout, finished.stderr);
        assert!(said.contains("libmisbehave.so: opening it was ended by signal 6"), "{said}");
    }
}

#[test]
fn a_description_that_misbehaves_is_refused_by_name() {
    let cache = temp();
    let list = |how: &str| {
        let list = Pdk::new(["list", "driver"]).misbehave().env("MISBEHAVE", how);
        list.env("PDK_CACHE", cache.path())
    };
    let panicked = list("panic_in_describe").succeed();
    assert!(
        panicked.stderr.contains("libmisbehave") && panicked.stderr.contains("panicked"),
        "{}",
        panicked.stderr
    );
    // The other plugins are there nevertheless.
    assert!(panicked.stdout.contains("lane_keeper"));
    let exited = list("exit_in_describe").succeed();
    assert!(exited.stderr.contains("libmisbehave.so: opening it ended the process"), "{}", exited.stderr);
    assert!(exited.stdout.contains("lane_keeper"));
    // One that hangs has a minute, but `pdk check` has the patience that is set.
    let check = Pdk::new(["check", "--patience", "3"]).arg(test_library("misbehave"));
    let hung = check.env("MISBEHAVE", "hang_in_describe").run();
    assert_eq!(hung.code, Some(1), "{}", hung.stderr);
    let said = "FAIL loading the plugin: it has not come back for 3 s";
    assert!(hung.stdout.contains(said), "{}", hung.stdout);
}

#[test]
fn offline_a_panic_costs_the_frame_at_hand_only() {
    let source = r#"
        local settings = pdk.settings({
            dataset = { name = "misbehave", how = "behave", at = -1 },
            driver = { name = "misbehave", how = "behave", at = -1 },
            perturbation = { name = "misbehave", how = "behave", at = -1 },
        })
        pdk.evaluate({ dataset = settings.dataset, driver = settings.driver, perturbations = { settings.perturbation }, levels = { 0 } })
    "#;
    for (who, how) in [
        ("dataset", "panic_in_read"),
        ("dataset", "panic_in_name"),
        ("driver", "panic_in_drive"),
        ("perturbation", "panic_in_apply"),
    ] {
        let records: Vec<_> = ["1", "2"]
            .iter()
            .map(|workers| {
                let folder = temp();
                let out = folder.path().join("out");
                let finished = Pdk::new(["run", "--workers", workers, "--out"])
                    .arg(&out)
                    .arg(pipeline(folder.path(), source))
                    .misbehave()
                    .set(&format!("{who}.how"), how)
                    .set(&format!("{who}.at"), 1)
                    .succeed();
                assert!(finished.stderr.contains("was left out"), "{}", finished.stderr);
                fs::read_to_string(out.join("results.jsonl")).unwrap()
            })
            .collect();
        assert_eq!(records[0], records[1], "{who} {how}");
        let failed: Vec<_> = records[0].lines().map(|line| line.contains("panicked")).collect();
        assert_eq!(failed, [false, true, false, false], "{who} {how}: {}", records[0]);
    }
    let folder = temp();
    for (who, how, part) in [
        ("driver", "no_number", "it steers NaN"),
        ("dataset", "no_number", "have to be finite"),
        ("dataset", "empty", "has no frames"),
    ] {
        Pdk::new(["run", "--out"])
            .arg(folder.path().join(format!("{who}-{how}")))
            .arg(pipeline(folder.path(), source))
            .misbehave()
            .set(&format!("{who}.how"), how)
            .fail(1, &[part]);
    }
    // The patience of the run is that of the reader as well.
    Pdk::new(["run", "--out"])
        .arg(folder.path().join("hung"))
        .arg(pipeline(folder.path(), source))
        .misbehave()
        .set("dataset.how", "hang_in_new")
        .set("patience", "3")
        .fail(1, &["dataset `misbehave` in `new` has not come back for 3 s", "patience"]);
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn check_finds_every_misbehaviour() {
    let report = Pdk::new(["check", "--json", "--patience", "3"]).arg(test_library("misbehave")).run();
    assert_eq!(report.code, Some(1), "{}", report.stderr);
    let json = report.json();
    assert_eq!(json["components"].as_array().unwrap().len(), 6);
    let checks = json["checks"].as_array().unwrap();
    let mut harmless = 0;
    for check in checks {
        let (name, failure) = (check["check"].as_str().unwrap(), &check["failure"]);
        // What is out of range is put into it, and what panics in `drop` has done its work.
        let good = ["loading", "behave\"}", "wild", "idle", "panic_in_drop", "mutter", "on_thread"]
            .iter()
            .any(|good| name.contains(good));
        harmless += usize::from(good);
        assert_eq!(failure.is_null(), good, "{name}: {failure}");
        let expected = match name {
            name if good || name.contains("_camera\"") => "",
            name if name.contains("panic_in") => "panicked",
            name if name.contains("exit_in") => "the plugin ended the process (exit status: 0)",
            name if name.contains("hang_in") => "has not come back for 3 s",
            _ => "",
        };
        assert!(failure.as_str().unwrap_or_default().contains(expected), "{name}: {failure}");
    }
    assert!(checks.len() > 70 && harmless == 17, "{} checks, {harmless} harmless", checks.len());

    let describe =
        Pdk::new(["check"]).arg(test_library("misbehave")).env("MISBEHAVE", "panic_in_describe").run();
    assert_eq!(describe.code, Some(1));
    assert!(describe.stdout.contains("FAIL loading the plugin") && describe.stdout.contains("panicked"));
}

/// With this the header of a plugin begins; behind it follows the version of abi_stable.
const MAGIC: &[u8] = b"abi stable library for Rust     ";

/// How a header has version 0 of abi_stable with this minor number.
fn version(minor: u32) -> Vec<u8> {
    [0, minor].map(u32::to_le_bytes).concat()
}

/// Bytes with others in all places where these are, of which there is one at least.
fn replaced(bytes: &[u8], from: &[u8], to: &[u8]) -> Vec<u8> {
    let mut bytes = bytes.to_vec();
    let places: Vec<_> = (0..bytes.len()).filter(|&place| bytes[place..].starts_with(from)).collect();
    assert!(!places.is_empty());
    places.into_iter().for_each(|place| bytes[place..place + to.len()].copy_from_slice(to));
    bytes
}

/// Files that are not plugins of this version, with a part of the sentence about each.
fn not_plugins(folder: &Path) -> Vec<(std::path::PathBuf, &'static str)> {
    let file = |name: &str, content: &[u8]| {
        let path = folder.join(name);
        fs::write(&path, content).unwrap();
        path
    };
    let whole = fs::read(test_library("misbehave")).unwrap();
    let mut files = vec![
        (
            test_library("stranger"),
            "was built for version 2 of the plugin interface, but this pdk has version 1; get a newer pdk, or ",
        ),
        (
            test_library("altered"),
            "has other functions than version 1 of the plugin interface at `driver.functions.reset`; build it again",
        ),
        (
            file("header.so", &replaced(&whole, MAGIC, b"abi-stable")),
            "is damaged: its header is not one of abi_stable; build or copy it again",
        ),
        (
            file(
                "next.so",
                &replaced(&whole, &[MAGIC, &version(11)].concat(), &[MAGIC, &version(12)].concat()),
            ),
            "was built with abi_stable 0.12, but this pdk has 0.11; build it again",
        ),
        (
            file("other.so", &replaced(&whole, b"pdk_plugin", b"abc_plugin")),
            "is not a pdk plugin, but one of another program (`abc_plugin`)",
        ),
        (file("text.so", b"this is not a library\n"), "is not a library"),
        (file("empty.so", b""), "is not a library"),
        (file("head.so", &whole[..100]), "is cut off"),
        (file("half.so", &whole[..400_000]), "is cut off"),
        (file("script.lua", b"return 7"), "script.lua"),
    ];
    let libc = ["/lib/x86_64-linux-gnu/libc.so.6", "/lib64/libc.so.6", "/lib/aarch64-linux-gnu/libc.so.6"];
    match libc.iter().map(Path::new).find(|path| path.exists()) {
        Some(libc) => files.push((libc.to_owned(), "is not a pdk plugin: it has no header of abi_stable")),
        None => eprintln!("skipped: no libc.so.6 in the usual places"),
    }
    files
}

#[test]
fn files_that_are_not_plugins_are_rejected_with_one_sentence_each() {
    let folder = temp();
    for (file, part) in not_plugins(folder.path()) {
        let listed = Pdk::new(["list", "driver", "--plugins"]).arg(&file).succeed();
        let warnings: Vec<_> = listed.stderr.lines().collect();
        assert_eq!(warnings.len(), 1, "{}: {}", file.display(), listed.stderr);
        assert!(warnings[0].starts_with("pdk: warning: ") && warnings[0].contains(part), "{}", warnings[0]);
        assert!(warnings[0].contains(file.file_name().unwrap().to_str().unwrap()), "{}", warnings[0]);
        assert!(listed.stdout.contains("lane_keeper"));
        if file.extension().is_some_and(|extension| extension != "lua") {
            let checked = Pdk::new(["check"]).arg(&file).run();
            assert_eq!(checked.code, Some(1));
            assert!(checked.stdout.contains(part), "{}", checked.stdout);
        }
    }
    // A name without a folder is a file of the working directory, not one of the system's libraries.
    let noise = library("pdk_noise");
    let [place, name] = [noise.parent().map(Path::as_os_str), noise.file_name()].map(Option::unwrap);
    Pdk::new(["check"]).arg(name).folder(Path::new(place)).succeed();
    let checked = Pdk::new(["check", "libm.so.6"]).folder(folder.path()).run();
    assert_eq!(checked.code, Some(1), "{}", checked.stdout);

    let checked = Pdk::new(["check"]).arg(folder.path()).run();
    assert_eq!(checked.code, Some(1));
    assert!(checked.stdout.contains("FAIL loading the plugin"), "{}", checked.stdout);
    Pdk::new(["list", "--plugins", "/no/such/folder"])
        .fail(1, &["/no/such/folder", "does not exist", "--plugins"]);
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn the_built_in_plugins_keep_the_rules() {
    let folder = temp();
    datasets::folder(&folder.path().join("folder"), 3, 32, 24);
    datasets::tub(&folder.path().join("tub"), 3, 32, 24);
    onnx::pilot(&folder.path().join("pilot.onnx"), 3, 24, 32);
    onnx::mirror(&folder.path().join("mirror.onnx"), 24, 32);
    let has_ffmpeg = std::process::Command::new("ffmpeg").arg("-version").output().is_ok();
    for library in built_in_libraries() {
        let name = library.file_stem().unwrap().to_str().unwrap().to_owned();
        let mut check = Pdk::new(["check"]).arg(&library).folder(folder.path());
        match name.as_str() {
            "libpdk_datasets" => {
                check = check.set("folder.path", "folder").set("tub.path", "tub");
                let (examples, written) = ("docs/examples", "plugins/datasets/tests/written");
                for (reader, path) in [
                    ("csv", format!("{examples}/recording")),
                    ("video", format!("{examples}/drive.mp4")),
                    ("pictures", format!("{examples}/signs")),
                    ("mcap", format!("{written}/foxglove.mcap")),
                    ("rosbag2", format!("{written}/bag")),
                    ("lerobot", format!("{written}/lerobot_2")),
                    ("comma2k19", format!("{written}/comma2k19")),
                ] {
                    check = check.set(&format!("{reader}.path"), repository().join(path).display());
                }
                check = check.set("comma2k19.full_lock", -400).set("rosbag2.full_lock", 1);
            }
            "libpdk_models" => {
                check = check.set("onnx.model", "pilot.onnx").set("onnx.engine", "pdk");
                check = check.set("network.model", "pilot.onnx").set("network.engine", "pdk");
                let pictures = repository().join("docs/examples/recording/frames");
                check = check.set("expected-gradients.pictures", pictures.display());
                for component in ["repaint", "segmentation"] {
                    check = check.set(&format!("{component}.model"), "mirror.onnx");
                    check = check.set(&format!("{component}.engine"), "pdk");
                }
            }
            "libpdk_overlay" => {
                let clip = repository().join("scripts/overlays/snow.mp4");
                check = check.set("overlay.clip", clip.display());
            }
            _ => {}
        }
        let checked = check.run();
        if name == "libpdk_datasets" && !has_ffmpeg {
            // The only reader that fails without it is the one whose videos it decodes.
            let failed: Vec<_> = checked.stdout.lines().filter(|line| line.starts_with("FAIL ")).collect();
            let of_comma2k19 = |line: &str| line.contains("`comma2k19`") && line.contains("ffmpeg");
            let only_it = failed.len() == 1 && of_comma2k19(failed[0]);
            assert!(only_it, "{name}:\n{}{}", checked.stdout, checked.stderr);
            println!("skipped: the check of `comma2k19`: no ffmpeg on the PATH");
            continue;
        }
        assert_eq!(checked.code, Some(0), "{name}:\n{}{}", checked.stdout, checked.stderr);
    }
    let misspelt = Pdk::new(["check"]).arg(library("pdk_datasets")).set("tup.path", "tub").run();
    assert_eq!(misspelt.code, Some(1), "{}", misspelt.stderr);
    assert!(misspelt.stdout.contains("did you mean `tub`"), "{}", misspelt.stdout);
}

#[test]
fn a_new_perturbation_and_a_new_pipeline_work_as_they_are() {
    let folder = temp();
    Pdk::new(["new", "perturbation", "sun_visor", "--out"]).arg(folder.path()).succeed();
    Pdk::new(["new", "pipeline", "night_shift", "--out"]).arg(folder.path()).succeed();
    Pdk::new(["new", "pipeline", "x", "--rust"]).folder(folder.path()).fail(1, &["--rust is for components"]);
    Pdk::new(["new", "mask", "bright", "--out"]).arg(folder.path()).succeed();
    Pdk::new(["check", "bright.lua"]).folder(folder.path()).succeed();
    pictures::write(&folder.path().join("in.png"), 64, 48);
    Pdk::new(["perturb", "in.png", "--with", "sun_visor@4", "-o", "out.png", "--plugins", "."])
        .folder(folder.path())
        .succeed();
    let after = image::open(folder.path().join("out.png")).unwrap().into_rgb8();
    assert_eq!(f64::from(after.get_pixel(5, 0)[2]), (230.0f64 / 3.0).round());
    let ran = Pdk::new([
        "run",
        "night_shift.lua",
        "--json",
        "--set",
        "duration=0.5",
        "--set",
        "perturbations=sun_visor",
    ])
    .args(["--plugins", "."])
    .folder(folder.path())
    .succeed();
    assert_eq!(ran.json()["record"], json!("runs/night_shift-1"));
    assert_eq!(json_lines(&folder.path().join("runs/night_shift-1/scenarios.jsonl")).len(), 2);
    Pdk::new(["new", "pipeline", "night_shift", "--out"]).arg(folder.path()).fail(1, &["night_shift.lua"]);
    let empty = temp();
    for what in ["pipeline", "perturbation", "mask", "driver"] {
        Pdk::new(["new", what, "Night-Shift"]).folder(empty.path()).fail(1, &["lower-case letters"]);
    }
    assert_eq!(fs::read_dir(empty.path()).unwrap().count(), 0, "what was refused wrote nothing");
}
