//! Predictors that say something of each pixel, and labels in files: segmentation, depth, and boxes of YOLO beside those of COCO.

use std::path::Path;

use image::{ImageBuffer, Luma, RgbImage};
use pdk_tests::process::{compare_in_python, json_file, json_lines, pipeline};
use pdk_tests::random::Random;
use pdk_tests::records::{assert_equal, files};
use pdk_tests::{Pdk, onnx, temp};
use serde_json::{Value, json};

const WIDTH: u32 = 32;
const HEIGHT: u32 = 24;
const PICTURES: u32 = 9;

/// A number that looks random and is the same every time.
fn below(number: u32, x: u32, y: u32, most: usize) -> usize {
    Random::new(u64::from(number) << 32 | u64::from(x) << 16 | u64::from(y)).below(most)
}

/// Pictures in patches of a colour, of which one channel is the strongest.
fn pictures(folder: &Path) {
    std::fs::create_dir_all(folder).unwrap();
    for number in 0..PICTURES {
        let picture = RgbImage::from_fn(WIDTH, HEIGHT, |x, y| {
            let strongest = below(number, x / 8, y / 8, 3);
            let value = |channel: usize| {
                60 + below(number, x, y, 30) as u8 + if channel == strongest { 40 } else { 0 }
            };
            image::Rgb([value(0), value(1), value(2)])
        });
        picture.save(folder.join(format!("{number:02}.png"))).unwrap();
    }
}

/// Runs a script of the folder, with one and with three workers; the folder of the record.
fn evaluate(folder: &Path, source: &str) -> (String, std::path::PathBuf) {
    let script = pipeline(folder, source);
    let run = |workers: &str| {
        let out = folder.join(format!("record-{workers}"));
        let ran = Pdk::new(["run", "--workers", workers, "--out"]).arg(&out).arg(&script).succeed();
        (ran.stdout, out)
    };
    let (said, out) = run("1");
    let expected = files(&out);
    assert_equal(&run("3").1, &expected);
    // What a killed run left is taken up.
    let results = out.join("results.jsonl");
    let whole = std::fs::read(&results).unwrap();
    std::fs::write(&results, &whole[..whole.len() / 2]).unwrap();
    Pdk::new(["run", "--out"]).arg(&out).arg(&script).succeed();
    assert_equal(&out, &expected);
    (said, out)
}

fn compare(folder: &Path, labels: &str, out: &Path) {
    compare_in_python("pixels.py", &[&folder.join("data"), &folder.join(labels), &out.join("summary.json")]);
}

#[test]
fn overlaps_of_a_segmentation_are_those_of_a_plain_program() {
    let folder = temp();
    pictures(&folder.path().join("data"));
    onnx::mirror(&folder.path().join("classes.onnx"), u64::from(HEIGHT), u64::from(WIDTH));
    std::fs::create_dir(folder.path().join("masks")).unwrap();
    for number in 0..PICTURES {
        // Half the size, with some mistakes, and some pixels that do not count.
        let mask = ImageBuffer::from_fn(WIDTH / 2, HEIGHT / 2, |x, y| {
            let class = match below(number, x + 100, y, 10) {
                0 => below(number, x + 200, y, 3),
                _ => below(number, x / 4, y / 4, 3),
            };
            Luma([if below(number, x + 300, y, 12) == 0 { 255_u8 } else { [0, 7, 9][class] }])
        });
        mask.save(folder.path().join(format!("masks/{number:02}.png"))).unwrap();
    }
    let source = r#"
        local result = pdk.evaluate({
            dataset = { name = "pictures", path = pdk.path("data") },
            predictor = { name = "network", model = pdk.path("classes.onnx"), scale = "0..1", engine = "pdk" },
            task = { kind = "segmentation", labels = pdk.path("masks"), classes = { "road", "car", "sky" }, values = { 0, 7, 9 } },
            perturbations = { "gaussian_noise", "increase_brightness" }, levels = { 1, 4 },
        })
        pdk.show(result)
    "#;
    let (said, out) = evaluate(folder.path(), source);
    assert!(
        said.contains("9 pictures, segmentation") && said.contains("iou_car, without perturbation: 0."),
        "{said}"
    );
    let summary = json_file(&out.join("summary.json"))["evaluations"][0].clone();
    let miou = |totals: &Value| totals[0]["value"].as_f64().unwrap();
    let (clean, noisy) = (miou(&summary["original"]), miou(&summary["rows"][1]["totals"]));
    assert!(0.5 < clean && clean < 1.0 && noisy < clean - 0.05, "nothing to compare: {clean} {noisy}");
    let manifest = json_file(&out.join("manifest.json"));
    assert!(
        manifest["files"].to_string().contains("masks"),
        "the labels have no hash: {}",
        manifest["files"]
    );
    compare(folder.path(), "masks", &out);
    // The page has a table for each number.
    let page = folder.path().join("page.html");
    Pdk::new(["report"]).arg(&out).arg("-o").arg(&page).succeed();
    let page = std::fs::read_to_string(page).unwrap();
    assert!(page.contains("9 pictures were evaluated for segmentation; miou is 0."), "no verdict");
    assert!(page.contains("pixel_accuracy") && !page.contains("does not know all"), "no tables");
    // Labels would be wrong where things are moved.
    let moving = source.replace("\"gaussian_noise\", \"increase_brightness\"", "\"translate_image\"");
    let script = pipeline(folder.path(), &moving);
    Pdk::new(["run", "--out"])
        .arg(folder.path().join("moved"))
        .arg(&script)
        .fail(1, &["`translate_image` moves", "pdk corrupt"]);
    let script = pipeline(folder.path(), &moving.replace("classes = {", "keep_labels = true, classes = {"));
    Pdk::new(["run", "--out"]).arg(folder.path().join("kept")).arg(&script).succeed();
    // A value that is not a class.
    let script = pipeline(folder.path(), &source.replace("values = { 0, 7, 9 }", "values = { 0, 1, 9 }"));
    Pdk::new(["run", "--out"])
        .arg(folder.path().join("wrong"))
        .arg(&script)
        .fail(1, &["has the value 7, which is none of the 3 classes"]);
}

#[test]
fn errors_of_distances_are_those_of_a_plain_program() {
    for ending in ["png", "npy"] {
        let folder = temp();
        pictures(&folder.path().join("data"));
        onnx::distances(&folder.path().join("depth.onnx"), u64::from(HEIGHT), u64::from(WIDTH));
        let labels = folder.path().join("depth");
        std::fs::create_dir(&labels).unwrap();
        for number in 0..PICTURES {
            let distance = |x: u32, y: u32| match below(number, x + 100, y, 7) {
                0 => 0_u16,
                1 => 3000,
                _ => 256 + below(number, x + 200, y, 1300) as u16,
            };
            let path = labels.join(format!("{number:02}.{ending}"));
            if ending == "png" {
                ImageBuffer::from_fn(WIDTH, HEIGHT, |x, y| Luma([distance(x, y)])).save(path).unwrap();
            } else {
                let head =
                    format!("{{'descr': '<f4', 'fortran_order': False, 'shape': ({HEIGHT}, {WIDTH}), }}\n");
                let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
                bytes.extend((head.len() as u16).to_le_bytes());
                bytes.extend(head.as_bytes());
                for (x, y) in (0..HEIGHT).flat_map(|y| (0..WIDTH).map(move |x| (x, y))) {
                    let value = if distance(x, y) == 0 { f32::NAN } else { f32::from(distance(x, y)) };
                    bytes.extend(value.to_le_bytes());
                }
                std::fs::write(path, bytes).unwrap();
            }
        }
        let source = r#"
            pdk.show(pdk.evaluate({
                dataset = { name = "pictures", path = pdk.path("data") },
                predictor = { name = "network", model = pdk.path("depth.onnx"), scale = "0..1", engine = "pdk" },
                task = { kind = "depth", labels = pdk.path("depth"), unit = 1 / 256, nearest = 0.5, farthest = 6 },
                perturbations = { "increase_brightness", "gaussian_noise" }, levels = { 0, 4 },
            }))
        "#;
        let (said, out) = evaluate(folder.path(), source);
        assert!(
            said.contains("9 pictures, depth") && said.contains("abs_rel, without perturbation: 0."),
            "{said}"
        );
        compare(folder.path(), "depth", &out);
    }
}

#[test]
fn boxes_of_yolo_count_as_those_of_coco() {
    let folder = temp();
    let data = folder.path().join("data");
    std::fs::create_dir_all(&data).unwrap();
    std::fs::create_dir_all(folder.path().join("yolo")).unwrap();
    let (mut images, mut annotations) = (Vec::new(), Vec::new());
    for number in 0..20_u32 {
        // The detector finds three boxes, whose places follow the colour: see `onnx::boxes`.
        let colour: [u8; 3] = std::array::from_fn(|channel| below(number, channel as u32, 7, 256) as u8);
        RgbImage::from_pixel(64, 48, image::Rgb(colour)).save(data.join(format!("{number:02}.png"))).unwrap();
        images
            .push(json!({"id": number, "file_name": format!("{number:02}.png"), "width": 64, "height": 48}));
        let mut lines = String::new();
        for (channel, value) in colour.into_iter().enumerate().skip(usize::from(number == 3)) {
            let left = f64::from(value) / 255.0 * 20.0 + below(number, channel as u32, 9, 4) as f64;
            let (top, width, height) = (f64::from(value) / 255.0 * 10.0, 16.0 + 20.0 * channel as f64, 16.0);
            let class = usize::from(channel == 2);
            annotations.push(json!({"id": annotations.len() + 1, "image_id": number, "category_id": class,
                "bbox": [left, top, width, height], "area": width * height}));
            let [x, y] = [(left + width / 2.0) / 64.0, (top + height / 2.0) / 48.0];
            lines += &format!("{class} {x} {y} {} {}\n", width / 64.0, height / 48.0);
        }
        std::fs::write(folder.path().join(format!("yolo/{number:02}.txt")), lines).unwrap();
    }
    let coco = json!({"images": images, "annotations": annotations, "categories": [{"id": 0, "name": "a"}, {"id": 1, "name": "b"}]});
    std::fs::write(folder.path().join("coco.json"), coco.to_string()).unwrap();
    onnx::boxes(&folder.path().join("boxes.onnx"), 48, 64);
    let run = |labels: &str| {
        let source = format!(
            r#"pdk.evaluate({{
                dataset = {{ name = "pictures", path = pdk.path("data") }},
                predictor = {{ name = "network", model = pdk.path("boxes.onnx"), scale = "0..1", engine = "pdk" }},
                task = {{ kind = "detection", labels = pdk.path("{labels}"), corners = false }},
                perturbations = {{ "gaussian_noise" }}, levels = {{ 4 }},
            }})"#
        );
        let out = folder.path().join(format!("record-{labels}"));
        Pdk::new(["run", "--out"]).arg(&out).arg(pipeline(folder.path(), &source)).succeed();
        json_file(&out.join("summary.json"))["evaluations"][0].clone()
    };
    let (coco, yolo) = (run("coco.json"), run("yolo"));
    for (a, b) in [("original", "original"), ("rows", "rows")].map(|(a, b)| (&coco[a], &yolo[b])) {
        let numbers = |of: &Value| -> Vec<f64> {
            let totals = if of[0]["totals"].is_array() { &of[0]["totals"] } else { of };
            totals.as_array().unwrap().iter().filter_map(|total| total["value"].as_f64()).collect()
        };
        assert!(numbers(a).len() >= 4 && numbers(a)[0] > 0.1, "{a}");
        assert!(numbers(a).iter().zip(numbers(b)).all(|(a, b)| (a - b).abs() < 1e-9), "{a} {b}");
    }
}

#[test]
fn a_function_gets_the_recorded_steering_and_may_return_a_number() {
    let folder = temp();
    pdk_tests::datasets::tub(&folder.path().join("drive"), 20, 32, 24);
    onnx::colours(&folder.path().join("colours.onnx"), 24, 32);
    let script = pipeline(
        folder.path(),
        r#"
        local seen_steering = {}
        local result = pdk.evaluate({
            dataset = pdk.path("drive"),
            predictor = { name = "network", model = pdk.path("colours.onnx"), scale = "0..1", engine = "pdk" },
            task = { kind = "function", score = function(seen)
                seen_steering[seen.name] = seen.recorded.steering
                return math.abs(seen.outputs.scores.values[1] - seen.recorded.steering)
            end },
        })
        pdk.show(result)
        pdk.save("seen.json", seen_steering)
        "#,
    );
    let out = folder.path().join("record");
    let ran = Pdk::new(["run", "--out"]).arg(&out).arg(&script).succeed();
    assert!(ran.stdout.contains("score, without perturbation: "), "{}", ran.stdout);
    let (seen, lines) = (json_file(&out.join("seen.json")), json_lines(&out.join("results.jsonl")));
    assert_eq!((seen.as_object().unwrap().len(), lines.len()), (20, 20));
    let first = lines[3]["frame"].as_str().unwrap();
    assert!((seen[first].as_f64().unwrap() - pdk_tests::datasets::steering(3)).abs() < 1e-9, "{seen}");
}
