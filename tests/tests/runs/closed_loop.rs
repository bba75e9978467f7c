//! The closed loop: what is driven, what is recorded, who can watch, and what a killed run leaves.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use pdk_bus::{Message, Tap, Topic};
use pdk_tests::process::{LIMIT, json_file, json_lines, pipeline};
use pdk_tests::records::trace;
use pdk_tests::{Pdk, repository, temp};
use serde_json::json;

/// A short road for the embedded simulator in small frames: 80 x 60 pixels, 20 a second.
const SIMULATOR: &str = r#"{"name":"lane","width":80,"height":60,"rate":20}"#;
const ROAD: &str = r#"{"angles":[0,4,-4],"segment":10}"#;
/// The same in Lua.
const SIMULATOR_LUA: &str = r#"{ name = "lane", width = 80, height = 60, rate = 20, straight_ends = 0 }"#;
const ROAD_LUA: &str = "{ angles = { 0, 4, -4 }, segment = 10 }";

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
    assert_eq!(nominal["name"], "nominal");
    // What is driven is all there, and tells the scenario apart from every other.
    let keys: Vec<_> = nominal["scenario"].as_object().unwrap().keys().map(String::as_str).collect();
    assert_eq!(keys, ["simulator", "driver", "road", "duration", "seed"]);
    assert_eq!(nominal["scenario"]["road"], serde_json::from_str::<serde_json::Value>(ROAD).unwrap());
    assert_eq!(nominal["scenario"]["seed"], scenarios[1]["scenario"]["seed"], "the same world for both");
    assert_ne!(nominal["id"], scenarios[1]["id"]);
    for (text, line) in fs::read_to_string(out.join("scenarios.jsonl")).unwrap().lines().zip(&scenarios) {
        assert!(text.starts_with(&format!("{{\"id\":{},\"name\":", line["id"])), "{text}");
        assert_eq!(line["id"].as_str().unwrap().len(), 32);
    }
    // 20 m or so at 8 m/s.
    let time = nominal["time"].as_f64().unwrap();
    assert!((2.0..6.0).contains(&time), "{time}");
    assert!(nominal["max_cross_track_error"].as_f64().unwrap() < 0.6);
    assert_ne!(nominal["digest"], scenarios[1]["digest"]);

    let summary = json_file(&out.join("summary.json"));
    let outcomes = summary["outcomes"].as_array().unwrap();
    assert_eq!(outcomes.len(), 2);
    for (number, (outcome, scenario)) in outcomes.iter().zip(&scenarios).enumerate() {
        assert_eq!((&outcome["number"], &outcome["id"]), (&json!(number), &scenario["id"]));
        assert_eq!(outcome["digest"], scenario["digest"]);
    }
    let performance = json_file(&out.join("performance.json"));
    let frames: u64 = scenarios.iter().map(|scenario| scenario["frames"].as_u64().unwrap()).sum();
    assert_eq!(performance["drive"]["stages"]["steps"], frames);
    assert!(performance["drive"]["wall_seconds"].as_f64().unwrap() > 0.0);
    assert_eq!(performance["evaluations"], json!([]));
    assert!(speed.starts_with(&format!("{frames} frames in ")) && speed.contains(" a second, "), "{speed}");
}

#[test]
fn the_trace_is_what_other_tools_read() {
    let folder = temp();
    let out = folder.path().join("record");
    quickstart(&out).set("duration", 1).succeed();
    let scenarios = json_lines(&out.join("scenarios.jsonl"));
    for scenario in &scenarios {
        let bytes = fs::read(trace(&out, scenario)).unwrap();
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
                ("/control", frames, "pdk.Control"),
                ("/event", 2, "foxglove.Log"),
                ("/perturbed", images, "foxglove.CompressedImage"),
                ("/raw", images, "foxglove.CompressedImage"),
                ("/road", 1, "pdk.Road"),
                ("/state", frames, "pdk.State"),
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
    let lines = json_lines(&out.join("scenarios.jsonl"));
    let causes: Vec<_> = lines.iter().map(|line| line["cause"].clone()).collect();
    assert_eq!(causes, ["time_out", "finished"]);
    let images = |number: usize, topic: &str| {
        let bytes = fs::read(trace(&out, &lines[number])).unwrap();
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
            local outcomes = pdk.drive({ simulator = "misbehave", driver = "misbehave",
                scenarios = { { seed = round }, { seed = 10 * round } } })
            assert(#outcomes == 2 and outcomes[1].success and outcomes[2].number == round * 2 - 1)
            assert(#outcomes[1].id == 32 and outcomes[1].id ~= outcomes[2].id)
        end
    "#;
    Pdk::new(["run", "--out"]).arg(&out).arg(pipeline(folder.path(), source)).misbehave().succeed();
    let lines = json_lines(&out.join("scenarios.jsonl"));
    let seeds: Vec<_> = lines.iter().map(|line| line["scenario"]["seed"].as_u64().unwrap()).collect();
    assert_eq!(seeds, [1, 10, 2, 20, 3, 30], "the order in which they were submitted");
    assert!(lines.iter().all(|line| trace(&out, line).is_file()));
    assert_eq!(fs::read_dir(out.join("traces")).unwrap().count(), 6);
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
    for (scenario, duration) in scenarios.iter().zip([0.5, 3.0]) {
        let frames = &scenario["scenario"]["perturbations"][0]["level"]["frames"];
        assert_eq!(frames["rate"], 20.0);
        let levels = frames["levels"].as_array().unwrap();
        // One for each frame, the one at the end too.
        assert_eq!(levels.len() as f64, duration * 20.0 + 1.0);
        for (number, level) in levels.iter().enumerate() {
            assert_eq!(level.as_f64().unwrap(), number as f64 / 20.0);
        }
    }
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

/// Also if nothing but a module is new, and if the outcome of a scenario that is submitted again is there already.
#[test]
fn what_is_used_later_is_in_the_manifest_by_then() {
    let folder = temp();
    let out = folder.path().join("record");
    fs::write(folder.path().join("own.lua"), "return { name = 'gaussian_noise' }").unwrap();
    let source = format!(
        r#"
        local session = pdk.session({{ simulator = {SIMULATOR_LUA}, driver = "lane_keeper", duration = 0.2 }})
        local function driven(scenario)
            scenario.road = {ROAD_LUA}
            session:wait(session:submit(scenario))
        end
        driven({{ perturbations = {{ "contrast@1" }} }})
        local own = require("./own")
        driven({{ perturbations = {{ "contrast@1" }} }})
        driven({{ perturbations = {{ {{ name = own.name, level = 1 }} }} }})
        error("the end", 0)
    "#
    );
    Pdk::new(["run", "--out"]).arg(&out).arg(pipeline(folder.path(), &source)).fail(1, &["the end"]);
    let manifest = json_file(&out.join("manifest.json"));
    let names = |list: &serde_json::Value| -> Vec<String> {
        list.as_array().unwrap().iter().map(|one| one["name"].as_str().unwrap().to_owned()).collect()
    };
    assert_eq!(names(&manifest["pipeline"]["modules"]), ["./own"]);
    let components = names(&manifest["components"]);
    assert!(
        ["contrast", "gaussian_noise"].iter().all(|name| components.iter().any(|own| own == name)),
        "{components:?}"
    );
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
    let source = r#"pdk.drive({ simulator = "misbehave", driver = "misbehave", scenarios = { {}, { seed = 1 }, { seed = 2 } } })"#;
    Pdk::new(["run", "--out"]).arg(&out).arg(pipeline(folder.path(), source)).misbehave().succeed();
    let lines = out.join("scenarios.jsonl");
    let text = fs::read_to_string(&lines).unwrap();
    fs::write(&lines, &text[..text.len() - 20]).unwrap();
    let exported = Pdk::new(["export"]).arg(&out).succeed();
    assert_eq!(exported.json().as_array().unwrap().len(), 2);
    assert!(exported.stderr.contains("warning: the last line of"), "{}", exported.stderr);
    // Damage within the file is another matter, whether it is JSON or not.
    for damaged in [text.replacen("}\n", "\n", 1), text.replacen("\"success\":true", "\"success\":false", 1)]
    {
        assert_ne!(damaged, text);
        fs::write(&lines, damaged).unwrap();
        Pdk::new(["export"]).arg(&out).fail(1, &["scenarios.jsonl:1", "is damaged or was edited"]);
    }
}

#[test]
fn a_disk_that_is_full_ends_the_run_whatever_a_script_makes_of_it() {
    let folder = temp();
    // The second drive's traces outgrow what a file may hold.
    for count in [1, 2] {
        let out = folder.path().join(format!("record-{count}"));
        let source = format!(
            r#"
            local scenarios = {{ {{}}, {{ seed = 1 }} }}
            pdk.drive({{ simulator = "misbehave", driver = "misbehave", scenarios = scenarios }})
            local ok, error = pcall(pdk.drive, {{ simulator = {{ name = "lane", width = 32, height = 24 }}, duration = 10,
                driver = "lane_keeper", images_every = 1, scenarios = {{ table.unpack(scenarios, 1, {count}) }} }})
            assert(not ok and string.find(tostring(error), "cannot write"), tostring(error))
            ok, error = pcall(pdk.drive, {{ simulator = "misbehave", driver = "misbehave", scenarios = {{ {{ seed = 2 }} }} }})
            assert(not ok and string.find(tostring(error), "cannot write"), tostring(error))
            "#
        );
        let ran = Pdk::program("sh")
            .args(["-c", "trap '' XFSZ; ulimit -f 140; exec \"$0\" \"$@\""])
            .arg(pdk_tests::built("pdk"))
            .args(["run", "--workers", "1", "--out"])
            .arg(&out)
            .arg(pipeline(folder.path(), &source))
            .misbehave()
            .run();
        assert_eq!(ran.code, Some(1), "{}", ran.stderr);
        assert!(
            ran.stderr.contains("cannot write") && ran.stderr.contains("free some space"),
            "{}",
            ran.stderr
        );
        let lines = json_lines(&out.join("scenarios.jsonl"));
        let seeds: Vec<_> = lines.iter().map(|line| &line["scenario"]["seed"]).collect();
        assert_eq!((seeds.len(), seeds[1]), (2, &json!(1)));
        assert!(lines.iter().all(|line| trace(&out, line).is_file()));
    }
}

/// A pipeline that drives for long on small frames.
fn long_run(folder: &Path, name: &str) -> (Pdk, std::path::PathBuf) {
    let source = r#"
        local scenarios = {}
        for index = 1, 1000 do
            table.insert(scenarios, { road = { angles = { 0, 4, -4 }, segment = 10 }, seed = index, perturbations = { "contrast@1" } })
        end
        pdk.drive({ simulator = { name = "lane", width = 80, height = 60, rate = 20 }, driver = "lane_keeper",
            duration = 1, scenarios = scenarios })
    "#;
    let out = folder.join(name);
    (Pdk::new(["run", "--workers", "2", "--out"]).arg(&out).arg(pipeline(folder, source)), out)
}

/// Waits until something holds.
fn wait_for(what: &str, mut holds: impl FnMut() -> bool) {
    let started = Instant::now();
    while !holds() {
        assert!(started.elapsed() < LIMIT, "{what} did not come");
        std::thread::sleep(Duration::from_millis(5));
    }
}

/// The run of a process on the topics, and the processes that drive for it.
fn topics_of(process: u32) -> Option<(String, Vec<u32>)> {
    let ending = format!("-{process}");
    let run = Tap::list().unwrap().into_iter().find(|run| run.run.ends_with(&ending))?;
    Some((run.run, run.slots.iter().map(|slot| slot.process).collect()))
}

#[test]
fn another_process_taps_the_frames_while_they_are_driven() {
    let folder = temp();
    let (command, _) = long_run(folder.path(), "tapped");
    let mut child = command.spawn();
    wait_for("the run", || topics_of(child.id()).is_some_and(|(_, slots)| slots.len() == 2));
    let (run, processes) = topics_of(child.id()).unwrap();
    assert!(run.starts_with("pipeline-"), "{run}");
    // Components are called in processes of their own.
    assert!(processes[0] != processes[1] && !processes.contains(&child.id()), "{processes:?}");
    for topic in [Topic::Raw, Topic::Perturbed] {
        let mut tap = Tap::open(&run, 1, topic, LIMIT).unwrap();
        let mut before: Option<pdk_bus::FrameHeader> = None;
        for _ in 0..30 {
            let Some(Message::Frame(frame)) = tap.receive(LIMIT).unwrap() else {
                panic!("no frame came");
            };
            let header = *frame.header();
            assert_eq!((header.slot, header.width, header.height, frame.len()), (1, 80, 60, 80 * 60 * 3));
            assert!(frame.iter().any(|&byte| byte != frame[0]), "a frame without a picture");
            assert!((header.time - header.sequence as f64 / 20.0).abs() < 1e-9);
            if let Some(before) = before {
                assert!(header.number > before.number);
                assert!(header.scenario > before.scenario || header.sequence > before.sequence);
            }
            before = Some(header);
        }
    }
    let mut tap = Tap::open(&run, 0, Topic::State, LIMIT).unwrap();
    assert!(matches!(tap.receive(LIMIT).unwrap(), Some(Message::State(_, state)) if state.speed > 1.0));
    child.kill().unwrap();
    child.wait().unwrap();
}

/// The shared memory that processes have mapped, but for the counter that all processes share.
#[cfg(target_os = "linux")]
fn shared_memory(processes: &[u32]) -> Vec<String> {
    let mut files = Vec::new();
    for process in processes {
        let maps = fs::read_to_string(format!("/proc/{process}/maps")).unwrap_or_default();
        let mapped =
            maps.lines().filter_map(|line| line.find("/dev/shm/").map(|start| line[start..].to_owned()));
        files.extend(mapped.filter(|file| !file.ends_with(".global_mgmt")));
    }
    files.sort();
    files.dedup();
    files
}

#[cfg(target_os = "linux")]
fn alive(process: u32) -> bool {
    // A zombie waits for nothing but its parent.
    let status = fs::read_to_string(format!("/proc/{process}/stat")).unwrap_or_default();
    status.rsplit(") ").next().is_some_and(|rest| !rest.is_empty() && !rest.starts_with('Z'))
}

/// The process that started one.
#[cfg(target_os = "linux")]
fn parent(process: u32) -> u32 {
    let status = fs::read_to_string(format!("/proc/{process}/stat")).unwrap();
    status.rsplit(") ").next().unwrap().split_whitespace().nth(1).unwrap().parse().unwrap()
}

/// Complete lines only, each with a trace that is complete too.
fn check_what_was_recorded(out: &Path) {
    let recorded = json_lines(&out.join("scenarios.jsonl"));
    assert!((5..1000).contains(&recorded.len()), "{}", recorded.len());
    for outcome in &recorded {
        let trace = fs::read(trace(out, outcome)).unwrap();
        let summary = mcap::Summary::read(&trace).unwrap().unwrap();
        assert!(summary.stats.unwrap().message_count >= outcome["frames"].as_u64().unwrap() * 2);
    }
    assert_eq!(json_file(&out.join("manifest.json"))["seed"], 0);
}

/// Waits until a run has recorded five scenarios, and returns the processes that drive for it.
fn five_recorded(run: u32, out: &Path) -> Vec<u32> {
    let lines = out.join("scenarios.jsonl");
    let count = || fs::read_to_string(&lines).map_or(0, |text| text.lines().count());
    wait_for("the fifth scenario", || count() >= 5);
    wait_for("its topics", || topics_of(run).is_some_and(|(_, slots)| slots.len() == 2));
    topics_of(run).unwrap().1
}

#[cfg(target_os = "linux")]
#[test]
fn a_killed_run_loses_only_what_was_in_flight_and_leaves_nothing_behind() {
    let folder = temp();
    let (command, out) = long_run(folder.path(), "killed");
    let mut child = command.spawn();
    let drivers = five_recorded(child.id(), &out);
    let workers: Vec<u32> = drivers.iter().map(|driver| parent(*driver)).collect();
    let memory = shared_memory(&drivers);
    assert!(!memory.is_empty());
    child.kill().unwrap();
    child.wait().unwrap();

    // Its workers notice, and go with all that they have.
    let processes = [drivers, workers].concat();
    wait_for("the end of the workers", || !processes.iter().any(|process| alive(*process)));
    assert_eq!(memory.iter().filter(|file| Path::new(file).exists()).count(), 0);
    assert_eq!(topics_of(child.id()), None);
    check_what_was_recorded(&out);
    let traces = fs::read_dir(out.join("traces")).unwrap().map(|entry| entry.unwrap().file_name());
    let half: Vec<_> = traces.filter(|name| name.to_string_lossy().ends_with(".part")).collect();
    assert!(half.is_empty(), "{half:?}");
}

#[cfg(target_os = "linux")]
#[test]
fn what_is_left_where_all_processes_of_a_run_are_killed_goes_with_the_next_run() {
    let folder = temp();
    let (command, out) = long_run(folder.path(), "killed");
    let mut child = command.spawn();
    let drivers = five_recorded(child.id(), &out);
    let memory = shared_memory(&drivers);
    // The workers first, as they would clean up after their drivers.
    for process in drivers.iter().map(|driver| parent(*driver)).chain(drivers.iter().copied()) {
        let killed = Command::new("kill").args(["-KILL", &process.to_string()]).status().unwrap();
        assert!(killed.success() || !alive(process));
    }
    child.kill().unwrap();
    child.wait().unwrap();
    check_what_was_recorded(&out);

    let (command, next_out) = long_run(folder.path(), "next");
    let mut next = command.spawn();
    five_recorded(next.id(), &next_out);
    wait_for("the end of what was left", || !memory.iter().any(|file| Path::new(file).exists()));
    next.kill().unwrap();
    next.wait().unwrap();
    assert_eq!(topics_of(child.id()), None);
    quickstart(&folder.path().join("last")).set("duration", 0.5).succeed();
}

#[cfg(target_os = "linux")]
#[test]
fn a_run_goes_on_where_one_of_its_workers_is_killed() {
    let folder = temp();
    let (command, out) = long_run(folder.path(), "disturbed");
    let mut child = command.spawn();
    for _ in 0..2 {
        let drivers = five_recorded(child.id(), &out);
        // Once the worker, and once the process of the components under it.
        for victim in [parent(drivers[0]), drivers[1]] {
            assert!(Command::new("kill").args(["-KILL", &victim.to_string()]).status().unwrap().success());
        }
        let count = || fs::read_to_string(out.join("scenarios.jsonl")).unwrap().lines().count();
        let before = count();
        wait_for("more scenarios", || count() >= before + 5);
    }
    assert!(Command::new("kill").args(["-INT", &child.id().to_string()]).status().unwrap().success());
    let status = child.wait().unwrap();
    assert_eq!(status.code(), Some(130));
    let recorded = json_lines(&out.join("scenarios.jsonl"));
    assert!(recorded.iter().all(|line| line["cause"] == "time_out"), "no component failed");
}

#[test]
fn runs_that_start_at_the_same_time_have_records_of_their_own() {
    let folder = temp();
    let source =
        r#"pdk.drive({ simulator = "misbehave", driver = "misbehave", scenarios = { {}, { seed = 1 } } })"#;
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
    assert_eq!(outcomes[0]["scenario"]["mode"], "realtime");
    // Half a second of a thousand frames a second; what is under way at its end still counts.
    assert!(skipped > 100 && frames > 0 && frames + skipped > 500, "{frames} {skipped}");
    Pdk::new(["replay"]).arg(&out).succeed();

    fs::write(&pipeline, script("sometimes")).unwrap();
    let expected = "`mode` is `sometimes`, but has to be lockstep or realtime";
    Pdk::new(["run", "--out"]).arg(folder.path().join("other")).arg(&pipeline).fail(1, &[expected]);
}

#[test]
fn a_scenario_says_what_a_failure_is() {
    let folder = temp();
    let source = format!(
        r#"local outcomes = pdk.drive({{
            simulator = {SIMULATOR_LUA}, driver = "lane_keeper", duration = 4, images_every = 0,
            failure = {{ over_line = 0.001 }},
            scenarios = {{
                {{ road = {ROAD_LUA} }},
                {{ road = {ROAD_LUA}, failure = {{ lane_departure = 0.01 }} }},
                {{ road = {ROAD_LUA}, failure = {{ standstill_speed = 50, standstill_seconds = 0.5 }} }},
            }},
        }})
        pdk.show(outcomes)
        pdk.save("told.json", outcomes)"#
    );
    let out = folder.path().join("record");
    let ran = Pdk::new(["run", "--out"]).arg(&out).arg(pipeline(folder.path(), &source)).succeed();
    for mark in ["ok   finished", "FAIL lane departure", "STOP no progress", "cut short"] {
        assert!(ran.stdout.contains(mark), "{mark}: {}", ran.stdout);
    }
    let told = json_file(&out.join("told.json"));
    let verdicts: Vec<_> = (0..3).map(|i| told[i]["verdict"].clone()).collect();
    assert_eq!(verdicts, ["passed", "unsafe", "stopped"]);
    assert_eq!(told[2]["time"], 0.5);
    let measures = &told[0]["measures"];
    for field in
        ["over_line_seconds", "rms_lateral_acceleration", "max_lateral_acceleration", "rms_jerk", "max_jerk"]
    {
        assert!(measures[field].as_f64().unwrap() > 0.0, "{field}: {measures}");
    }
    assert!(measures["over_line_from"].as_f64().unwrap() < told[0]["time"].as_f64().unwrap());

    // It is part of what is driven: of its id, and of what a replay drives again.
    let lines = json_lines(&out.join("scenarios.jsonl"));
    assert_eq!(lines[0]["scenario"]["failure"], json!({"over_line": 0.001}));
    assert_eq!(lines[1]["scenario"]["failure"], json!({"lane_departure": 0.01, "over_line": 0.001}));
    assert_ne!(lines[0]["id"], lines[1]["id"]);
    Pdk::new(["replay"]).arg(&out).succeed();
}
