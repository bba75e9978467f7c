//! Predictors on pictures: classification with corruption errors, detection, and a function of the pipeline.

use std::path::Path;
use std::process::{Command, Stdio};

use image::RgbImage;
use pdk_tests::process::{compare_in_python, json_file, json_lines, pipeline};
use pdk_tests::random::Random;
use pdk_tests::records::{assert_equal, files};
use pdk_tests::{Pdk, onnx, repository, temp};
use serde_json::{Value, json};

/// A byte that looks random and is the same every time.
fn byte(number: u32, x: u32, y: u32) -> u8 {
    Random::new(u64::from(number) << 32 | u64::from(x) << 16 | u64::from(y)).below(256) as u8
}

/// Twelve pictures a class, each a little redder, greener or bluer than grey.
fn classes(folder: &Path) {
    for (class, name) in ["red", "green", "blue"].into_iter().enumerate() {
        std::fs::create_dir_all(folder.join(name)).unwrap();
        for number in 0..12_u32 {
            let picture = RgbImage::from_fn(8, 8, |x, y| {
                let grey = 90 + (byte(number, x, y) % 60);
                image::Rgb(std::array::from_fn(|channel| grey + if channel == class { 6 } else { 0 }))
            });
            picture.save(folder.join(name).join(format!("{number:02}.png"))).unwrap();
        }
    }
}

const CLASSIFICATION: &str = r#"
    pdk.show(pdk.evaluate({
        dataset = pdk.path("data"),
        predictor = { name = "network", model = pdk.path("colours.onnx"), scale = "0..1", engine = "pdk" },
        task = { kind = "classification", classes = { "red", "green", "blue" },
            baseline = { name = "a plain one", clean = 0.1, errors = { gaussian_noise = 0.5, impulse_noise = 0.4 } } },
        perturbations = { "gaussian_noise", "impulse_noise" }, levels = { 0, 1, 2, 3, 4 },
    }))
"#;

#[test]
fn corruption_errors_are_those_of_a_plain_program() {
    let folder = temp();
    classes(&folder.path().join("data"));
    onnx::colours(&folder.path().join("colours.onnx"), 8, 8);
    let script = pipeline(folder.path(), CLASSIFICATION);
    let run = |workers: &str| {
        let out = folder.path().join(format!("record-{workers}"));
        let ran = Pdk::new(["run", "--workers", workers, "--out"]).arg(&out).arg(&script).succeed();
        (ran, out)
    };
    let (ran, out) = run("1");
    for part in [
        "36 pictures, classification",
        "top1_error, without perturbation: 0.000",
        "relative to a plain one",
        "mCE",
    ] {
        assert!(ran.stdout.contains(part), "{part}: {}", ran.stdout);
    }
    let expected = files(&out);
    assert_equal(&run("3").1, &expected);
    // What a killed run left is taken up.
    let results = out.join("results.jsonl");
    let whole = std::fs::read(&results).unwrap();
    std::fs::write(&results, &whole[..whole.len() / 2]).unwrap();
    Pdk::new(["run", "--out"]).arg(&out).arg(&script).succeed();
    assert_equal(&out, &expected);

    let summary = out.join("summary.json");
    let evaluation = json_file(&summary)["evaluations"][0].clone();
    let highest =
        evaluation["rows"].as_array().unwrap().iter().find(|row| row["level"] == 4.0).unwrap().clone();
    let error = highest["totals"][0]["value"].as_f64().unwrap();
    assert!(0.05 < error && error < 1.0, "nothing to compare: {highest}");
    compare_in_python("mce.py", &[&folder.path().join("data"), &summary]);
}

#[test]
fn a_function_of_the_pipeline_is_a_metric() {
    let folder = temp();
    classes(&folder.path().join("data"));
    onnx::colours(&folder.path().join("colours.onnx"), 8, 8);
    let script = pipeline(
        folder.path(),
        r#"
        local result = pdk.evaluate({
            dataset = pdk.path("data"),
            predictor = { name = "network", model = pdk.path("colours.onnx"), scale = "0..1", engine = "pdk" },
            task = { kind = "function", labels = { ["red/00.png"] = "red" }, score = function(seen)
                local scores = seen.outputs.scores
                assert(#scores.values == 3 and scores.shape[2] == 3 and seen.width == 8)
                return { sum = scores.values[1] + scores.values[2] + scores.values[3], known = if seen.label then 1 else 0 }
            end },
            perturbations = { "increase_brightness" }, levels = { 4 },
        })
        pdk.show(result)
        local ok, said = pcall(pdk.evaluate, { dataset = pdk.path("data"), predictor = { name = "network",
            model = pdk.path("colours.onnx"), engine = "pdk" }, perturbations = { "contrast" }, levels = { 1 },
            task = { kind = "function", score = function() return "good" end } })
        pdk.save("said.json", { ok = ok, said = tostring(said) })
        "#,
    );
    let out = folder.path().join("record");
    let ran = Pdk::new(["run", "--out"]).arg(&out).arg(&script).succeed();
    assert!(ran.stdout.contains("sum, without perturbation"), "{}", ran.stdout);
    let summary = json_file(&out.join("summary.json"))["evaluations"][0].clone();
    let total = |of: &Value, name: &str| {
        let totals = of.as_array().unwrap().iter().find(|total| total["name"] == name).unwrap();
        totals["value"].as_f64().unwrap()
    };
    assert!((total(&summary["original"], "known") - 1.0 / 36.0).abs() < 1e-12);
    assert!(total(&summary["rows"][0]["totals"], "sum") > total(&summary["original"], "sum") + 0.1);
    let said = json_file(&out.join("said.json"));
    assert_eq!(said["ok"], false);
    assert!(said["said"].as_str().unwrap().contains("has to be a number, or a table of numbers"), "{said}");
}

#[test]
fn precisions_of_a_detector_are_those_of_coco() {
    let folder = temp();
    let data = folder.path().join("data");
    std::fs::create_dir_all(&data).unwrap();
    let (mut images, mut annotations) = (Vec::new(), Vec::new());
    for number in 0..30_u32 {
        // The detector finds three boxes, whose places follow the colour in the corner: see `onnx::boxes`.
        let colour: [u8; 3] = std::array::from_fn(|channel| byte(number, channel as u32, 7));
        RgbImage::from_pixel(64, 48, image::Rgb(colour)).save(data.join(format!("{number:02}.png"))).unwrap();
        images.push(
            json!({"id": number + 100, "file_name": format!("{number:02}.png"), "width": 64, "height": 48}),
        );
        for (channel, value) in colour.into_iter().enumerate() {
            let value = f64::from(value) / 255.0;
            let shift = f64::from(byte(number, channel as u32, 9)) / 64.0;
            let (left, top) = (value * 20.0 + shift, value * 10.0);
            annotations.push(json!({
                "id": annotations.len() + 1, "image_id": number + 100, "category_id": if channel == 2 { 8 } else { 3 },
                "bbox": [left, top, 16.0 + 20.0 * channel as f64, 16.0], "area": 16.0 * (16.0 + 20.0 * channel as f64),
                "iscrowd": u8::from(number % 11 == 0 && channel == 1),
            }));
        }
    }
    let labels = folder.path().join("labels.json");
    let categories = json!([{"id": 8, "name": "car"}, {"id": 3, "name": "person"}]);
    let coco = json!({"images": images, "annotations": annotations, "categories": categories});
    std::fs::write(&labels, coco.to_string()).unwrap();
    onnx::boxes(&folder.path().join("boxes.onnx"), 48, 64);
    let script = pipeline(
        folder.path(),
        r#"
        pdk.show(pdk.evaluate({
            dataset = { name = "pictures", path = pdk.path("data") },
            predictor = { name = "network", model = pdk.path("boxes.onnx"), scale = "0..1", engine = "pdk" },
            task = { kind = "detection", labels = pdk.path("labels.json"), corners = false },
            perturbations = { "gaussian_noise", "increase_brightness" }, levels = { 1, 4 },
        }))
        "#,
    );
    let out = folder.path().join("record");
    let ran = Pdk::new(["run", "--out"]).arg(&out).arg(&script).succeed();
    assert!(ran.stdout.contains("ap, without perturbation: 0."), "{}", ran.stdout);
    assert_eq!(json_lines(&out.join("results.jsonl")).len(), 30 * 5);
    let manifest = json_file(&out.join("manifest.json"));
    assert!(
        manifest["files"].to_string().contains("labels.json"),
        "the labels have no hash: {}",
        manifest["files"]
    );
    let python = std::env::var("PDK_TEST_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    let has = Command::new(&python).args(["-c", "import pycocotools"]).stderr(Stdio::null()).status();
    if !has.is_ok_and(|status| status.success()) {
        return eprintln!("skipped: {python} has no pycocotools");
    }
    let plain = Command::new(python)
        .arg(repository().join("tests/metrics/average_precision.py"))
        .args([&labels, &out.join("results.jsonl"), &out.join("summary.json")])
        .output()
        .unwrap();
    println!("{}", String::from_utf8_lossy(&plain.stdout));
    assert!(plain.status.success(), "{plain:?}");
}
