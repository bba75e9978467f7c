//! `pdk replay`: what is recorded comes out again bit for bit, and what does not is named.

use std::fs;
use std::path::{Path, PathBuf};

use pdk_model::level::Level;
use pdk_model::outcome::Cause;
use pdk_record::trace::reader::read_steps;
use pdk_record::trace::step::Step;
use pdk_sdk::prelude::FrameBuf;
use pdk_tests::process::{json_lines, pipeline};
use pdk_tests::{Pdk, datasets, pictures, records, temp};
use pdk_video::{Reader, Yuv420};
use serde_json::json;

/// Several drives with chains, courses of intensity, an overlay of the user's own and a driver with parameters. `sticker`
/// is a picture in an overlays folder.
const SOURCE: &str = r#"
    local simulator = { name = "lane", width = 80, height = 60, rate = 20 }
    local road = { angles = { 0, 4, -4 }, segment = 10 }
    local function drive(driver, lists)
        local scenarios = {}
        for seed, list in lists do
            table.insert(scenarios, { road = road, seed = seed, perturbations = list })
        end
        pdk.drive({ simulator = simulator, driver = driver, duration = 1.5, images_every = 0, scenarios = scenarios })
    end
    drive("lane_keeper", {
        {}, { "gaussian_noise@2", "contrast@1" },
        { { name = "speckle_noise_filter", level = function(time) return math.min(time, 4) end, probability = 0.5 } },
    })
    drive({ name = "lane_keeper", target_speed = 6 }, {
        { { name = "sticker", level = { ramp = { from = 0, to = 4, ["end"] = 1 } } } },
        { { name = "impulse_noise", level = 3, draws = "per_sequence", region = { box = { 0, 0.5, 1, 1 } } } },
    })
"#;

/// A record of [`SOURCE`] with another seed than the usual.
fn record(folder: &Path) -> PathBuf {
    let sticker = folder.join("mine/overlays/sticker.png");
    fs::create_dir_all(sticker.parent().unwrap()).unwrap();
    pictures::write(&sticker, 16, 12);
    let out = folder.join("record");
    Pdk::new(["run", "--seed", "5", "--workers", "2", "--out"])
        .arg(&out)
        .arg("--plugins")
        .arg(folder.join("mine"))
        .arg(pipeline(folder, SOURCE))
        .succeed();
    out
}

fn replay(record: &Path) -> Pdk {
    Pdk::new(["replay"]).arg(record)
}

/// The trace of the scenario with this number.
fn trace(record: &Path, number: usize) -> PathBuf {
    records::trace(record, &json_lines(&record.join("scenarios.jsonl"))[number])
}

#[test]
fn what_was_recorded_comes_out_again_on_any_number_of_workers() {
    let folder = temp();
    let out = record(folder.path());
    let before = fs::read_dir(&out).unwrap().count();
    let outcomes = json_lines(&out.join("scenarios.jsonl"));
    assert_eq!(outcomes.len(), 5);
    for workers in ["1", "2", "5"] {
        // From elsewhere, and with nothing said about where the sticker lies.
        let elsewhere = temp();
        let ran = replay(&out).args(["--workers", workers]).folder(elsewhere.path()).succeed();
        let lines: Vec<_> = ran.stdout.lines().collect();
        for (number, (outcome, line)) in outcomes.iter().zip(&lines).enumerate() {
            let frames = &outcome["frames"];
            assert!(line.starts_with(&format!("scenario {number} (")), "{line}");
            assert!(line.ends_with(&format!("): {frames} frames, equal")), "{line}");
        }
        assert!(lines[1].starts_with("scenario 1 (gaussian_noise@2 + contrast@1): "), "{}", lines[1]);
        assert!(lines[5].starts_with("5 of 5 equal: "), "{}", lines[5]);
        assert_eq!((lines.len(), ran.stderr.as_str()), (6, ""));
        assert_eq!(fs::read_dir(elsewhere.path()).unwrap().count(), 0);
    }
    let some = replay(&out).args(["--scenario", "3", "--scenario", "1", "--json"]).succeed().json();
    let scenarios = some["scenarios"].as_array().unwrap();
    let numbers: Vec<_> = scenarios.iter().map(|scenario| scenario["number"].as_u64().unwrap()).collect();
    assert_eq!(numbers, [1, 3]);
    assert!(scenarios.iter().all(|scenario| scenario["id"].as_str().unwrap().len() == 32));
    // By id as well, as far as it is unique.
    let id = outcomes[2]["id"].as_str().unwrap();
    let found = replay(&out).args(["--scenario", &id[..8]]).succeed().stdout;
    assert!(found.starts_with("scenario 2 ("), "{found}");
    assert!(scenarios.iter().all(|scenario| scenario["equal"] == true && scenario["difference"].is_null()));
    // The record is only read.
    assert_eq!(fs::read_dir(&out).unwrap().count(), before);
    assert_eq!(json_lines(&out.join("scenarios.jsonl")), outcomes);
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn the_first_difference_is_named_with_both_values() {
    let folder = temp();
    let out = record(folder.path());
    let path = trace(&out, 1);
    let lines = out.join("scenarios.jsonl");
    let (whole, text) = (fs::read(&path).unwrap(), fs::read_to_string(&lines).unwrap());
    let restore = || {
        fs::write(&path, &whole).unwrap();
        fs::write(&lines, &text).unwrap();
    };
    let steps = read_steps(&path).unwrap();
    let Step { state, control, frame_hash, .. } = steps[7];

    let one_bit = |value: f64| f64::from_bits(value.to_bits() ^ 1);
    type Change = fn(&mut Step, fn(f64) -> f64);
    let changes: [(Change, String); 4] = [
        (
            |step, change| step.control.steering = change(step.control.steering),
            format!("steering was {} and is {}", one_bit(control.steering), control.steering),
        ),
        (
            |step, change| step.control.throttle = change(step.control.throttle),
            format!("throttle was {} and is {}", one_bit(control.throttle), control.throttle),
        ),
        (
            |step, change| step.state.position[2] = change(step.state.position[2]),
            format!("z was {} and is {}", one_bit(state.position[2]), state.position[2]),
        ),
        (
            |step, _| step.frame_hash ^= 1,
            format!("the hash of the frame was {:016x} and is {frame_hash:016x}", frame_hash ^ 1),
        ),
    ];
    for (change, sentence) in changes {
        restore();
        // Later differences are not the first one.
        records::change_steps(&path, |steps| {
            change(&mut steps[7], one_bit);
            steps[9].control.steering = 0.5;
        });
        let line = format!(
            "scenario 1 (gaussian_noise@2 + contrast@1): frame 7 at {:.3} s: {sentence}",
            steps[7].state.time
        );
        let parts = ["1 of 5 scenarios differ from the record; the first: ", &line];
        replay(&out).fail(1, &parts);
        replay(&out).args(["--scenario", "1"]).fail(1, &["it differs from the record: ", &line]);
        replay(&out).args(["--scenario", "2"]).succeed();
    }
    let found = replay(&out).args(["--scenario", "1", "--json"]).run();
    assert_eq!(found.code, Some(1));
    let difference = found.json()["scenarios"][0]["difference"].clone();
    assert_eq!((&difference["frame"], &difference["what"]), (&json!(7), &json!("the hash of the frame")));
    assert_eq!(difference["replayed"], json!(format!("{frame_hash:016x}")));

    // Scenarios that end elsewhere.
    restore();
    records::change_steps(&path, |steps| steps.truncate(9));
    let parts = ["frame 9 at ", "the end of the scenario was before it and is after it"];
    replay(&out).fail(1, &parts);
    restore();
    records::change_steps(&path, |steps| steps.push(*steps.last().unwrap()));
    let parts = ["the end of the scenario was after it and is before it"];
    replay(&out).fail(1, &parts);
    restore();

    // The outcome alone.
    records::edit(&out, |lines| lines[0].outcome.cause = Cause::Collision);
    replay(&out)
        .fail(1, &["scenario 0 (nominal): the outcome: `cause` was \"collision\" and is \"time_out\""]);
    let digest = json_lines(&lines)[4]["digest"].clone();
    fs::write(&lines, &text).unwrap();
    // Steps of another outcome are not compared.
    records::edit(&out, |lines| lines[4].outcome.digest = "0".to_owned());
    let digest = digest.as_str().unwrap();
    replay(&out)
        .fail(1, &["1 of 5 ", "could not be compared", &format!("digest {digest} and the outcome has 0")]);
    // Edited by hand, a line does not count.
    fs::write(&lines, text.replacen("\"cause\":\"time_out\"", "\"cause\":\"collision\"", 1)).unwrap();
    replay(&out).fail(1, &["scenarios.jsonl:1 is damaged or was edited"]);
    fs::write(&lines, text).unwrap();
    replay(&out).succeed();
}

#[test]
fn another_seed_or_perturbation_shows_in_the_frames() {
    let folder = temp();
    let out = record(folder.path());
    let lines = out.join("scenarios.jsonl");
    let text = fs::read_to_string(&lines).unwrap();
    records::change_scenario(&out, 1, |scenario| scenario.seed += 1);
    let parts = ["1 of 5 scenarios differ", "scenario 1 ", "frame 0 at 0.000 s: the hash of the frame was "];
    replay(&out).fail(1, &parts);
    fs::write(&lines, &text).unwrap();
    records::change_scenario(&out, 1, |scenario| scenario.perturbations[1].level = Level::Constant(1.5));
    replay(&out).fail(1, &["1 of 5 scenarios differ", "scenario 1 ", "frame 0 at 0.000 s: the hash of "]);
    // What stands beside the road is drawn from the seed as well, so it shows without noise.
    fs::write(&lines, &text).unwrap();
    records::change_scenario(&out, 0, |scenario| scenario.seed += 1);
    replay(&out)
        .fail(1, &["1 of 5 scenarios differ", "scenario 0 (nominal): frame 0 at 0.000 s: the hash of "]);
    // The seed of the run is in its scenarios already.
    fs::write(&lines, &text).unwrap();
    let manifest = out.join("manifest.json");
    let seed = fs::read_to_string(&manifest).unwrap();
    assert!(seed.contains("\"seed\": 5"));
    fs::write(&manifest, seed.replacen("\"seed\": 5", "\"seed\": 6", 1)).unwrap();
    replay(&out).succeed();
}

#[test]
fn traces_that_cannot_be_read_are_named_and_the_others_compared() {
    let folder = temp();
    let out = record(folder.path());
    pictures::cut(&trace(&out, 1));
    let ran = replay(&out).run();
    assert_eq!((ran.code, ran.stdout.matches(", equal").count()), (Some(1), 4), "{}", ran.stdout);
    let parts = ["1 of 5 scenarios could not be compared", ".mcap is cut off after "];
    replay(&out).fail(1, &parts);
    fs::remove_file(trace(&out, 1)).unwrap();
    replay(&out)
        .args(["--scenario", "1"])
        .fail(1, &[".mcap is missing; delete its line from scenarios.jsonl"]);
    replay(&out).args(["--scenario", "1", "--clip", "x.mp4"]).folder(folder.path()).fail(1, &["is missing"]);
    assert!(!folder.path().join("x.mp4").exists());
    records::change_steps(&trace(&out, 2), |steps| steps[3].control.throttle = 0.5);
    replay(&out)
        .fail(1, &["1 of 5 scenarios differ from the record and 1 could not be compared", "frame 3 at"]);
}

#[test]
fn a_record_without_scenarios_is_rejected() {
    let folder = temp();
    replay(folder.path()).fail(1, &["holds no record", "manifest.json"]);
    replay(&folder.path().join("nowhere")).fail(1, &["holds no record"]);

    let offline = folder.path().join("offline");
    datasets::folder(&folder.path().join("data"), 3, 32, 24);
    let source = r#"pdk.evaluate({ dataset = pdk.path("data"), driver = "misbehave", perturbations = { "contrast" }, levels = { 1 } })"#;
    let script = pipeline(folder.path(), source);
    Pdk::new(["run", "--out"]).arg(&offline).arg(script).misbehave().succeed();
    replay(&offline).fail(1, &["holds results of pdk.evaluate only"]);

    let out = record(folder.path());
    replay(&out).args(["--scenario", "7"]).fail(1, &["holds no scenario 7; it has 5 of them, from 0 to 4"]);
    replay(&out)
        .args(["--clip", "x.mp4"])
        .fail(1, &["--clip shows one scenario or two, and these are 5", "--scenario"]);
    replay(&out).args(["--scenario", "1", "--clip", "x.gif"]).fail(1, &["x.gif", ".mp4"]);
    replay(&out).args(["--patience", "0"]).fail(1, &["--patience"]);
    assert_eq!(replay(&out).args(["--workers", "0"]).run().code, Some(2));
    fs::write(out.join("scenarios.jsonl"), "").unwrap();
    replay(&out).fail(1, &["holds no scenarios: its run ended before the first was over"]);
    fs::write(out.join("manifest.json"), "{}").unwrap();
    replay(&out).fail(1, &["manifest.json"]);
}

#[test]
fn changed_parts_are_reported_and_missing_ones_are_errors() {
    let folder = temp();
    let plugins = folder.path().join("mine");
    fs::create_dir(&plugins).unwrap();
    let script = |tone: &str| {
        let source = format!(
            "return {{ doc = 'tints', parameters = {{}}, apply = function(image, cx) return image:fill({tone}) end }}"
        );
        fs::write(plugins.join("tint.lua"), source).unwrap();
    };
    script("9, 9, 9");
    let out = folder.path().join("record");
    let source = r#"pdk.drive({ simulator = "misbehave", driver = "misbehave", scenarios = { {}, { perturbations = { "tint@1" } } } })"#;
    let ran = Pdk::new(["run", "--plugins"])
        .arg(&plugins)
        .arg("--out")
        .arg(&out)
        .arg(pipeline(folder.path(), source))
        .misbehave()
        .run();
    assert_eq!(ran.code, Some(0), "{}", ran.stderr);
    assert_eq!(replay(&out).succeed().stderr, "");
    script("9, 9, 8");
    let parts = ["tint.lua, whose content is not the recorded one, for the perturbation `tint`", "--trust"];
    replay(&out).fail(1, &parts);
    let ran = replay(&out).arg("--trust").run();
    assert_eq!(ran.code, Some(1));
    let warnings: Vec<_> = ran.stderr.lines().filter(|line| line.contains("warning")).collect();
    assert_eq!(warnings.len(), 2, "{}", ran.stderr);
    assert!(warnings[0].contains(parts[0]), "{}", warnings[0]);
    assert!(
        warnings[1].contains("since the run was recorded, the file of the perturbation `tint`"),
        "{}",
        warnings[1]
    );
    assert!(ran.stdout.contains("scenario 0 (nominal): 21 frames, equal"), "{}", ran.stdout);
    assert!(ran.stdout.contains("frame 0 at 0.000 s: the hash of the frame"), "{}", ran.stdout);

    script("9, 9, 9");
    let manifest = out.join("manifest.json");
    let text = fs::read_to_string(&manifest).unwrap();
    fs::write(
        &manifest,
        text.replacen("\"pdk\": \"", "\"pdk\": \"0.0.", 1).replacen("\"version\": 1", "\"version\": 9", 1),
    )
    .unwrap();
    let ran = replay(&out).succeed();
    assert!(ran.stderr.contains("the version of pdk was 0.0."), "{}", ran.stderr);
    let version = "the version of the perturbation `tint` was 9 and is 1, so the replay";
    assert!(ran.stderr.contains(version), "{}", ran.stderr);

    fs::remove_file(plugins.join("tint.lua")).unwrap();
    let parts = ["there is no perturbation `tint`", "tint.lua", "--plugins"];
    replay(&out).fail(1, &parts);
    replay(&out).args(["--scenario", "0"]).succeed();
}

#[test]
fn an_overlay_that_is_gone_is_named() {
    let folder = temp();
    let out = record(folder.path());
    let sticker = folder.path().join("mine/overlays/sticker.png");
    pictures::write(&sticker, 17, 12);
    let ran = replay(&out).run();
    assert_eq!(ran.code, Some(1));
    let warning =
        format!("warning: since the run was recorded, the file {} is a different one", sticker.display());
    assert!(ran.stderr.contains(&warning), "{}", ran.stderr);
    assert_eq!(ran.stdout.matches(", equal").count(), 4, "{}", ran.stdout);
    fs::remove_file(&sticker).unwrap();
    replay(&out)
        .fail(1, &["there is no perturbation `sticker`", &sticker.display().to_string(), "--drop-ins"]);
    let ran = replay(&out).args(["--scenario", "1"]).succeed();
    assert!(ran.stderr.contains("sticker.png no longer exists"), "{}", ran.stderr);
}

#[test]
fn a_component_that_failed_fails_again() {
    let folder = temp();
    let out = folder.path().join("record");
    let source = r#"
        pdk.drive({ simulator = "misbehave", driver = { name = "misbehave", how = "panic_in_drive", at = 6 },
            scenarios = { { seed = 1 }, { seed = 2 } } })
    "#;
    let script = pipeline(folder.path(), source);
    Pdk::new(["run", "--out"]).arg(&out).arg(script).misbehave().fail(1, &["2 of 2 scenarios"]);
    let ran = replay(&out).misbehave().succeed();
    assert_eq!(ran.stdout.matches("6 frames, equal").count(), 2, "{}", ran.stdout);
}

/// The pictures of a video.
fn video(path: &Path) -> (Vec<FrameBuf>, f64) {
    let mut reader = Reader::open_file(path).unwrap();
    let (mut planes, mut frames) = (Yuv420::default(), Vec::new());
    while reader.next(&mut planes).unwrap() {
        let mut frame = FrameBuf::new(planes.width, planes.height);
        planes.to_rgb(frame.as_mut());
        frames.push(frame);
    }
    (frames, reader.rate())
}

/// Pixels of the red that marks a failure.
fn red(frame: &FrameBuf) -> usize {
    frame.data().chunks_exact(3).filter(|p| p[0] > 180 && p[1] < 90 && p[2] < 90).count()
}

/// The mean color of a field within the frame that starts there; both frames of a clip have the same size.
fn mean(frame: &FrameBuf, left: usize) -> f64 {
    let rows = 40..frame.height() / 2;
    let values: Vec<u8> =
        rows.flat_map(|y| frame.as_ref().row(y)[3 * left..3 * (left + 460)].to_vec()).collect();
    values.iter().map(|&value| f64::from(value)).sum::<f64>() / values.len() as f64
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn a_clip_shows_every_frame_and_marks_the_last_second_of_a_failure() {
    let folder = temp();
    // The misbehaving driver goes straight on where the road bends.
    let source = r#"
        local simulator = { name = "lane", width = 80, height = 60, rate = 20 }
        pdk.drive({ simulator = simulator, driver = "misbehave", duration = 20, scenarios = {
            { road = { angles = { 0, 40, 40 }, segment = 15 } } } })
        pdk.drive({ simulator = simulator, driver = "lane_keeper", scenarios = {
            { road = { angles = { 0, 4, -4 }, segment = 10 }, perturbations = { "increase_brightness@4" } } } })
    "#;
    let out = folder.path().join("record");
    Pdk::new(["run", "--out"]).arg(&out).arg(pipeline(folder.path(), source)).misbehave().succeed();
    let outcomes = json_lines(&out.join("scenarios.jsonl"));
    assert_eq!(
        (&outcomes[0]["cause"], &outcomes[1]["cause"]),
        (&json!("lane_departure"), &json!("finished"))
    );
    let film = |index: usize| {
        let clip = folder.path().join(format!("clips/{index}.mp4"));
        let said =
            replay(&out).args(["--scenario", &index.to_string(), "--clip"]).arg(&clip).succeed().stdout;
        assert!(said.ends_with(&format!("Clip: {}\n", clip.display())), "{said}");
        let (frames, rate) = video(&clip);
        // The last frame of a failure is held for a second.
        let held = if index == 0 { 20 } else { 0 };
        assert_eq!((frames.len() as u64, rate), (outcomes[index]["frames"].as_u64().unwrap() + held, 20.0));
        // Two frames of six times their size beside each other.
        assert!(frames[0].width() >= 960 && frames[0].height() >= 360);
        frames
    };
    let failed = film(0);
    let marked: Vec<bool> = failed.iter().map(|frame| red(frame) > 2000).collect();
    let first = failed.len() - 20 - 21;
    assert!(marked[first..].iter().all(|marked| *marked) && !marked[..first].iter().any(|marked| *marked));
    // The very last frame is there, and stays.
    let last = failed.len() - 21;
    assert!((mean(&failed[last], 20) - mean(&failed[failed.len() - 1], 20)).abs() < 1.0);
    assert!((mean(&failed[3], 20) - mean(&failed[3], 512)).abs() < 2.0);
    let finished = film(1);
    assert!(finished.iter().all(|frame| red(frame) < 2000));
    // The driver saw it brighter.
    assert!(mean(&finished[3], 512) > mean(&finished[3], 20) + 30.0);
    // The curves have come further.
    assert_ne!(finished[5].data(), finished[finished.len() - 1].data());
}
