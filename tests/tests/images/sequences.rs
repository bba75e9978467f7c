//! Recordings are driven as sequences: a driver remembers earlier frames, and begins anew at gaps.

use std::path::Path;

use image::RgbImage;
use pdk_tests::process::{json_file, json_lines, pipeline};
use pdk_tests::records::{assert_equal, files};
use pdk_tests::{Pdk, onnx, temp};
use serde_json::{Value, json};

/// More frames than are driven in one piece.
const FRAMES: u32 = 1250;
/// Here the recording has a gap.
const GAP: u32 = 1150;

/// The grey of a frame.
fn grey(number: u32) -> u8 {
    (number * 37 % 200) as u8
}

/// A recording whose frames are of one grey each, steered as the network of [`onnx::remembering`] would.
fn recording(folder: &Path, truth: &[f64]) {
    std::fs::create_dir_all(folder).unwrap();
    for (frame, steering) in (0..FRAMES).zip(truth) {
        let number = if frame < GAP { frame } else { frame + 100 };
        let picture = RgbImage::from_pixel(8, 6, image::Rgb([grey(frame); 3]));
        picture.save(folder.join(format!("{number}_camera.png"))).unwrap();
        let record = json!({ "user/angle": steering, "user/throttle": 0.4 });
        std::fs::write(folder.join(format!("record_{number}.json")), record.to_string()).unwrap();
    }
}

/// What the network makes of the frames, with the memory that a drive has.
fn remembered(share: f64) -> Vec<f64> {
    let mut state = 0.0;
    let one = |frame: u32| {
        state = if frame == GAP { 0.0 } else { state * 0.5 };
        state += f64::from(grey(frame)) / 255.0 * share;
        state
    };
    (0..FRAMES).map(one).collect()
}

fn steering(line: &Value, whose: &str) -> f64 {
    line[whose]["steering"].as_f64().unwrap()
}

#[test]
fn a_network_remembers_the_frames_of_its_sequence_on_any_number_of_workers() {
    let folder = temp();
    onnx::remembering(&folder.path().join("pilot.onnx"), 6, 8, 0.4);
    let truth = remembered(0.4);
    recording(&folder.path().join("data"), &truth);
    let script = pipeline(
        folder.path(),
        r#"
        pdk.show(pdk.evaluate({
            dataset = pdk.path("data"), driver = { name = "onnx", model = pdk.path("pilot.onnx"), scale = "0..1", engine = "pdk" },
            -- Does not change what is grey, up to rounding.
            perturbations = { "grayscale_filter", "increase_brightness" }, levels = { 0, 4 },
        }))
        "#,
    );
    let run = |workers: &str| {
        let out = folder.path().join(format!("record-{workers}"));
        let ran = Pdk::new(["run", "--workers", workers, "--out"]).arg(&out).arg(&script).succeed();
        (ran, out)
    };
    let (ran, out) = run("1");
    assert!(ran.stdout.contains("1250 frames, in 2 sequences"), "{}", ran.stdout);
    let lines = json_lines(&out.join("results.jsonl"));
    assert_eq!(lines.len(), FRAMES as usize * 4);
    for line in &lines {
        let frame = line["index"].as_u64().unwrap() as usize;
        let off = (steering(line, "original") - truth[frame]).abs();
        assert!(off < 1e-6, "frame {frame} is {off} off: {line}");
        if line["perturbation"] == "grayscale_filter" {
            let drift = (steering(line, "perturbed") - steering(line, "original")).abs();
            assert!(drift < 0.8 * 1.01 / 255.0, "frame {frame}: {line}");
        }
    }
    let summary = json_file(&out.join("summary.json"))["evaluations"][0].clone();
    assert_eq!(summary["check"]["refusal"], Value::Null);
    let bright = &summary["rows"][3];
    let (low, high) = (&bright["steering_drift_interval"]["low"], &bright["steering_drift_interval"]["high"]);
    let drift = bright["steering_drift"].as_f64().unwrap();
    assert!(low.as_f64().unwrap() < drift && drift < high.as_f64().unwrap(), "{bright}");
    let expected = files(&out);
    for workers in ["2", "7"] {
        assert_equal(&run(workers).1, &expected);
    }
}

#[test]
fn a_network_with_another_preprocessing_is_not_ranked() {
    let folder = temp();
    // It expects values from 0 to 1, and the frames come as 0 to 255: its steering is at the limit.
    onnx::remembering(&folder.path().join("pilot.onnx"), 6, 8, 0.4);
    recording(&folder.path().join("data"), &remembered(0.4));
    let run = |name: &str| {
        Pdk::new(["run", "offline", "--out"])
            .arg(folder.path().join(name))
            .set("dataset", folder.path().join("data").display())
            .set("model", folder.path().join("pilot.onnx").display())
            .set("driver.engine", "pdk")
            .set("driver.scale", "0..255")
            .set("perturbations", "gaussian_noise")
            .set("levels", "1")
            .set("frames", 60)
    };
    let ran = run("refused").run();
    assert_eq!(ran.code, Some(1), "{}", ran.stderr);
    let found = "driver `onnx` steers to a limit (-1 or 1) on 9";
    assert!(
        ran.stderr.contains(found)
            && ran.stderr.contains("check its preprocessing and the scale of its steering with `pdk show "),
        "{}",
        ran.stderr
    );
    assert!(
        ran.stdout.contains("of the best constants") && !ran.stdout.contains("level 1"),
        "{}",
        ran.stdout
    );
    let ran = run("trusted").set("trust", "true").succeed();
    assert!(
        ran.stdout.contains("Warning: driver `onnx` steers to a limit") && ran.stdout.contains("level 1"),
        "{}",
        ran.stdout
    );
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn what_shows_earlier_frames_has_them_on_any_number_of_workers() {
    let folder = temp();
    onnx::remembering(&folder.path().join("pilot.onnx"), 6, 8, 0.4);
    recording(&folder.path().join("data"), &remembered(0.4));
    let script = pipeline(
        folder.path(),
        r#"
        pdk.evaluate({
            dataset = pdk.path("data"), driver = { name = "onnx", model = pdk.path("pilot.onnx"), scale = "0..1", engine = "pdk" },
            perturbations = { "frozen_frames", "reordered_frames" }, levels = { 3 },
        })
        "#,
    );
    let run = |workers: &str| {
        let out = folder.path().join(format!("record-{workers}"));
        Pdk::new(["run", "--workers", workers, "--out"]).arg(&out).arg(&script).succeed();
        out
    };
    let out = run("1");
    let changed = json_lines(&out.join("results.jsonl"))
        .iter()
        .filter(|line| (steering(line, "perturbed") - steering(line, "original")).abs() > 0.01)
        .count();
    assert!(changed > FRAMES as usize / 2, "{changed}");
    let expected = files(&out);
    for workers in ["3", "7"] {
        assert_equal(&run(workers), &expected);
    }

    let corrupt = |dataset: &str, workers: &str| {
        let out = folder.path().join(format!("written-{workers}"));
        let corrupt = Pdk::new([
            "corrupt",
            dataset,
            "--with",
            "frozen_frames@4",
            "--labels",
            "keep",
            "--workers",
            workers,
            "-o",
        ]);
        (corrupt.arg(&out).folder(folder.path()), out)
    };
    let (one, out) = corrupt("data", "1");
    one.succeed();
    let expected = files(&out);
    let (three, again) = corrupt("data", "3");
    three.succeed();
    assert_equal(&again, &expected);
    // Each picture is that of a frame of the last two seconds, and none is from before the gap.
    let mut frozen = 0;
    for frame in 0..FRAMES {
        let number = if frame < GAP { frame } else { frame + 100 };
        let ending = format!("/{number}_camera.png");
        let name = expected.keys().find(|name| format!("/{}", name.display()).ends_with(&ending)).unwrap();
        let shown = image::open(out.join(name)).unwrap().to_rgb8().get_pixel(0, 0)[0];
        let first = if frame < GAP { 0 } else { GAP };
        let back = (0..=40.min(frame - first)).find(|back| grey(frame - back) == shown);
        frozen += u32::from(back.unwrap_or_else(|| panic!("frame {frame} shows a grey of {shown}")) > 0);
    }
    assert!((FRAMES / 2..FRAMES).contains(&frozen), "{frozen}");

    image::RgbImage::new(20, 10).save(folder.path().join("photo.png")).unwrap();
    std::fs::create_dir(folder.path().join("photos")).unwrap();
    std::fs::rename(folder.path().join("photo.png"), folder.path().join("photos/photo.png")).unwrap();
    corrupt("photos", "2").0.fail(1, &["frozen_frames", "shows earlier frames", "photos"]);
}
