//! Records of a project that was moved: files are known by what is in them, not by where they are.

use std::fs;
use std::path::{Path, PathBuf};

use pdk_tests::process::json_lines;
use pdk_tests::{Pdk, repository, temp};

/// A project: a pipeline, a network and a mask that it names by absolute paths, a script beside it, and a folder of pictures that becomes an overlay.
fn project(folder: &Path) {
    fs::create_dir_all(folder.join("clips/smoke")).unwrap();
    for number in 0..3 {
        let is_smoke = |x: u32, y: u32| x.abs_diff(20 + 4 * number) < 8 && y.abs_diff(16) < 8;
        let picture = image::RgbImage::from_fn(48, 32, |x, y| {
            image::Rgb(if is_smoke(x, y) { [200; 3] } else { [0, 200, 30] })
        });
        picture.save(folder.join(format!("clips/smoke/{number}.png"))).unwrap();
    }
    fs::copy(repository().join("scripts/models/dave2.onnx"), folder.join("pilot.onnx")).unwrap();
    fs::write(
        folder.join("lower.lua"),
        "return { doc = 'Below', mask = function(image) image:fill(0, 0, 0) \
         image:rectangle(0, image.height / 2, image.width, image.height / 2, 255, 255, 255) end }",
    )
    .unwrap();
    fs::write(
        folder.join("darker.lua"),
        "return { doc = 'Darker', apply = function(image) image:blur(3) end }",
    )
    .unwrap();
    let pipeline = r#"
        local model = pdk.path("pilot.onnx")
        pdk.drive({ simulator = { name = "lane", width = 80, height = 60 }, driver = { name = "onnx", model = model }, duration = 0.3, images_every = 0,
            scenarios = {
                { perturbations = { { name = "darker" }, { name = "overlay", clip = pdk.path("clips/smoke") } } },
                { perturbations = { { name = "gaussian_noise", where = { mask = pdk.path("lower.lua") } } } },
            } })"#;
    fs::write(folder.join("drive.lua"), pipeline).unwrap();
}

/// Runs the project's pipeline, with an absolute path, in its folder.
fn run(folder: &Path) -> PathBuf {
    let pipeline = folder.canonicalize().unwrap().join("drive.lua");
    Pdk::new(["run"]).arg(&pipeline).args(["--out", "runs/drive-1"]).folder(folder).succeed();
    folder.join("runs/drive-1")
}

fn ids(record: &Path) -> Vec<String> {
    let lines = json_lines(&record.join("scenarios.jsonl"));
    lines.iter().map(|line| line["id"].as_str().unwrap().to_owned()).collect()
}

#[test]
fn a_project_that_is_moved_keeps_its_ids_and_its_records() {
    let place = temp();
    let (first, second) = (place.path().join("first"), place.path().join("in/another/place"));
    project(&first);
    let record = run(&first);
    let before = ids(&record);
    assert_eq!(before.len(), 2);
    for name in ["manifest.json", "scenarios.jsonl"] {
        let text = fs::read_to_string(record.join(name)).unwrap();
        assert!(!text.contains(&*place.path().to_string_lossy()), "{name}: {text}");
    }

    project(&second);
    assert_eq!(ids(&run(&second)), before, "the same project elsewhere has the same scenarios");

    // Moved with its record, and replayed from another folder still.
    let third = place.path().join("third");
    fs::rename(&first, &third).unwrap();
    let record = third.join("runs/drive-1");
    let replayed = Pdk::new(["replay"]).arg(&record).folder(place.path()).succeed();
    assert!(replayed.stdout.contains("2 of 2 equal"), "{}", replayed.stdout);
    assert!(!replayed.stderr.contains("warning"), "{}", replayed.stderr);
    let again = Pdk::new(["run", "drive.lua", "--out", "runs/drive-1"]).folder(&third).succeed();
    assert!(again.stdout.contains("2 of 2 scenarios were in the record already"), "{}", again.stdout);
    assert_eq!(ids(&record), before);
}

#[test]
fn another_content_is_another_scenario() {
    let place = temp();
    project(place.path());
    let before = ids(&run(place.path()));
    let network = fs::read(repository().join("scripts/models/dave2_augmented.onnx")).unwrap();
    fs::write(place.path().join("pilot.onnx"), network).unwrap();
    fs::remove_dir_all(place.path().join("runs")).unwrap();
    let after = ids(&run(place.path()));
    assert!(before.iter().all(|id| !after.contains(id)), "{before:?} {after:?}");
}
