//! The closed loop: what is driven, what is recorded, who can watch, and what a killed run leaves.

#![allow(clippy::unwrap_used)]

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::time::{Duration, Instant};

use pdk_bus::{Message, Tap, Topic};
use pdk_tests::process::{json_file, json_lines, pipeline};
use pdk_tests::{Pdk, repository, temp};
use serde_json::json;

/// A short road for the embedded simulator in small frames: 80 x 60 pixels, 20 a second.
const SIMULATOR: &str = r#"{"name":"lane","width":80,"height":60,"rate":20}"#;
const ROAD: &str = r#"{"angles":[0,4,-4],"segment":10}"#;

fn quickstart(out: &Path) -> Pdk {
    Pdk::new(["run", "--out"])
        .arg(out)
        .arg(repository().join("scripts/quickstart.lua"))
        .set("simulator", SIMULATOR)
        .set("road", ROAD)
        .set("perturbations", "gaussian_noise")
        .set("levels", "1")
}

#[test]
fn the_quickstart_drives_and_records() {
    let folder = temp();
    let out = folder.path().join("record");
    let ran = quickstart(&out).args(["--seed", "3"]).succeed();
    assert!(ran.stdout.contains("nominal") && ran.stdout.contains("gaussian_noise@1"), "{}", ran.stdout);
    assert!(ran.stdout.contains(&format!("Record: {}", out.display())));
    let speed =
        ran.stdout.lines().find(|line| line.ends_with(" times real time")).expect("no line with the speed");

    let manifest = json_file(&out.join("manifest.json"));
    assert_eq!((&manifest["seed"], &manifest["settings"]["driver"]), (&json!(3), &json!("dave2")));
    assert!(manifest["pipeline"]["source"].as_str().unwrap().contains("pdk.drive"));
    let components: Vec<_> = manifest["components"].as_array().unwrap().iter().collect();
    let names: Vec<_> = components.iter().map(|component| component["name"].as_str().unwrap()).collect();
    assert_eq!(names, ["gaussian_noise", "lane", "dave2"]);
    assert!(components.iter().all(|component| component["file"]["blake3"].as_str().unwrap().len() == 64));

    let scenarios = json_lines(&out.join("scenarios.jsonl"));
    assert_eq!(scenarios.len(), 2);
    let nominal = &scenarios[0];
    assert_eq!((&nominal["success"], &nominal["cause"]), (&json!(true), &json!("finished")), "{nominal}");
    assert_eq!(nominal["scenario"]["name"], "nominal");
    // 20 m or so at 8 m/s.
    let time = nominal["time"].as_f64().unwrap();
    assert!((2.0..6.0).contains(&time), "{time}");
    assert!(nominal["max_cross_track_error"].as_f64().unwrap() < 0.6);
    assert_ne!(nominal["digest"], scenarios[1]["digest"]);
    let telemetry = nominal["telemetry"].as_array().unwrap();
    // Every quarter of a second, and at the end.
    assert!(telemetry.len() as f64 >= time * 4.0 && telemetry.len() as f64 <= time * 4.0 + 2.0);

    let summary = json_file(&out.join("summary.json"));
    assert_eq!(summary["outcomes"].as_array().unwrap().len(), 2);
    let performance = json_file(&out.join("performance.json"));
    let frames: u64 = scenarios.iter().map(|scenario| scenario["frames"].as_u64().unwrap()).sum();
    assert_eq!(performance["steps"][0]["drive"]["stages"]["steps"], frames);
    assert!(speed.starts_with(&format!("{frames} frames in ")) && speed.contains(" a second, "), "{speed}");
}

#[test]
fn the_trace_is_what_other_tools_read() {
    let folder = temp();
    let out = folder.path().join("record");
    quickstart(&out).set("duration", 1).succeed();
    let scenarios = json_lines(&out.join("scenarios.jsonl"));
    for (number, scenario) in scenarios.iter().enumerate() {
        let bytes = fs::read(out.join(format!("traces/{number:04}.mcap"))).unwrap();
        let mut topics: BTreeMap<String, (u64, String, String)> = BTreeMap::new();
        let mut last_time = 0;
        for message in mcap::MessageStream::new(&bytes).unwrap() {
            let message = message.unwrap();
            let schema = message.channel.schema.as_ref().unwrap();
            let entry = topics
                .entry(message.channel.topic.clone())
                .or_insert_with(|| (0, schema.name.clone(), message.channel.message_encoding.clone()));
            entry.0 += 1;
            if message.channel.topic == "/state" {
                assert!(message.log_time >= last_time);
                last_time = message.log_time;
            }
            if message.channel.topic == "/perturbed" {
                // The JPEG lies within the message, between its own markers.
                let start = message.data.windows(3).position(|window| window == [0xff, 0xd8, 0xff]).unwrap();
                let end = message.data.windows(2).rposition(|window| window == [0xff, 0xd9]).unwrap() + 2;
                let picture = image::load_from_memory(&message.data[start..end]).unwrap();
                assert_eq!((picture.width(), picture.height()), (80, 60));
            }
        }
        let frames = scenario["frames"].as_u64().unwrap();
        assert_eq!(scenario["cause"], "time_out");
        assert_eq!(frames, 21, "one second at 20 frames, and the frame at its end");
        // Every sixth one, and the last one because it failed.
        let images = frames.div_ceil(6) + 1;
        let counts: Vec<_> = topics
            .iter()
            .map(|(topic, (count, schema, _))| (topic.as_str(), *count, schema.as_str()))
            .collect();
        assert_eq!(
            counts,
            [
                ("/control", frames, "controlmessage.ControlMessage"),
                ("/event", 2, "foxglove.Log"),
                ("/perturbed", images, "foxglove.CompressedImage"),
                ("/raw", images, "foxglove.CompressedImage"),
                ("/state", frames, "statemessage.StateMessage"),
            ]
        );
        assert!(topics.values().all(|(_, _, encoding)| encoding == "protobuf"));
        let end = scenario["time"].as_f64().unwrap();
        assert!((last_time as f64 / 1e9 - end).abs() < 1e-6, "{last_time} {end}");
    }
}

#[test]
fn the_record_of_a_failure_shows_what_came_before_it() {
    let folder = temp();
    let source = r#"
        local function drive(duration)
            pdk.drive({
                simulator = { name = "lane", width = 80, height = 60, rate = 20 }, driver = "lane_keeper",
                duration = duration, images_every = 0,
                scenarios = { { road = { angles = { 0, 4, -4 }, segment = 10 } } },
            })
        end
        drive(2.2)
        drive(20)
    "#;
    let out = folder.path().join("record");
    Pdk::new(["run", "--out"]).arg(&out).arg(pipeline(folder.path(), source)).succeed();
    let causes: Vec<_> =
        json_lines(&out.join("scenarios.jsonl")).iter().map(|line| line["cause"].clone()).collect();
    assert_eq!(causes, ["time_out", "finished"]);
    let images = |number: u64, topic: &str| {
        let bytes = fs::read(out.join(format!("traces/{number:04}.mcap"))).unwrap();
        let messages = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap);
        messages
            .filter(|message| message.channel.topic == topic)
            .map(|message| message.log_time / 1_000_000)
            .collect::<Vec<_>>()
    };
    for topic in ["/raw", "/perturbed"] {
        // The frames of every half second are kept.
        assert_eq!(images(0, topic), [0, 1000, 2200]);
        assert!(images(1, topic).is_empty());
    }
}

#[test]
fn the_export_has_the_published_shape() {
    let folder = temp();
    let out = folder.path().join("record");
    quickstart(&out).set("duration", 1).succeed();
    let file = folder.path().join("export.json");
    Pdk::new(["export"]).arg(&out).arg("-o").arg(&file).succeed();
    let exported = json_file(&file);
    let same = Pdk::new(["export"]).arg(&out).succeed().json();
    assert_eq!(exported, same);
    let scenarios = exported.as_array().unwrap();
    assert_eq!(scenarios.len(), 2);
    for scenario in scenarios {
        let keys: Vec<_> = scenario.as_object().unwrap().keys().map(String::as_str).collect();
        assert_eq!(keys, ["frames", "pos", "xte", "speeds", "actions", "scenario", "isSuccess", "timeout"]);
        let count = scenario["frames"].as_array().unwrap().len();
        assert!(count >= 4);
        for list in ["pos", "xte", "speeds", "actions"] {
            assert_eq!(scenario[list].as_array().unwrap().len(), count, "{list}");
        }
        assert_eq!((&scenario["isSuccess"], &scenario["timeout"]), (&json!(false), &json!(true)));
        let waypoints = scenario["scenario"]["waypoints"].as_str().unwrap();
        assert!(
            waypoints
                .split('@')
                .all(|point| point.split(',').filter(|n| n.parse::<f64>().is_ok()).count() == 3)
        );
    }
    assert_eq!(scenarios[1]["scenario"]["perturbation_function"], "gaussian_noise");
    assert_eq!(scenarios[1]["scenario"]["perturbation_scale"], 1.0);
    Pdk::new(["export"]).arg(folder.path()).fail(1, &["holds no record", "manifest.json"]);
}

#[test]
fn a_driver_that_leaves_its_lane_is_a_result_and_no_error() {
    let folder = temp();
    // The misbehaving driver does as good as not steer on a dark picture, so it goes straight on where the road bends.
    let source = r#"
        pdk.drive({
            simulator = { name = "lane", width = 80, height = 60, rate = 20 }, driver = "misbehave",
            duration = 20, images_every = 0,
            scenarios = { { road = { angles = { 0, 40, 40 }, segment = 15 } } },
        })
    "#;
    let out = folder.path().join("record");
    Pdk::new(["run", "--out"]).arg(&out).arg(pipeline(folder.path(), source)).misbehave().succeed();
    let outcome = &json_lines(&out.join("scenarios.jsonl"))[0];
    assert_eq!(
        (&outcome["success"], &outcome["cause"]),
        (&json!(false), &json!("lane_departure")),
        "{outcome}"
    );
    assert!(outcome["progress"].as_f64().unwrap() < 1.0);
}

#[test]
fn several_drives_of_one_pipeline_number_their_scenarios_on() {
    let folder = temp();
    let out = folder.path().join("record");
    let source = r#"
        for round = 1, 3 do
            local outcomes = pdk.drive({ simulator = "misbehave", driver = "misbehave", scenarios = { {}, {} } })
            assert(#outcomes == 2 and outcomes[1].success and outcomes[2].index == round * 2 - 1)
        end
    "#;
    Pdk::new(["run", "--out"]).arg(&out).arg(pipeline(folder.path(), source)).misbehave().succeed();
    let indexes: Vec<_> = json_lines(&out.join("scenarios.jsonl"))
        .iter()
        .map(|outcome| outcome["index"].as_u64().unwrap())
        .collect();
    assert_eq!(indexes, [0, 1, 2, 3, 4, 5]);
    assert!(out.join("traces/0005.mcap").is_file());
}

#[test]
fn a_course_that_scenarios_share_is_sampled_for_each() {
    let folder = temp();
    let out = folder.path().join("record");
    let source = r#"
        local shared = { { name = "contrast", level = function(time) return math.min(time, 4) end } }
        pdk.drive({ simulator = "misbehave", driver = "misbehave", scenarios = {
            { perturbations = shared, duration = 0.5 }, { perturbations = shared, duration = 3 },
        } })
        assert(type(shared[1].level) == "function")
    "#;
    Pdk::new(["run", "--out"]).arg(&out).arg(pipeline(folder.path(), source)).misbehave().succeed();
    let scenarios = json_lines(&out.join("scenarios.jsonl"));
    let last = |number: usize| {
        let points = &scenarios[number]["scenario"]["perturbations"][0]["level"]["points"];
        points.as_array().unwrap().last().unwrap()[0].as_f64().unwrap()
    };
    assert_eq!((last(0), last(1)), (0.5, 3.0));
}

#[test]
fn a_mask_is_in_the_manifest() {
    let folder = temp();
    let mask = folder.path().join("mask.png");
    pdk_tests::pictures::write(&mask, 8, 6);
    let out = folder.path().join("record");
    let source = r#"
        pdk.drive({ simulator = "misbehave", driver = "misbehave", scenarios = {
            { perturbations = { { name = "contrast", level = 1, region = { mask = pdk.path("mask.png") } } } },
        } })
    "#;
    Pdk::new(["run", "--out"]).arg(&out).arg(pipeline(folder.path(), source)).misbehave().succeed();
    let files = json_file(&out.join("manifest.json"))["files"].clone();
    assert_eq!((files.as_array().unwrap().len(), &files[0]["path"]), (1, &json!(mask)));
    assert_eq!(files[0]["blake3"].as_str().unwrap().len(), 64);
}

#[test]
fn a_drop_in_is_in_the_manifest_with_the_library_that_shows_it() {
    let folder = temp();
    let clip = folder.path().join("overlays/sticker.png");
    fs::create_dir(clip.parent().unwrap()).unwrap();
    pdk_tests::pictures::write(&clip, 16, 12);
    let out = folder.path().join("record");
    let source = r#"
        pdk.drive({ simulator = "misbehave", driver = "misbehave", scenarios = { { perturbations = { "sticker@2" } } } })
    "#;
    Pdk::new(["run", "--plugins"])
        .arg(folder.path())
        .arg("--out")
        .arg(&out)
        .arg(pipeline(folder.path(), source))
        .misbehave()
        .succeed();
    let manifest = json_file(&out.join("manifest.json"));
    let components = manifest["components"].as_array().unwrap();
    let sticker = components.iter().find(|component| component["name"] == "sticker").unwrap();
    assert_eq!(sticker["file"]["path"], json!(pdk_tests::library("pdk_overlay")));
    assert_eq!(manifest["files"].as_array().unwrap().len(), 1);
    assert_eq!(manifest["files"][0]["path"], json!(clip));
}

#[test]
fn a_line_that_was_cut_off_does_not_hide_the_others() {
    let folder = temp();
    let out = folder.path().join("record");
    let source =
        r#"pdk.drive({ simulator = "misbehave", driver = "misbehave", scenarios = { {}, {}, {} } })"#;
    Pdk::new(["run", "--out"]).arg(&out).arg(pipeline(folder.path(), source)).misbehave().succeed();
    let lines = out.join("scenarios.jsonl");
    let text = fs::read_to_string(&lines).unwrap();
    fs::write(&lines, &text[..text.len() - 20]).unwrap();
    let exported = Pdk::new(["export"]).arg(&out).succeed();
    assert_eq!(exported.json().as_array().unwrap().len(), 2);
    assert!(exported.stderr.contains("warning: the last line of"), "{}", exported.stderr);
    // Damage within the file is another matter.
    fs::write(&lines, text.replacen("}\n", "\n", 1)).unwrap();
    Pdk::new(["export"]).arg(&out).fail(1, &["scenarios.jsonl:1"]);
}

#[test]
fn a_drive_that_fails_keeps_its_numbers() {
    let folder = temp();
    let out = folder.path().join("record");
    // The first drive's traces outgrow what a file may hold.
    let source = r#"
        local ok, error = pcall(pdk.drive, { simulator = { name = "misbehave", how = "stand_still" },
            driver = "misbehave", images_every = 1, scenarios = { {}, {} } })
        assert(not ok and string.find(tostring(error), "cannot write"), tostring(error))
        pdk.drive({ simulator = "misbehave", driver = "misbehave", scenarios = { {}, {} } })
    "#;
    Pdk::program("sh")
        .args(["-c", "trap '' XFSZ; ulimit -f 140; exec \"$0\" \"$@\""])
        .arg(pdk_tests::built("pdk"))
        .args(["run", "--threads", "1", "--out"])
        .arg(&out)
        .arg(pipeline(folder.path(), source))
        .misbehave()
        .succeed();
    let indexes: Vec<_> =
        json_lines(&out.join("scenarios.jsonl")).iter().map(|outcome| outcome["index"].clone()).collect();
    assert_eq!(indexes, [2, 3]);
    assert!(out.join("traces/0000.mcap").is_file() && out.join("traces/0003.mcap").is_file());
}

/// A pipeline that drives for long on small frames.
fn long_run(folder: &Path, name: &str) -> (Pdk, std::path::PathBuf) {
    let source = r#"
        local scenarios = {}
        for index = 1, 1000 do
            table.insert(scenarios, { road = { angles = { 0, 4, -4 }, segment = 10 }, perturbations = { "contrast@1" } })
        end
        pdk.drive({ simulator = { name = "lane", width = 80, height = 60, rate = 20 }, driver = "lane_keeper",
            duration = 1, scenarios = scenarios })
    "#;
    let out = folder.join(name);
    (Pdk::new(["run", "--threads", "2", "--out"]).arg(&out).arg(pipeline(folder, source)), out)
}

/// Waits until something holds.
fn wait_for(what: &str, mut holds: impl FnMut() -> bool) {
    let started = Instant::now();
    while !holds() {
        assert!(started.elapsed() < Duration::from_secs(30), "{what} did not come");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// The name on the topics of the run of a process.
fn run_of(process: u32) -> Option<String> {
    Tap::list().unwrap().into_iter().find(|run| run.process == process).map(|run| run.run)
}

#[test]
fn another_process_taps_the_frames_while_they_are_driven() {
    let folder = temp();
    let (command, _) = long_run(folder.path(), "tapped");
    let mut child = command.spawn();
    wait_for("the run", || run_of(child.id()).is_some());
    let run = run_of(child.id()).unwrap();
    assert!(run.starts_with("tapped-"), "{run}");
    for topic in [Topic::Raw, Topic::Perturbed] {
        let mut tap = Tap::open(&run, 1, topic, Duration::from_secs(10)).unwrap();
        let mut before: Option<pdk_bus::FrameHeader> = None;
        for _ in 0..30 {
            let Some(Message::Frame(frame)) = tap.receive(Duration::from_secs(10)).unwrap() else {
                panic!("no frame came");
            };
            let header = *frame.header();
            assert_eq!((header.lane, header.width, header.height, frame.len()), (1, 80, 60, 80 * 60 * 3));
            assert!(frame.iter().any(|&byte| byte != frame[0]), "a frame without a picture");
            assert!((header.time - header.sequence as f64 / 20.0).abs() < 1e-9);
            if let Some(before) = before {
                assert!(header.number > before.number);
                assert!(header.scenario > before.scenario || header.sequence > before.sequence);
            }
            before = Some(header);
        }
    }
    let mut tap = Tap::open(&run, 0, Topic::State, Duration::from_secs(10)).unwrap();
    assert!(
        matches!(tap.receive(Duration::from_secs(10)).unwrap(), Some(Message::State(_, state)) if state.speed > 1.0)
    );
    child.kill().unwrap();
    child.wait().unwrap();
}

/// The shared memory that a process has mapped, but for the counter that all processes share.
#[cfg(target_os = "linux")]
fn shared_memory(process: u32) -> Vec<String> {
    let maps = fs::read_to_string(format!("/proc/{process}/maps")).unwrap();
    let files = maps.lines().filter_map(|line| line.find("/dev/shm/").map(|start| line[start..].to_owned()));
    let mut files: Vec<_> = files.filter(|file| !file.ends_with(".global_mgmt")).collect();
    files.sort();
    files.dedup();
    files
}

#[test]
fn a_killed_run_loses_only_what_was_in_flight() {
    let folder = temp();
    let (command, out) = long_run(folder.path(), "killed");
    let mut child = command.spawn();
    let lines = out.join("scenarios.jsonl");
    let count = || fs::read_to_string(&lines).map_or(0, |text| text.lines().count());
    wait_for("the fifth scenario", || count() >= 5);
    #[cfg(target_os = "linux")]
    let memory = shared_memory(child.id());
    child.kill().unwrap();
    child.wait().unwrap();

    // Complete lines only, each with a trace that is complete too.
    let recorded = json_lines(&lines);
    assert!((5..1000).contains(&recorded.len()), "{}", recorded.len());
    for outcome in &recorded {
        let trace =
            fs::read(out.join(format!("traces/{:04}.mcap", outcome["index"].as_u64().unwrap()))).unwrap();
        let summary = mcap::Summary::read(&trace).unwrap().unwrap();
        assert!(summary.stats.unwrap().message_count >= outcome["frames"].as_u64().unwrap() * 2);
    }
    assert_eq!(json_file(&out.join("manifest.json"))["seed"], 0);

    // The next run works, and removes what the killed one left in shared memory.
    let (command, _) = long_run(folder.path(), "next");
    let mut next = command.spawn();
    wait_for("the next run", || run_of(next.id()).is_some());
    #[cfg(target_os = "linux")]
    {
        assert!(!memory.is_empty());
        wait_for("the end of what was left", || !memory.iter().any(|file| Path::new(file).exists()));
    }
    next.kill().unwrap();
    next.wait().unwrap();
    assert_eq!(run_of(child.id()), None);
    quickstart(&folder.path().join("last")).set("duration", 0.5).succeed();
}

#[test]
fn runs_that_start_at_the_same_time_have_records_of_their_own() {
    let folder = temp();
    let source = r#"pdk.drive({ simulator = "misbehave", driver = "misbehave", scenarios = { {}, {} } })"#;
    let path = pipeline(folder.path(), source);
    let runs: Vec<_> =
        (0..16).map(|_| Pdk::new(["run"]).arg(&path).misbehave().folder(folder.path()).spawn()).collect();
    for run in runs {
        let output = run.wait_with_output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
    for number in 1..=16 {
        let lines = json_lines(&folder.path().join(format!("runs/pipeline-{number}/scenarios.jsonl")));
        assert_eq!(lines.len(), 2, "record {number}");
    }
}

#[test]
fn in_real_time_frames_that_come_too_fast_are_skipped_and_replayed_all_the_same() {
    let folder = temp();
    // A thousand frames a second of this size are more than any machine can draw.
    let pipeline = folder.path().join("fast.lua");
    let script = |mode: &str| {
        format!(
            r#"pdk.drive({{
                simulator = {{ name = "lane", width = 1280, height = 720, rate = 1000 }}, driver = "lane_keeper",
                mode = "{mode}", duration = 0.5, images_every = 0,
                scenarios = {{ {{ perturbations = {{ "gaussian_noise@1" }} }} }},
            }})"#
        )
    };
    fs::write(&pipeline, script("realtime")).unwrap();
    let out = folder.path().join("run");
    Pdk::new(["run", "--out"]).arg(&out).arg(&pipeline).succeed();
    let outcomes = json_lines(&out.join("scenarios.jsonl"));
    let [frames, skipped] = ["frames", "skipped_frames"].map(|name| outcomes[0][name].as_u64().unwrap());
    assert_eq!(outcomes[0]["mode"], "realtime");
    // Half a second of a thousand frames a second; what is under way at its end still counts.
    assert!(skipped > 100 && frames > 0 && frames + skipped > 500, "{frames} {skipped}");
    Pdk::new(["replay"]).arg(&out).succeed();

    fs::write(&pipeline, script("sometimes")).unwrap();
    let expected = "`mode` is `sometimes`, but has to be lockstep or realtime";
    Pdk::new(["run", "--out"]).arg(folder.path().join("other")).arg(&pipeline).fail(1, &[expected]);
}
