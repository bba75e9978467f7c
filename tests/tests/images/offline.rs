//! Offline evaluation: datasets with and without faults, and models.

use std::fs;
use std::path::{Path, PathBuf};

use pdk_tests::process::{json_file, json_lines};
use pdk_tests::{Pdk, datasets, onnx, pictures, real_data, repository, temp};
use serde_json::{Value, json};

/// Writes a recording of this many frames of this width and height.
type Make = fn(&Path, u32, u32, u32);

/// The pipeline that comes with pdk.
fn offline(out: &Path, dataset: &Path, model: &Path) -> Pdk {
    Pdk::new(["run", "--out"])
        .arg(out)
        .arg(repository().join("scripts/offline.lua"))
        .set("dataset", dataset.display())
        .set("model", model.display())
        .set("driver.engine", "pdk")
        .set("perturbations", "gaussian_noise,contrast")
        .set("levels", "0,4")
}

/// The pipeline with a driver that needs no model: it steers by the pixel in the middle.
fn by_brightness(folder: &Path, dataset: &Path) -> (Pdk, PathBuf) {
    let out = folder.join("record");
    let source = r#"
        local settings = pdk.settings({ dataset = "", driver = "misbehave" })
        pdk.show(pdk.evaluate({ dataset = settings.dataset, driver = settings.driver,
            perturbations = { "contrast" }, levels = { 0, 4 } }))
    "#;
    let pipeline = pdk_tests::process::pipeline(folder, source);
    let command = Pdk::new(["run", "--out"]).arg(&out).arg(pipeline).misbehave();
    (command.set("dataset", dataset.display()), out)
}

/// The sums that the summary makes of the lines, made once more.
fn check_summary(out: &Path) -> Value {
    let summary = json_file(&out.join("summary.json"))["evaluations"][0].clone();
    let lines = json_lines(&out.join("results.jsonl"));
    let mean = |lines: &[&Value], of: &dyn Fn(&Value) -> f64| {
        lines.iter().map(|line| of(line)).sum::<f64>() / lines.len() as f64
    };
    let steering = |line: &Value, whose: &str| line[whose]["steering"].as_f64().unwrap();
    for row in summary["rows"].as_array().unwrap() {
        let lines: Vec<_> = lines
            .iter()
            .filter(|line| line["perturbation"] == row["perturbation"] && line["level"] == row["level"])
            .collect();
        assert_eq!(summary["frames"], lines.len());
        let error = mean(&lines, &|line| (steering(line, "perturbed") - steering(line, "truth")).abs());
        let drift = mean(&lines, &|line| (steering(line, "perturbed") - steering(line, "original")).abs());
        let original = mean(&lines, &|line| (steering(line, "original") - steering(line, "truth")).abs());
        let close = |value: &Value, expected: f64| (value.as_f64().unwrap() - expected).abs() < 1e-12;
        assert!(close(&row["steering_error"], error) && close(&row["steering_drift"], drift), "{row}");
        assert!(close(&summary["original_steering_error"], original));
    }
    summary
}

#[test]
fn error_and_drift_are_three_different_numbers_for_both_formats() {
    let folder = temp();
    let model = folder.path().join("pilot.onnx");
    onnx::pilot(&model, 3, 30, 40);
    let datasets: [(&str, Make); 2] = [("folder", datasets::folder), ("tub", datasets::tub)];
    let mut summaries = Vec::new();
    for (name, make) in datasets {
        let dataset = folder.path().join(name);
        make(&dataset, 9, 40, 30);
        let out = folder.path().join(format!("{name}-record"));
        let ran = offline(&out, &dataset, &model).succeed();
        assert!(ran.stdout.contains("gaussian_noise") && ran.stdout.contains("level 4"), "{}", ran.stdout);
        let summary = check_summary(&out);
        assert_eq!((&summary["frames"], &summary["bad_frames"]), (&json!(9), &json!([])));
        assert_eq!(json_lines(&out.join("results.jsonl")).len(), 9 * 4);
        let manifest = json_file(&out.join("manifest.json"));
        let files = manifest["files"].as_array().unwrap();
        for read in [json!(model), json!(dataset)] {
            assert!(
                files.iter().any(|file| file["path"] == read),
                "the manifest has no hash of {read}: {files:?}"
            );
        }
        summaries.push(summary);
    }
    let row = &summaries[0]["rows"][1];
    let numbers = [&summaries[0]["original_steering_error"], &row["steering_error"], &row["steering_drift"]];
    let numbers = numbers.map(|number| number.as_f64().unwrap());
    assert!(numbers.iter().all(|number| *number > 0.0));
    assert!(numbers[0] != numbers[1] && numbers[1] != numbers[2] && numbers[0] != numbers[2], "{numbers:?}");
    // The same pictures and records in both formats.
    assert_eq!(summaries[0], summaries[1]);
}

#[test]
fn lines_and_rows_tell_parameters_and_evaluations_apart() {
    let folder = temp();
    datasets::folder(&folder.path().join("data"), 3, 32, 24);
    let source = r#"
        local request = { dataset = pdk.path("data"), driver = "misbehave", levels = { 2, 4 },
            perturbations = { "contrast", { name = "motion_blur", degrees = 0 }, { name = "motion_blur", degrees = 40 } } }
        pdk.show(pdk.evaluate(request))
        request.frames = 2
        pdk.evaluate(request)
    "#;
    let out = folder.path().join("record");
    let pipeline = pdk_tests::process::pipeline(folder.path(), source);
    let ran = Pdk::new(["run", "--out"]).arg(&out).arg(&pipeline).misbehave().succeed();
    for label in ["contrast", "motion_blur,degrees=0", "motion_blur,degrees=40"] {
        let has_row = ran.stdout.lines().any(|line| line.starts_with(&format!("{label} ")));
        assert!(has_row, "{label}: {}", ran.stdout);
    }
    // How fast it went is said without being asked for.
    for frames in [18, 12] {
        let start = format!("{frames} perturbed frames in ");
        let line = ran.stdout.lines().find(|line| line.starts_with(&start)).expect("no line with the speed");
        assert!(line.contains(" s: ") && line.ends_with(" a second"), "{line}");
    }
    let lines = json_lines(&out.join("results.jsonl"));
    let key = |line: &Value| {
        [&line["evaluation"], &line["index"], &line["label"], &line["level"]].map(Value::to_string).join(" ")
    };
    let keys: std::collections::BTreeSet<_> = lines.iter().map(key).collect();
    assert_eq!((keys.len(), lines.len()), (30, 30), "two lines of the same name");
    let (first, second) = lines.split_at(18);
    assert!(first.iter().all(|line| line["evaluation"] == 0));
    assert!(second.iter().all(|line| line["evaluation"] == 1));
    let evaluations = json_file(&out.join("summary.json"))["evaluations"].clone();
    for (number, evaluation) in evaluations.as_array().unwrap().iter().enumerate() {
        assert_eq!(evaluation["evaluation"], number);
        let labels: Vec<_> = evaluation["rows"].as_array().unwrap().iter().map(|row| &row["label"]).collect();
        assert_eq!(
            labels[2..5],
            ["motion_blur,degrees=0", "motion_blur,degrees=0", "motion_blur,degrees=40"]
        );
    }

    let json = Pdk::new(["run", "--json", "--out"]).arg(folder.path().join("json")).arg(&pipeline);
    assert_eq!(json.misbehave().succeed().json()["summary"]["evaluations"], evaluations);
}

#[test]
fn omissions_are_reported_even_if_the_script_ends_in_an_error() {
    let folder = temp();
    let data = folder.path().join("data");
    datasets::folder(&data, 3, 32, 24);
    pictures::cut(&data.join("1_camera.jpg"));
    let source = r#"
        pdk.evaluate({ dataset = pdk.path("data"), driver = "misbehave", perturbations = { "contrast" }, levels = { 1 } })
        error("on purpose")
    "#;
    let out = folder.path().join("record");
    let pipeline = pdk_tests::process::pipeline(folder.path(), source);
    let ran = Pdk::new(["run", "--out"]).arg(&out).arg(pipeline).misbehave().run();
    assert_eq!(ran.code, Some(1));
    assert!(ran.stderr.contains("pdk: warning: 1_camera.jpg was left out: "), "{}", ran.stderr);
    assert!(ran.stderr.contains("on purpose"), "{}", ran.stderr);
    assert!(ran.stdout.contains(&format!("Record: {}", out.display())), "{}", ran.stdout);
    assert_eq!(json_file(&out.join("summary.json"))["evaluations"][0]["frames"], 2);
}

#[test]
fn the_truth_is_the_recorded_steering() {
    let folder = temp();
    let dataset = folder.path().join("data");
    datasets::folder(&dataset, 12, 16, 12);
    let (command, out) = by_brightness(folder.path(), &dataset);
    command.succeed();
    let lines = json_lines(&out.join("results.jsonl"));
    for (position, line) in lines.iter().enumerate() {
        let number = position as u32 / 2;
        // By number, so that 10 comes after 9.
        assert_eq!(
            (&line["index"], &line["frame"]),
            (&json!(number), &json!(format!("{number}_camera.jpg")))
        );
        assert_eq!(line["truth"]["steering"].as_f64().unwrap(), datasets::steering(number));
    }
    check_summary(&out);
}

#[test]
fn a_frame_that_cannot_be_read_is_named_and_counted() {
    let folder = temp();
    let dataset = folder.path().join("data");
    datasets::folder(&dataset, 6, 40, 30);
    pictures::cut(&dataset.join("2_camera.jpg"));
    fs::write(dataset.join("3_camera.jpg"), "no picture").unwrap();
    fs::remove_file(dataset.join("record_4.json")).unwrap();
    fs::remove_file(dataset.join("5_camera.jpg")).unwrap();
    let (command, out) = by_brightness(folder.path(), &dataset);
    let ran = command.succeed();
    let summary = check_summary(&out);
    assert_eq!(summary["frames"], 2);
    let bad: Vec<_> =
        summary["bad_frames"].as_array().unwrap().iter().map(|bad| bad["frame"].as_str().unwrap()).collect();
    assert_eq!(bad, ["2_camera.jpg", "3_camera.jpg", "4_camera.jpg", "record_5.json"]);
    for name in bad {
        let warning = format!("pdk: warning: {name} was left out: ");
        assert_eq!(ran.stderr.matches(&warning).count(), 1, "{}", ran.stderr);
    }
    assert!(ran.stdout.contains("2 frames, 4 left out"), "{}", ran.stdout);
    let lines = json_lines(&out.join("results.jsonl"));
    assert_eq!(lines.iter().filter(|line| line.get("error").is_some()).count(), 4);
    assert!(lines.iter().map(|line| line["index"].as_u64().unwrap()).is_sorted());
}

#[test]
fn a_recording_with_nothing_in_it_is_an_error() {
    let folder = temp();
    for (name, make) in [("folder", datasets::folder as Make), ("tub", datasets::tub)] {
        let dataset = folder.path().join(name);
        make(&dataset, 0, 40, 30);
        by_brightness(folder.path(), &dataset).0.fail(1, &[name]);
    }
    by_brightness(folder.path(), Path::new("/no/such/recording")).0.fail(1, &["/no/such/recording"]);
}

#[test]
fn frames_that_are_all_bad_are_an_error_with_the_first_reason() {
    let folder = temp();
    let dataset = folder.path().join("data");
    datasets::tub(&dataset, 4, 40, 30);
    for number in 0..4 {
        pictures::cut(&dataset.join(format!("images/{number}_cam_image_array_.jpg")));
    }
    let (command, out) = by_brightness(folder.path(), &dataset);
    command.fail(1, &["none of the 4 frames", "0_cam_image_array_.jpg"]);
    assert_eq!(json_lines(&out.join("results.jsonl")).len(), 4);
}

#[test]
fn models_that_cannot_drive_are_refused_by_name() {
    let folder = temp();
    let path = |name: &str| folder.path().join(name);
    datasets::folder(&path("data"), 2, 40, 30);
    onnx::pilot(&path("seven_channels.onnx"), 7, 30, 40);
    fs::write(path("text.onnx"), "no network").unwrap();
    onnx::pilot(&path("cut.onnx"), 3, 30, 40);
    pictures::cut(&path("cut.onnx"));
    fs::write(path("empty.onnx"), "").unwrap();
    onnx::ambiguous(&path("ambiguous.onnx"), 30, 40);
    offline(&path("record-ambiguous"), &path("data"), &path("ambiguous.onnx"))
        .fail(1, &["driver `onnx`", "two values are called `control`"]);
    for name in ["seven_channels.onnx", "text.onnx", "cut.onnx", "empty.onnx", "missing.onnx"] {
        offline(&path(&format!("record-{name}")), &path("data"), &path(name))
            .fail(1, &["driver `onnx`", name]);
    }
    assert!(
        offline(&path("record-nowhere"), Path::new("ex/nosuch"), &path("other_size.onnx"))
            .fail(1, &["there is no file or folder ex/nosuch to open as a dataset; correct its path"])
            .ends_with("correct its path")
    );
    // Frames of another size are not a mistake: they are resized.
    onnx::pilot(&path("other_size.onnx"), 3, 12, 16);
    offline(&path("record-other"), &path("data"), &path("other_size.onnx")).succeed();
}

#[test]
fn what_the_pipeline_needs_is_asked_for() {
    let folder = temp();
    let script = repository().join("scripts/offline.lua");
    let run = || Pdk::new(["run"]).arg(&script).folder(folder.path());
    run().fail(1, &["--set dataset=DIR"]);
    run().set("dataset", "x").fail(1, &["--set model=FILE.onnx"]);
    assert_eq!(fs::read_dir(folder.path()).unwrap().count(), 0, "a run that did not begin leaves nothing");
    datasets::folder(&folder.path().join("data"), 2, 40, 30);
    run()
        .set("dataset", "data")
        .set("model", "y")
        .set("driver", "onx")
        .fail(1, &["there is no driver `onx`", "did you mean `onnx`"]);
}

#[test]
fn a_real_recording_with_a_real_model() {
    let (Some(tub), Some(model)) = (real_data("tub"), real_data("tub_pilot.onnx")) else { return };
    let folder = temp();
    let out = folder.path().join("record");
    offline(&out, &tub, &model).set("frames", 60).succeed();
    let summary = check_summary(&out);
    assert_eq!((&summary["frames"], &summary["bad_frames"]), (&json!(60), &json!([])));
    let original = summary["original_steering_error"].as_f64().unwrap();
    // A model that was trained on these frames; guessing the mean is .42 off.
    assert!((0.01..0.15).contains(&original), "{original}");
    let rows = summary["rows"].as_array().unwrap();
    let drift = |row: usize| rows[row]["steering_drift"].as_f64().unwrap();
    assert!(drift(1) > drift(0), "more noise, more drift: {rows:?}");
}

#[test]
fn a_trace_is_a_recording_of_what_the_driver_did() {
    let folder = temp();
    let drive = folder.path().join("drive.lua");
    let scenario = r#"{ simulator = "lane", driver = "lane_keeper", images_every = 1, scenarios = { { duration = 2 } } }"#;
    fs::write(&drive, format!("pdk.drive({scenario})")).unwrap();
    let record = folder.path().join("record");
    Pdk::new(["run", "--out"]).arg(&record).arg(&drive).succeed();
    let trace = fs::read_dir(record.join("traces")).unwrap().next().unwrap().unwrap().path();
    let offline = folder.path().join("offline.lua");
    let evaluation = format!(
        r#"pdk.show(pdk.evaluate({{ dataset = "{}", driver = "lane_keeper", perturbations = {{ "gaussian_noise" }}, levels = {{ 4 }} }}))"#,
        trace.display()
    );
    fs::write(&offline, evaluation).unwrap();
    let out = folder.path().join("offline");
    let ran = Pdk::new(["run", "--out"]).arg(&out).arg(&offline).succeed();
    assert!(
        ran.stdout.contains("41 of topic /raw") || ran.stderr.contains("41 of topic /raw"),
        "{}",
        ran.stdout
    );
    let lines = json_lines(&out.join("results.jsonl"));
    assert_eq!(lines.len(), 41);
    let number = |line: &Value, of: &str, what: &str| line[of][what].as_f64().unwrap();
    for line in &lines {
        // The pictures of a trace are JPEG, so the driver decides nearly as it did.
        let error = number(line, "truth", "steering") - number(line, "original", "steering");
        assert!(error.abs() < 0.02, "{line}");
        assert!((0.0..=1.0).contains(&number(line, "truth", "throttle")), "{line}");
    }
    assert!(lines.iter().any(|line| number(line, "truth", "steering").abs() > 0.01));
}

#[test]
fn a_frame_that_ends_the_process_costs_a_perturbation_that_shows_earlier_frames_no_other_frame() {
    let folder = temp();
    let source = r#"
        local result = pdk.evaluate({
            dataset = { name = "misbehave", how = "abort_in_read", at = 1 }, driver = "misbehave",
            perturbations = { "frozen_frames" }, levels = { 3 }, trust = true,
        })
        assert(result.frames == 3, `{result.frames} frames`)
    "#;
    let pipeline = pdk_tests::process::pipeline(folder.path(), source);
    Pdk::new(["run", "--out"]).arg(folder.path().join("record")).arg(pipeline).misbehave().succeed();
}
