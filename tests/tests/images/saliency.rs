//! Saliency on the command line: maps as numbers and pictures, what a network shows of itself, and perturbations of what a map
//! marks.

use std::path::Path;

use pdk_tests::onnx::Convolution;
use pdk_tests::{Pdk, datasets, pictures, real_data, temp};

/// Height, width and numbers of a file for NumPy.
fn numbers(path: &Path) -> ([usize; 2], Vec<f32>) {
    let bytes = std::fs::read(path).unwrap();
    assert_eq!(&bytes[..8], b"\x93NUMPY\x01\x00");
    let length = usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    let header = std::str::from_utf8(&bytes[10..10 + length]).unwrap();
    let shape = header.split("'shape': (").nth(1).unwrap().split(')').next().unwrap();
    let sides: Vec<usize> = shape.split(", ").map(|side| side.parse().unwrap()).collect();
    let values = bytes[10 + length..].chunks(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]));
    ([sides[0], sides[1]], values.collect())
}

#[test]
fn maps_are_written_by_cell_and_by_pixel_with_a_picture_of_each() {
    let dir = temp();
    let image = dir.path().join("road.png");
    pictures::write(&image, 320, 160);
    let maps = dir.path().join("maps");
    let saliency = |more: &[&str]| {
        Pdk::new(["saliency"]).arg(&image).args(["--driver", "dave2,engine=pdk", "-o"]).arg(&maps).args(more)
    };
    let methods = [
        "--with",
        "hirescam",
        "--with",
        "hirescam,layer=/convolutions/convolutions.2/Conv",
        "--with",
        "gradient",
    ];
    saliency(&methods).succeed();
    // The third convolution of dave2 is the last one with enough cells in both directions, and the second one has 14 rows.
    assert_eq!(numbers(&maps.join("road.hirescam.npy")).0, [5, 22]);
    let (sides, values) = numbers(&maps.join("road.hirescam-2.npy"));
    assert_eq!((sides, values.len()), ([14, 47], 14 * 47));
    assert!(values.iter().all(|value| (0.0..=1.0).contains(value)) && values.contains(&1.0));
    assert_eq!(numbers(&maps.join("road.gradient.npy")).0, [66, 200]);
    for method in ["hirescam", "hirescam-2", "gradient"] {
        let picture = image::open(maps.join(format!("road.{method}.png"))).unwrap();
        assert_eq!((picture.width(), picture.height()), (320, 160));
    }
    let first = std::fs::read(maps.join("road.gradient.npy")).unwrap();
    saliency(&methods).succeed();
    assert_eq!(std::fs::read(maps.join("road.gradient.npy")).unwrap(), first);
    saliency(&["--full"]).succeed();
    assert_eq!(numbers(&maps.join("road.hirescam.npy")).0, [160, 320]);
    // The throttle is explained by another map than the steering.
    saliency(&["--full", "--explain", "throttle"]).succeed();
    let throttle = std::fs::read(maps.join("road.hirescam.npy")).unwrap();
    saliency(&["--full"]).succeed();
    assert_ne!(std::fs::read(maps.join("road.hirescam.npy")).unwrap(), throttle);
}

#[test]
fn a_layer_with_a_single_row_of_cells_is_warned_of_once() {
    let folder = temp();
    for name in ["frames/1.png", "frames/2.png"] {
        std::fs::create_dir_all(folder.path().join("frames")).unwrap();
        pictures::write(&folder.path().join(name), 320, 160);
    }
    let last = "hirescam,layer=/convolutions/convolutions.8/Conv";
    let warning = "the maps of saliency `hirescam` by layer `/convolutions/convolutions.8/Conv` of model `dave2` have a single row of \
                   cells, so they cannot tell near from far; name a layer";
    let count = |said: &str| said.matches(warning).count();
    let maps = Pdk::new(["saliency", "frames", "--driver", "dave2", "--with", last, "--with", "hirescam"])
        .folder(folder.path());
    assert_eq!(count(&maps.succeed().stderr), 1);
    let by = format!(r#"{{"top":20,"by":"{last},model=dave2"}}"#);
    let perturbed = Pdk::new(["perturb", "frames/1.png", "-o", "out.png", "--with"])
        .arg(format!("contrast@3,where={by}"))
        .folder(folder.path());
    assert_eq!(count(&perturbed.succeed().stderr), 1);
    // Two drives on two workers: one sentence for both.
    let source = format!(
        r#"local where = {{ top = 20, by = "{last},model=dave2" }}
        local scenarios = {{}}
        for level = 1, 2 do
            scenarios[level] = {{ perturbations = {{ {{ name = "contrast", level = level, where = where }} }} }}
        end
        pdk.drive({{ simulator = "lane", driver = "dave2", duration = 0.2, scenarios = scenarios }})"#
    );
    std::fs::write(folder.path().join("drive.lua"), source).unwrap();
    let ran =
        Pdk::new(["run", "drive.lua", "--workers", "2", "--out", "record"]).folder(folder.path()).succeed();
    assert_eq!(count(&ran.stderr), 1, "{}", ran.stderr);
    assert!(ran.stderr.contains(", 2 times"), "{}", ran.stderr);
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn the_frames_of_a_dataset_are_mapped_and_methods_are_compared() {
    let dir = temp();
    let drive = dir.path().join("drive");
    datasets::tub(&drive, 6, 160, 120);
    let maps = dir.path().join("maps");
    let result = Pdk::new(["saliency", "--json"])
        .arg(&drive)
        .args([
            "--driver",
            "dave2,engine=pdk",
            "--count",
            "3",
            "--with",
            "hirescam",
            "--with",
            "occlusion,patch=0.5",
        ])
        .args(["--curves", "-o"])
        .arg(&maps)
        .succeed()
        .json();
    assert_eq!(result["written"].as_array().unwrap().len(), 3 * 2 * 2);
    for (place, method) in ["hirescam", "occlusion"].into_iter().enumerate() {
        let curve = &result["curves"][place];
        assert_eq!((curve["method"].as_str(), curve["frames"].as_u64()), (Some(method), Some(3)));
        assert!(curve["deletion"]["area"].as_f64().unwrap() > 0.0, "{curve}");
    }
}

/// Frames of ten roads in each of the conditions, at speeds and places beside the lane's middle that the simulator chooses.
const FRAMES: &str = r#"
    local seed = 4001
    for _, conditions in { "easy", "standard", "hard" } do
        local segment = ({ easy = 25, standard = 37.5, hard = 50 })[conditions]
        local scenarios = {}
        for number = 1, 10 do
            table.insert(scenarios, { name = `road {seed}`, road = pdk.road({ seed = seed, limit = 35, segment = segment, attempts = 1000 }).road })
            seed += 1
        end
        pdk.drive({
            simulator = { name = "lane", conditions = conditions, autopilot = true, autopilot_swing = 0.8 },
            driver = "lane_keeper", -- not heeded
            duration = 4, images_every = 25, scenarios = scenarios,
        })
    end
"#;

#[test]
#[ignore = "long: .ci/run runs it"]
fn the_default_map_beats_itself_in_other_places_on_every_network() {
    let folder = temp();
    let record = folder.path().join("record");
    std::fs::write(folder.path().join("frames.lua"), FRAMES).unwrap();
    Pdk::new(["run", "--out"]).arg(&record).arg(folder.path().join("frames.lua")).succeed();
    let networks = Pdk::new(["list", "driver", "--json"]).succeed().json();
    let networks =
        networks.as_array().unwrap().iter().filter_map(|entry| entry["description"]["name"].as_str());
    let mut drivers: Vec<_> = networks
        // The default map needs a gradient, which a quantised network does not have.
        .filter(|name| !["dave2_quantised", "lane_keeper", "onnx", "process"].contains(name))
        .map(|name| (name.to_owned(), record.clone()))
        .collect();
    assert_eq!(drivers.len(), 7, "{drivers:?}");
    if let (Some(pilot), Some(tub)) = (real_data("tub_pilot.onnx"), real_data("tub")) {
        drivers.push((format!("onnx,model={}", pilot.display()), tub));
    }
    for (driver, frames) in drivers {
        let found = Pdk::new(["saliency", "--json", "--curves", "--count", "24", "--driver"])
            .arg(&driver)
            .arg(&frames)
            .arg("-o")
            .arg(folder.path().join("maps"))
            .succeed()
            .json();
        let curve = &found["curves"][0];
        assert_eq!(curve["frames"], 24, "{driver}: {curve}");
        for measure in ["deletion", "insertion"] {
            let better = &curve[measure]["better_than_moved"];
            println!("{driver}: {measure} {better}");
            assert!(better["low"].as_f64().unwrap() > 0.0, "{driver}: {measure} {better}");
        }
    }
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn frames_of_a_record_bring_their_speed_and_their_road() {
    let folder = temp();
    let source = r#"
        local simulator = { name = "lane", autopilot = true, width = 160, height = 80 }
        local road = pdk.road({ seed = 1, limit = 10 }).road
        for _, speed in { 5, 9 } do
            simulator.initial_speed = speed
            pdk.drive({ simulator = simulator, driver = "lane_keeper", duration = 1, images_every = 10, scenarios = { { road = road } } })
        end
    "#;
    std::fs::write(folder.path().join("drive.lua"), source).unwrap();
    let run = |name: &str, more: &[&str]| {
        Pdk::new(["run", "drive.lua", "--out", name]).args(more).folder(folder.path()).succeed();
    };
    run("record", &[]);
    let saliency = |more: &[&str]| {
        Pdk::new(["saliency", "record", "--driver", "dave2", "--with", "gradient", "-o", "maps"])
            .args(more)
            .folder(folder.path())
    };
    let found = saliency(&["--curves", "--json"]).succeed().json();
    let curve = &found["curves"][0];
    // Two drives on one road are one value, about which there is no interval.
    assert_eq!((curve["frames"].as_u64(), curve["independent"].as_u64()), (Some(6), Some(1)), "{curve}");
    assert!(curve["deletion"]["better_than_moved"]["low"].is_null());
    let map =
        |name: &str| std::fs::read(folder.path().join("maps").join(format!("{name}.gradient.npy"))).unwrap();
    let [slow, fast] = ["0-0", "1-0"].map(map);
    assert_ne!(slow, fast, "the first frames are alike, but not the speeds");
    // The speed on the command line is for frames that bring none.
    saliency(&["--speed", "30"]).succeed();
    assert_eq!(map("1-0"), fast);
    std::fs::write(folder.path().join("drive.lua"), source.replace("images_every = 10", "images_every = 0"))
        .unwrap();
    run("other", &[]);
    Pdk::new(["saliency", "other", "--driver", "dave2"])
        .folder(folder.path())
        .fail(1, &["other has no images; drive again with `images_every` set"]);
}

#[test]
fn mistakes_are_sentences() {
    let dir = temp();
    let image = dir.path().join("road.png");
    pictures::write(&image, 64, 48);
    let out = dir.path().join("maps");
    let saliency = |driver: &str, more: &[&str]| {
        Pdk::new(["saliency"]).arg(&image).args(["--driver", driver, "-o"]).arg(&out).args(more)
    };
    saliency("dave2", &["--with", "hirecam"]).fail(1, &["hirecam", "hirescam"]);
    saliency("dave2", &["--with", "hirescam,layer=conv9"])
        .fail(1, &["it has no layer `conv9`", "/convolutions/convolutions.8/Conv"]);
    saliency("dave2", &["--with", "hirescam,steering=angle"])
        .fail(1, &["the parameters: `steering` names the output `angle`, which the network does not have; there is only `control`"]);
    saliency("dave2", &["--explain", "brake"]).fail(
        1,
        &[
            "explain: `brake`: there is no value `brake`",
            "`steering` and `throttle` are known by these names",
        ],
    );
    saliency("dave2", &["--explain", "throttle", "--curves"])
        .fail(1, &["--curves measures how the steering changes"]);
    saliency("dave2", &["--with", "hirescam,size=frame"]).fail(1, &["`size` cannot be set"]);
    saliency("onnx,model=/no/such.onnx", &[]).fail(1, &["/no/such.onnx", "there is no such file"]);
    saliency("missing_driver", &[]).fail(1, &["missing_driver"]);
    let damaged = dir.path().join("damaged.onnx");
    std::fs::write(&damaged, b"no network").unwrap();
    Pdk::new(["show"]).arg(&damaged).fail(1, &["the file is not an ONNX model"]);
}

/// Each is a sentence or works, and none is a crash.
#[test]
fn unusual_networks_work_or_say_why_not() {
    let dir = temp();
    let image = dir.path().join("road.png");
    pictures::write(&image, 64, 48);
    let file = dir.path().join("network.onnx");
    let saliency = || {
        let driver = format!("onnx,engine=pdk,model={}", file.display());
        Pdk::new(["saliency"])
            .arg(&image)
            .args(["--with", "hirescam", "--with", "gradient", "--driver", &driver, "-o"])
            .arg(dir.path().join("maps"))
    };
    let usual = Convolution::default();
    for works in [
        usual,
        Convolution { opset: 7, ..usual },
        Convolution { opset: 21, ..usual },
        Convolution { image: ["N", "3", "16", "32"], ..usual },
        Convolution { cut: true, ..usual },
    ] {
        works.write(&file);
        let said = saliency().succeed().stderr;
        assert!(!said.contains("warning"), "{works:?}: {said}");
    }
    Convolution { indifferent: true, ..usual }.write(&file);
    let said = saliency().succeed().stderr;
    assert_eq!(said.matches("is the same everywhere, so it marks nothing").count(), 2, "{said}");
    for (refused, part) in [
        (
            Convolution { image: ["1", "3", "H", "W"], ..usual },
            "(1, 3, H, W) without a fixed height and width",
        ),
        (Convolution { element: 10, ..usual }, "is FLOAT16, but gradients need FLOAT (32 bit)"),
    ] {
        refused.write(&file);
        saliency().fail(1, &["saliency `hirescam`", part]);
    }
    usual.write(&file);
    let whole = std::fs::read(&file).unwrap();
    std::fs::write(&file, &whole[..whole.len() / 2]).unwrap();
    saliency().fail(1, &["the file is not an ONNX model, or is damaged"]);
    pdk_tests::onnx::pilot(&file, 3, 16, 32);
    saliency()
        .fail(1, &["it has no convolution whose cells have a place on the image", "a layer has to be named"]);
}

#[test]
fn a_network_shows_its_layers() {
    let file = pdk_tests::repository().join("scripts/models/dave2.onnx");
    let text = Pdk::new(["show"]).arg(&file).succeed().stdout;
    for part in [
        "input     image (1, 3, 66, 200) FLOAT",
        "output    control (1, 2) FLOAT",
        "every operator before it has a gradient",
        "/convolutions/convolutions.8/Conv",
    ] {
        assert!(text.contains(part), "{part} is not in\n{text}");
    }
    let network = Pdk::new(["show", "--json"]).arg(&file).succeed().json();
    let layers = network["outputs"][0]["layers"].as_array().unwrap();
    let convolutions: Vec<_> = layers.iter().filter(|layer| layer["operator"] == "Conv").collect();
    assert_eq!(convolutions.len(), 5);
    // Windows of 5, every second place.
    assert_eq!(convolutions[1]["columns"]["receptive_field"], 13.0);
    assert_eq!(convolutions[1]["columns"]["first_at"], 6.0);
    assert_eq!(network["outputs"][0]["without_gradient"].as_array().unwrap().len(), 0);
}

#[test]
fn a_perturbation_is_limited_to_what_a_map_marks() {
    let dir = temp();
    let image = dir.path().join("road.png");
    pictures::write(&image, 320, 160);
    let original = image::open(&image).unwrap().into_rgb8();
    let changed = |choice: &str, seed: &str| {
        let out = dir.path().join("out.png");
        let with = format!("false_color_filter@3,where={choice}");
        Pdk::new(["perturb"]).arg(&image).args(["--seed", seed, "--with", &with, "-o"]).arg(&out).succeed();
        let perturbed = image::open(&out).unwrap().into_rgb8();
        original.pixels().zip(perturbed.pixels()).map(|(a, b)| a != b).collect::<Vec<_>>()
    };
    let count = |pixels: &[bool]| pixels.iter().filter(|changed| **changed).count();
    let by = r#""by":"gradient,model=dave2,engine=pdk""#;
    let top = changed(&format!(r#"{{"top":20,{by}}}"#), "0");
    let bottom = changed(&format!(r#"{{"bottom":80,{by}}}"#), "0");
    assert_eq!((count(&top), count(&bottom)), (320 * 160 / 5, 320 * 160 * 4 / 5));
    assert!(top.iter().zip(&bottom).all(|(top, bottom)| top != bottom), "each pixel is in one of them");
    let random = changed(r#"{"random":20}"#, "0");
    assert_eq!(count(&random), 320 * 160 / 5);
    assert_eq!(random, changed(r#"{"random":20}"#, "0"));
    assert_ne!(random, changed(r#"{"random":20}"#, "1"));
    Pdk::new(["perturb"])
        .arg(&image)
        .args(["--with", r#"false_color_filter@3,where={"top":20}"#, "-o", "x.png"])
        .fail(1, &["perturbation `false_color_filter`", "by which saliency method"]);
}

/// A drive that fails, with a network and with a driver that is none.
const FAILURE: &str = r#"
    local settings = pdk.settings({ driver = "dave2" })
    pdk.drive({
        simulator = { name = "lane", width = 160, height = 80 }, driver = settings.driver, duration = 1, images_every = 10,
        failure = { lane_departure = 0.001 },
        scenarios = { { perturbations = { "gaussian_noise@4" } } },
    })
"#;

#[test]
fn heat_maps_stand_beside_the_frames_of_clips_and_reports() {
    let folder = temp();
    let source = folder.path().join("failure.lua");
    std::fs::write(&source, FAILURE).unwrap();
    let record = |driver: &str| {
        let out = folder.path().join(if driver.starts_with('{') { "network" } else { "other" });
        Pdk::new(["run", "--out"]).arg(&out).arg(&source).set("driver", driver).run();
        assert!(out.join("scenarios.jsonl").exists());
        out
    };
    let network = record(r#"{"name":"dave2","engine":"pdk"}"#);
    let page = |out: &Path, more: &[&str]| {
        let said = Pdk::new(["report"]).arg(out).args(more).succeed();
        (std::fs::read_to_string(out.join("report.html")).unwrap(), said.stderr)
    };
    let shown = "What its network looked at";
    assert!(!page(&network, &[]).0.contains(shown));
    let (text, warnings) = page(&network, &["--saliency"]);
    assert!(text.contains(shown) && !warnings.contains("warning"), "{warnings}");
    assert_eq!(text.matches(shown).count(), text.matches("What the driver saw at").count());
    Pdk::new(["report", "--saliency=hirescan"]).arg(&network).fail(1, &["hirescan"]);

    let clip = |name: &str, more: &[&str]| {
        let path = folder.path().join(name);
        Pdk::new(["replay", "--scenario", "0", "--clip"]).arg(&path).args(more).arg(&network).succeed();
        let mut reader = pdk_video::Reader::open_file(&path).unwrap();
        let (mut planes, mut frames) = (pdk_video::Yuv420::default(), 0);
        while reader.next(&mut planes).unwrap() {
            frames += 1;
        }
        (planes.width, frames)
    };
    let (two, three) = (clip("two.mp4", &[]), clip("three.mp4", &["--saliency=gradient"]));
    assert_eq!(two.1, three.1);
    assert!(three.0 > two.0 + 400, "{three:?} is not wider than {two:?}");
    let alone = Pdk::new(["replay", "--saliency"]).arg(&network).run();
    assert!(alone.code == Some(2) && alone.stderr.contains("--clip"), "{alone:?}");

    let other = record("lane_keeper");
    let (text, warnings) = page(&other, &["--saliency"]);
    assert!(!text.contains(shown) && warnings.contains("`lane_keeper` is not a network"), "{warnings}");
    Pdk::new(["replay", "--scenario", "0", "--saliency", "--clip", "x.mp4"])
        .arg(&other)
        .folder(folder.path())
        .fail(1, &["`lane_keeper` is not a network"]);
}
