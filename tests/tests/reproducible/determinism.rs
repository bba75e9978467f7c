//! Same key, same bytes: whatever the number of workers, the order of frames and the language.

use std::collections::BTreeSet;
use std::fs;
use std::path::Path;

use pdk_chain::chain::Chain;
use pdk_chain::moment::Moment;
use pdk_components::registry::Registry;
use pdk_components::search_path::SearchPath;
use pdk_model::perturbation::AppliedPerturbation;
use pdk_preview::picture;
use pdk_record::trace::reader::{Owner, read_recorded, read_steps};
use pdk_sdk::prelude::FrameBuf;
use pdk_tests::process::{json_lines, pipeline};
use pdk_tests::{Pdk, datasets, onnx, pictures, records, temp};
use tempfile::TempDir;

/// All perturbations of frames that need no parameter.
fn perturbations() -> Vec<String> {
    let list = Pdk::new(["list", "perturbation", "--json"]).succeed().json();
    let ready =
        list.as_array().unwrap().iter().map(|component| &component["description"]).filter(|description| {
            let parameters = description["parameters"].as_array().unwrap();
            description.get("acts_on").is_none()
                && parameters
                    .iter()
                    .all(|p| !p["default"].is_null() || p.get("levels").is_some() || p["type"] == "json")
        });
    let names: Vec<_> = ready.map(|description| description["name"].as_str().unwrap().to_owned()).collect();
    assert!(names.len() >= 12 && names.contains(&"banding".to_owned()), "{names:?}");
    names
}

/// The bytes of the perturbed image.
fn perturb(folder: &Path, chain: &[&str], more: &[&str]) -> Vec<u8> {
    let output = folder.join("out.png");
    let with = chain.iter().flat_map(|perturbation| ["--with", perturbation]);
    Pdk::new(["perturb", "in.png", "-o", "out.png"]).args(with).args(more).folder(folder).succeed();
    let bytes = fs::read(&output).unwrap();
    fs::remove_file(output).unwrap();
    bytes
}

/// Functions of the system's mathematical library whose last digits differ between its versions (ISO C, 7.12, and `sincos`).
fn is_inexact(function: &str) -> bool {
    let functions = [
        "acos", "acosh", "asin", "asinh", "atan", "atan2", "atanh", "cbrt", "cos", "cosh", "erf", "erfc",
        "exp", "exp10", "exp2", "expm1", "hypot", "lgamma", "log", "log10", "log1p", "log2", "pow", "sin",
        "sincos", "sinh", "tan", "tanh", "tgamma",
    ];
    functions.contains(&function) || function.strip_suffix('f').is_some_and(|name| functions.contains(&name))
}

#[test]
fn no_plugin_computes_with_the_mathematical_library_of_the_system() {
    use object::{Object, ObjectSymbol};
    let mut seen = Vec::new();
    for file in pdk_tests::built_in_libraries() {
        let name = file.file_name().unwrap().to_str().unwrap().to_owned();
        let library = fs::read(&file).unwrap();
        let library = object::File::parse(&*library).unwrap();
        let mut functions: Vec<_> = library
            .dynamic_symbols()
            .filter(|symbol| symbol.is_undefined())
            .map(|symbol| symbol.name().unwrap().to_owned())
            .filter(|symbol| is_inexact(symbol))
            .collect();
        if ["libpdk_overlay.so", "libpdk_datasets.so"].contains(&name.as_str()) {
            // OpenH264 counts the bits of a slice's number of macroblocks by the logarithm, and rounds it up.
            functions.retain(|function| function != "log");
        }
        if name == "libpdk_datasets.so" {
            // The crate parquet compares the precision of decimals of a schema with a logarithm that it rounds down; no value depends on it.
            // OpenH264's encoder turns a wanted bit rate into a quantiser by `logf`; here the quantiser is fixed, so none follows from it.
            functions.retain(|function| !["log10", "logf"].contains(&function.as_str()));
        }
        assert_eq!(functions, [""; 0], "{name} takes them from the system; the crate libm has them too");
        seen.push(name);
    }
    assert!(seen.len() >= 19 && seen.iter().any(|name| name.contains("models")), "{seen:?}");
}

#[test]
fn a_chain_that_begins_again_is_a_new_one() {
    let registry = pdk_tests::registry(&SearchPath::default());
    let src = pdk_sdk::testing::sample_frame(97, 61);
    let with = |name: &str, level: f64| {
        let text = format!(r#"{name}@{level},probability=0.7,where={{"random":60,"every":2}}"#);
        [AppliedPerturbation::parse(&text).unwrap()]
    };
    let frames = |chain: &mut Chain| -> Vec<FrameBuf> {
        let mut frame = |index: u64| {
            let mut dst = FrameBuf::new(97, 61);
            chain.apply(src.as_ref(), dst.as_mut(), &Moment::new(index, index as f64 / 20.0)).unwrap();
            dst
        };
        (0..3).map(&mut frame).collect()
    };
    for name in perturbations() {
        let wanted = frames(&mut Chain::new(&registry, &with(&name, 2.5), 7).unwrap());
        let mut other = Chain::new(&registry, &with(&name, 1.0), 3).unwrap();
        frames(&mut other);
        other.begin_again(&with(&name, 2.5), 7);
        assert!(frames(&mut other) == wanted, "{name}");
    }
}

#[test]
fn rain_and_snow_follow_the_way_that_a_vehicle_drives() {
    let registry = pdk_tests::registry(&SearchPath::default());
    let src = pdk_sdk::testing::sample_frame(97, 61);
    for name in ["dynamic_rain_filter", "dynamic_snow_filter", "dynamic_rain_filter,rate=30"] {
        let text = name.replacen(",", "@4,", 1);
        let text = if text.contains('@') { text } else { format!("{text}@4") };
        let mut chain = Chain::new(&registry, &[AppliedPerturbation::parse(&text).unwrap()], 7).unwrap();
        let mut at = |travelled: Option<f64>| {
            let mut dst = FrameBuf::new(97, 61);
            let moment = Moment { travelled, ..Moment::new(20, 1.0) };
            chain.apply(src.as_ref(), dst.as_mut(), &moment).unwrap();
            dst
        };
        let (unknown, usual, fast) = (at(None), at(Some(10.0)), at(Some(25.0)));
        assert!(unknown == usual, "{name}: 10 m/s is what the clip is drawn for");
        assert_eq!(usual == fast, name.contains("rate"), "{name}");
    }
}

#[test]
fn the_same_key_gives_the_same_bytes_and_another_seed_others() {
    let source = picture::to_frame(pictures::road(97, 61, 0)).unwrap();
    let begin = || {
        let folder = temp();
        pictures::write(&folder.path().join("in.png"), 97, 61);
        (pdk_tests::registry(&SearchPath::default()), folder)
    };
    let depends_on_seed = |(registry, folder): &mut (Registry, TempDir), name: &String| {
        let here = |spec: &str, seed: u64| {
            let mut chain = Chain::new(registry, &[AppliedPerturbation::parse(spec).unwrap()], seed).unwrap();
            let mut target = FrameBuf::new(97, 61);
            chain.apply(source.as_ref(), target.as_mut(), &Moment::new(3, 0.15)).unwrap();
            target
        };
        let mut depends = false;
        for level in ["0", "1.5", "4"] {
            let spec = format!("{name}@{level}");
            // In this process, and in one of its own that reads the picture from a file.
            let once = here(&spec, 7);
            let again = perturb(folder.path(), &[&spec], &["--seed", "7", "--frame", "3", "--time", "0.15"]);
            let again = image::load_from_memory(&again).unwrap().into_rgb8();
            assert!(once == picture::to_frame(again).unwrap(), "{spec}");
            depends |= once != here(&spec, 8);
        }
        depends
    };
    let names = perturbations();
    let depend = pdk_parallel::map_with(&names, begin, depends_on_seed);
    let random: Vec<_> =
        names.iter().zip(depend).filter(|(_, depends)| *depends).map(|(name, _)| name).collect();
    for name in
        ["gaussian_noise", "poisson_noise", "impulse_noise", "speckle_noise_filter", "banding", "dirty_lens"]
    {
        assert!(random.contains(&&name.to_owned()), "{name} does not depend on the seed: {random:?}");
    }
    for name in ["contrast", "grayscale_filter", "gaussian_blur", "defocus_blur", "increase_brightness"] {
        assert!(!random.contains(&&name.to_owned()), "{name} depends on the seed");
    }
}

#[test]
fn noise_is_drawn_anew_for_each_frame_and_for_each_instance() {
    let folder = temp();
    pictures::write(&folder.path().join("in.png"), 64, 48);
    let frame = |number: &str| perturb(folder.path(), &["gaussian_noise@2"], &["--frame", number]);
    assert_ne!(frame("0"), frame("1"));
    // What one perturbation draws does not depend on another one before it.
    let grey = perturb(folder.path(), &["grayscale_filter@4,weight=0", "gaussian_noise@2"], &[]);
    assert_eq!(grey, perturb(folder.path(), &["gaussian_noise@2", "grayscale_filter@4,weight=0"], &[]));
}

/// Runs a pipeline on one worker and twice on two, and compares everything but the times. Returns the names of
/// the files.
fn compare_workers(folder: &Path, source: &str, code: i32) -> Vec<String> {
    let path = pipeline(folder, source);
    let mut first = None;
    for (number, workers) in ["1", "2", "2"].iter().enumerate() {
        let out = folder.join(format!("record-{number}"));
        let ran = Pdk::new(["run", "--seed", "11", "--workers", workers, "--out"])
            .arg(&out)
            .arg(&path)
            .misbehave()
            .run();
        assert_eq!(ran.code, Some(code), "{}", ran.stderr);
        assert!(out.join("performance.json").is_file());
        let first = first.get_or_insert_with(|| records::files(&out));
        records::assert_equal(&out, first);
    }
    first.unwrap_or_default().into_keys().map(|path| path.to_string_lossy().into_owned()).collect()
}

#[test]
fn a_closed_loop_is_the_same_on_any_number_of_workers() {
    let folder = temp();
    let names = compare_workers(
        folder.path(),
        r#"
        local scenarios = {}
        for index, name in { "gaussian_noise@3", "motion_blur@2", "banding@4", "dirty_lens@1.5" } do
            table.insert(scenarios, { perturbations = { name }, road = { angles = { 0, 5 * index }, segment = 10 } })
        end
        -- One that cannot be built is part of the record, and does not know another one's road.
        table.insert(scenarios, 3, { road = { angels = { 0 } } })
        pdk.drive({
            simulator = { name = "lane", width = 80, height = 60, rate = 20 }, driver = "lane_keeper",
            duration = 1, images_every = 5, scenarios = scenarios,
        })
        "#,
        1,
    );
    let mut traces = Vec::new();
    for number in 0..3 {
        let record = folder.path().join(format!("record-{number}"));
        let outcomes = json_lines(&record.join("scenarios.jsonl"));
        let roads: Vec<_> = outcomes
            .iter()
            .map(|outcome| {
                let trace = records::trace(&record, outcome);
                traces.push(trace.strip_prefix(&record).unwrap().to_string_lossy().into_owned());
                let owner = Owner {
                    scenario: outcome["id"].as_str().unwrap().parse().unwrap(),
                    digest: outcome["digest"].as_str().unwrap().to_owned(),
                };
                read_recorded(&trace, owner).unwrap().1
            })
            .collect();
        assert_eq!((&outcomes[2]["cause"], roads[2].as_str()), (&"error".into(), ""));
        let others = [0, 1, 3, 4].map(|number| roads[number].as_str());
        assert!(others.iter().all(|road| !road.is_empty()));
        assert_eq!(BTreeSet::from(others).len(), 4, "each has its own road");
    }
    traces.truncate(5);
    traces.sort();
    let files =
        [".lock", "foxglove.json", "manifest.json", "scenarios.jsonl", "summary.json"].map(str::to_owned);
    assert_eq!(names, [files.to_vec(), traces].concat());
}

/// Outcomes come in another order each time, and the record does not show it.
#[test]
fn a_session_that_takes_outcomes_as_they_come_leaves_the_same_record() {
    let folder = temp();
    compare_workers(
        folder.path(),
        r#"
        local session = pdk.session({ simulator = { name = "lane", width = 80, height = 60, rate = 20 },
            driver = "lane_keeper", images_every = 5 })
        local submitted = {}
        for index = 1, 6 do
            local scenario = { duration = 0.2 * (7 - index), perturbations = { "gaussian_noise@" .. index % 4 } }
            submitted[session:submit(scenario)] = index
        end
        local seen = 0
        while session:pending() > 0 do
            local outcome = session:next()
            assert(outcome.number == submitted[outcome.ticket] - 1)
            seen += 1
        end
        assert(seen == 6 and session:next() == nil)
        "#,
        0,
    );
    let lines = json_lines(&folder.path().join("record-0/scenarios.jsonl"));
    let durations: Vec<_> = lines.iter().map(|line| line["scenario"]["duration"].as_f64().unwrap()).collect();
    assert!(durations.len() == 6 && durations.is_sorted_by(|a, b| a > b), "{durations:?}");
}

#[test]
fn an_offline_evaluation_is_the_same_on_any_number_of_workers() {
    let folder = temp();
    datasets::tub(&folder.path().join("tub"), 12, 40, 30);
    // One that cannot be read is part of the result.
    pictures::cut(&folder.path().join("tub/images/5_cam_image_array_.jpg"));
    onnx::pilot(&folder.path().join("pilot.onnx"), 3, 30, 40);
    let names = compare_workers(
        folder.path(),
        r#"
        pdk.evaluate({
            dataset = pdk.path("tub"),
            driver = { name = "onnx", model = pdk.path("pilot.onnx"), engine = "pdk" },
            perturbations = { "gaussian_noise", "motion_blur", "dirty_lens", "banding", "poisson_noise" },
            levels = { 0, 2.5, 4 },
        })
        "#,
        0,
    );
    assert_eq!(names, [".lock", "manifest.json", "results.jsonl", "summary.json"]);
}

#[test]
fn pixels_that_a_perturbation_leaves_out_are_black_whatever_came_before() {
    let folder = temp();
    datasets::folder(&folder.path().join("data"), 8, 32, 24);
    compare_workers(
        folder.path(),
        r#"
        local leaves = { name = "misbehave", how = "leave_pixels" }
        pdk.evaluate({ dataset = pdk.path("data"), driver = "misbehave", perturbations = { leaves, "gaussian_noise" },
            levels = { 4 } })
        -- Between the stages of a chain there are two frames, which an odd number of stages uses in turn.
        pdk.drive({ simulator = "misbehave", driver = "misbehave", images_every = 0,
            scenarios = { { perturbations = { "gaussian_noise@4", leaves, "gaussian_noise@4", leaves } },
                { perturbations = { "gaussian_noise@4", leaves, "gaussian_noise@0", "misbehave" }, name = "odd" } } })
        "#,
        0,
    );
    // The driver steers by the pixel in the middle, which is the first one that is left out.
    let results = json_lines(&folder.path().join("record-0/results.jsonl"));
    let (left, noisy): (Vec<_>, Vec<_>) =
        results.iter().partition(|line| line["perturbation"] == "misbehave");
    assert!(left.len() == 8 && left.iter().all(|line| line["perturbed"]["steering"] == 0.0), "{left:?}");
    assert!(noisy.len() == 8 && noisy.iter().any(|line| line["perturbed"]["steering"] != 0.0));
    let record = folder.path().join("record-0");
    let driven = json_lines(&record.join("scenarios.jsonl"));
    let steps = read_steps(&records::trace(&record, &driven[0])).unwrap();
    assert!(steps.len() == 21 && steps.iter().all(|step| step.control.steering == 0.0), "{steps:?}");
}

#[test]
fn a_frame_alone_is_the_frame_of_the_sequence() {
    // The misbehaving driver steers by the pixel in the middle, so its control tells what it saw.
    let folder = temp();
    datasets::folder(&folder.path().join("data"), 5, 32, 24);
    for name in ["gaussian_noise", "banding", "motion_blur"] {
        let out = folder.path().join(name);
        let source = format!(
            "pdk.evaluate({{ dataset = pdk.path('data'), driver = 'misbehave', perturbations = {{ '{name}' }}, levels = {{ 3 }} }})"
        );
        Pdk::new(["run", "--seed", "5", "--out"])
            .arg(&out)
            .arg(pipeline(folder.path(), &source))
            .misbehave()
            .succeed();
        for line in json_lines(&out.join("results.jsonl")) {
            let index = line["index"].as_u64().unwrap();
            // The folder's frames come at 20 a second where nothing else is known.
            let time = index as f64 / 20.0;
            let (with, image) = (format!("{name}@3"), format!("data/{index}_camera.jpg"));
            Pdk::new(["perturb", &image, "-o", "alone.png", "--with", &with, "--seed", "5"])
                .args(["--frame", &index.to_string(), "--time", &time.to_string()])
                .folder(folder.path())
                .succeed();
            let alone = image::open(folder.path().join("alone.png")).unwrap().into_rgb8();
            let steering = f64::from(alone.get_pixel(16, 12)[0]) / 2550.0;
            assert_eq!(line["perturbed"]["steering"].as_f64().unwrap(), steering, "{name} frame {index}");
        }
    }
}
