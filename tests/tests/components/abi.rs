//! Plugins of other SDKs: one built with the first SDK of this version of the interface works in all its parts, one that knows
//! more than pdk works with a word. The frozen plugin may not be changed for a test to pass: docs/abi.md.

use std::fs;

use pdk_components::registry::Registry;
use pdk_components::search_path::SearchPath;
use pdk_model::component::ComponentSpec;
use pdk_sdk::describe::Kind;
use pdk_sdk::error::ErrorKind;
use pdk_sdk::prelude::*;
use pdk_sdk::saliency::HeatmapMut;
use pdk_tests::process::{json_file, json_lines, pipeline};
use pdk_tests::{Pdk, pictures, temp, test_library};
use serde_json::{Map, Value, json};

/// A registry that has loaded a plugin into this process.
fn registry(plugin: &str) -> Registry {
    let search = SearchPath { plugins: vec![test_library(plugin)], ..SearchPath::default() };
    pdk_tests::registry(&search)
}

fn parameters(value: Value) -> Map<String, Value> {
    value.as_object().unwrap().clone()
}

/// A frame in which every byte says where it is.
fn source(width: usize, height: usize) -> FrameBuf {
    let bytes = (0..width * height * 3).map(|i| (i % 251) as u8).collect();
    FrameBuf::from_vec(bytes, width, height).unwrap()
}

const KINDS_OF_THE_FIRST_SDK: [Kind; 6] =
    [Kind::Perturbation, Kind::Simulator, Kind::Driver, Kind::Saliency, Kind::Search, Kind::Dataset];

#[test]
fn a_plugin_of_the_first_sdk_describes_itself_and_keeps_the_rules() {
    let registry = registry("frozen");
    assert!(registry.refused().is_empty(), "{:?}", registry.refused());
    assert!(registry.skipped().is_empty(), "{:?}", registry.skipped());
    let plugin =
        &registry.plugins().iter().find(|plugin| plugin.description.name == "frozen").unwrap().description;
    assert_eq!((plugin.version.as_str(), plugin.homepage.as_str()), ("1.2.3", "https://example.org/frozen"));
    for kind in KINDS_OF_THE_FIRST_SDK {
        let entry = registry.catalog().get(kind, "frozen").unwrap();
        assert_eq!(entry.plugin.as_ref().unwrap().version, "1.2.3");
    }
    let entry = registry.catalog().get(Kind::Perturbation, "frozen").unwrap();
    assert_eq!((entry.description.version, entry.description.family.as_str()), (3, "test"));
    assert_eq!(entry.description.parameters[0].levels, Some([1.0, 2.0, 3.0, 4.0, 5.0]));

    let checked = Pdk::new(["check"]).arg(test_library("frozen")).succeed();
    for kind in KINDS_OF_THE_FIRST_SDK {
        assert!(checked.stdout.contains(&format!("ok   {kind} `frozen`")), "{}", checked.stdout);
    }
}

#[test]
fn a_perturbation_of_the_first_sdk_gets_all_that_it_is_given() {
    let registry = registry("frozen");
    let given = parameters(json!({ "mode": "hard", "text": "four" }));
    let (mut frozen, config) = registry.perturbation("frozen", &given).unwrap();
    let description = &registry.catalog().get(Kind::Perturbation, "frozen").unwrap().description;
    let names: Vec<_> = description.parameters.iter().map(|parameter| parameter.name.clone()).collect();
    let mut values = Vec::new();
    pdk_sdk::config::frame_values(description, &config, 2.0, &mut values);
    let key = Key([7; 32]);
    let cx = Context::new(2.0, 9, 0.45, &key).with_values(&names, &values).with_stream(5);
    let (source, mut target) = (source(5, 4), FrameBuf::new(5, 4));
    frozen.apply(source.as_ref(), target.as_mut(), &cx).unwrap();
    assert_eq!(target.as_ref().pixel(0, 0), [2, 1, 4]);
    let (frame, sequence) = (key.frame(5).next_u32() as u8, key.sequence().next_u32() as u8);
    assert_eq!(target.as_ref().pixel(1, 0), [9, frame, sequence]);
    let darker: Vec<_> = source.data()[6..].iter().map(|byte| byte.saturating_sub(3)).collect();
    assert_eq!(target.data()[6..], darker, "level 2 makes it 3 darker");

    for (text, kind, said) in
        [("fail", ErrorKind::Nonsense, "as asked to"), ("panic", ErrorKind::Panic, "panicked at ")]
    {
        let (mut frozen, _) = registry.perturbation("frozen", &parameters(json!({ "text": text }))).unwrap();
        let error = frozen.apply(source.as_ref(), target.as_mut(), &cx).unwrap_err();
        assert_eq!(error.kind(), kind, "{error}");
        assert!(error.message().contains(said), "{error}");
    }
    let refused = registry.perturbation("frozen", &parameters(json!({ "amount": 12 }))).err().unwrap();
    assert!(refused.message().contains("has to be a number from 0 to 9"), "{refused}");
}

#[test]
fn simulator_and_driver_of_the_first_sdk_get_all_that_they_are_given() {
    let registry = registry("frozen");
    let (mut simulator, _) = registry.simulator("frozen", &Map::new()).unwrap();
    assert_eq!(simulator.camera(), Camera { width: 33, height: 17, rate: 20.0 });
    let scenario = Scenario {
        road: json!({ "number": 12, "more": [1, 2] }),
        ..Scenario::new(ComponentSpec::new("frozen"), ComponentSpec::new("frozen"))
    };
    let start = simulator.reset(&scenario, 3).unwrap();
    let expected = State {
        position: [12.0, 0.5, 0.0],
        speed: 7.0,
        cross_track_error: -0.25,
        vehicle_ahead: 40.0,
        ..State::default()
    };
    assert_eq!(start, expected);
    assert_eq!(simulator.waypoints(), [[0.0, 0.5, 0.0], [0.25, 0.5, 20.0]]);
    let mut frame = FrameBuf::new(33, 17);
    assert_eq!(simulator.frame(frame.as_mut()).unwrap(), start);
    assert_eq!(frame.as_ref().pixel(5, 16), [160; 3]);
    let after = simulator.act(Control { steering: -0.5, throttle: 1.0 }).unwrap();
    assert_eq!((after.time, after.heading, after.progress, after.finished), (0.05, -0.5, 0.05, false));
    for _ in 1..20 {
        simulator.act(Control::default()).unwrap();
    }
    assert!(simulator.frame(frame.as_mut()).unwrap().finished);
    // Functions that came later are as if it had nothing to say.
    assert!(simulator.info().is_empty() && simulator.label_names().is_empty());
    simulator.annotate(Annotations { labels: true, depth: true });
    assert!(simulator.depth(&mut []).unwrap_err().message().contains("how far away"));
    assert!(simulator.labels(&mut []).unwrap_err().message().contains("has no function `labels`"));

    let (mut driver, _) = registry.driver("frozen", &parameters(json!({ "gain": 2.0 }))).unwrap();
    assert_eq!(driver.info(), [("made with".to_owned(), "the first SDK".to_owned())]);
    let cx = DriveContext { frame_index: 30, time: 1.5, speed: 4.0 };
    let steering = |brightness: f64| 2.0 * (brightness / 2550.0 + 1.5 / 100.0 + 30.0 / 1000.0);
    let brightness = f64::from(frame.as_ref().pixel(32, 16)[0]);
    for (frames, reset) in [(1.0, false), (2.0, false), (1.0, true)] {
        if reset {
            driver.reset().unwrap();
        }
        let control = driver.drive(frame.as_ref(), &cx).unwrap();
        assert_eq!(control, Control { steering: steering(brightness), throttle: (frames + 4.0) / 1000.0 });
    }
}

#[test]
fn dataset_saliency_and_search_of_the_first_sdk_get_all_that_they_are_given() {
    let registry = registry("frozen");
    let (mut dataset, _) = registry.dataset("frozen", &Map::new()).unwrap();
    assert_eq!((dataset.len(), dataset.name(4)), (5, "frozen 4".to_owned()));
    let entry = dataset.read(2).unwrap();
    assert_eq!((entry.steering, entry.throttle, entry.time), (0.25, 0.5, 0.1));
    assert_eq!(
        (entry.frame.width(), entry.frame.height(), entry.frame.as_ref().pixel(7, 5)),
        (8, 6, [85; 3])
    );
    assert_eq!(dataset.read(3).unwrap_err(), Error::of(ErrorKind::Lost, "this one is gone"));

    let (mut saliency, _) = registry.saliency("frozen", &Map::new()).unwrap();
    assert_eq!(saliency.map_size(5, 4).unwrap(), [3, 2]);
    let (source, key, mut map) = (source(5, 4), Key([3; 32]), vec![f32::NAN; 6]);
    let cx = MapContext::new(4, 0.2, &key);
    saliency.map(source.as_ref(), &cx, HeatmapMut::new(&mut map, 3, 2).unwrap()).unwrap();
    let at = |x: usize, y: usize| f32::from(source.as_ref().pixel(x, y)[0]) / 255.0;
    let first = key.frame(4).unit() as f32;
    assert_eq!(map, [first, at(2, 0), at(4, 0), at(0, 2), at(2, 2), at(4, 2)]);

    let (mut search, _) = registry.search("frozen", &Map::new()).unwrap();
    let problem = json!({ "space": { "variables": [
        { "name": "level", "type": "integer", "min": 1, "max": 4 },
        { "name": "what", "type": "choice", "values": ["fog", "rain"] },
    ] }, "objectives": ["cost"] });
    let problem: Problem = serde_json::from_value(problem).unwrap();
    assert_eq!(search.start(&problem, &Key::default()).unwrap_err().message(), "it was given no key");
    search.start(&problem, &key).unwrap();
    let candidates = search.ask(3).unwrap();
    let said: Vec<_> =
        candidates.iter().map(|c| json!([c.id, c.values["level"], c.values["what"]])).collect();
    assert_eq!(said, [json!([0, 1, "fog"]), json!([1, 1, "rain"]), json!([2, 1, "fog"])]);
    let result = |id: u64| -> Evaluated {
        serde_json::from_value(json!({ "id": id, "objectives": [0.5], "critical": true })).unwrap()
    };
    search.tell(&[result(0), result(1), result(2)]).unwrap();
    let error = search.tell(&[result(0)]).unwrap_err();
    assert_eq!(error.message(), "it was told more than it asked for");
}

#[test]
fn the_verbs_use_a_plugin_of_the_first_sdk_as_any_other() {
    let folder = temp();
    let verb = |arguments: &[&str]| {
        Pdk::new(arguments).arg("--plugins").arg(test_library("frozen")).folder(folder.path())
    };
    for kind in KINDS_OF_THE_FIRST_SDK {
        let listed = verb(&["list", kind.name()]).succeed();
        assert!(
            listed.stdout.contains("frozen") && listed.stderr.is_empty(),
            "{}{}",
            listed.stdout,
            listed.stderr
        );
        assert!(verb(&["show", "frozen"]).succeed().stdout.contains(&format!("kind      {kind}")));
    }
    pictures::write(&folder.path().join("in.png"), 32, 24);
    verb(&["perturb", "in.png", "--with", "frozen@3,mode=hard", "-o", "out.png"]).succeed();
    let out = image::open(folder.path().join("out.png")).unwrap().into_rgb8();
    assert_eq!(out.get_pixel(0, 0).0, [3, 1, 0]);

    let source = r#"
        pdk.drive({ simulator = "frozen", driver = "frozen", scenarios = { {}, { perturbations = { "frozen@1" } } } })
        pdk.evaluate({ dataset = { name = "frozen" }, driver = "frozen", perturbations = { "frozen" }, levels = { 2 } })
    "#;
    let out = folder.path().join("out");
    verb(&["run"]).arg("--out").arg(&out).arg(pipeline(folder.path(), source)).succeed();
    let lines = json_lines(&out.join("scenarios.jsonl"));
    assert_eq!(lines.len(), 2);
    for line in &lines {
        assert_eq!((&line["cause"], &line["frames"]), (&json!("finished"), &json!(21)), "{line}");
        assert_eq!(line["max_cross_track_error"], json!(0.25));
    }
    assert_ne!(lines[0]["digest"], lines[1]["digest"]);
    let results = fs::read_to_string(out.join("results.jsonl")).unwrap();
    assert!(results.contains("this one is gone"), "{results}");
    let manifest = json_file(&out.join("manifest.json"));
    let frozen = manifest["components"].as_array().unwrap().iter().find(|c| c["name"] == "frozen").unwrap();
    let plugin = json!({ "name": "frozen", "version": "1.2.3", "homepage": "https://example.org/frozen" });
    assert_eq!(frozen["plugin"], plugin);
    assert_eq!(frozen["file"]["blake3"].as_str().unwrap().len(), 64);
    let replayed = verb(&["replay"]).arg(&out).succeed();
    assert!(replayed.stdout.contains("2 of 2 equal") && replayed.stderr.is_empty(), "{}", replayed.stdout);
}

#[test]
fn a_plugin_that_knows_more_works_with_a_word() {
    let folder = temp();
    let verb = |arguments: &[&str]| {
        Pdk::new(arguments).arg("--plugins").arg(test_library("later")).folder(folder.path())
    };
    let listed = verb(&["list", "driver"]).succeed();
    let words: Vec<_> = listed.stderr.lines().collect();
    let end = "; the plugin was built with pdk-sdk 9.1.0, and this pdk has ";
    assert_eq!(words.len(), 4, "{}", listed.stderr);
    for (word, said) in words.iter().zip([
        "the plugin says `licence`, which this pdk does not know and leaves out",
        "`later` is left out, because it is of the kind `horn`, which this pdk does not know",
        "driver `later`: its parameter `tint` is of the type `colour`, which this pdk does not know and leaves to the plugin to check",
        "driver `later` says `since`, `parameters[0].step`, which this pdk does not know and leaves out",
    ]) {
        let start = format!("pdk: warning: plugin {}: {said}{end}", test_library("later").display());
        assert!(word.starts_with(&start), "{word}\n{start}");
    }
    let shown = verb(&["show", "later"]).succeed();
    assert!(shown.stdout.contains("kind      driver") && !shown.stdout.contains("horn"), "{}", shown.stdout);
    let doctor = verb(&["doctor"]).succeed();
    assert_eq!(doctor.stdout.matches("note left out").count(), 4, "{}", doctor.stdout);
    let checked = Pdk::new(["check"]).arg(test_library("later")).succeed();
    assert!(checked.stdout.contains("ok   driver `later`"), "{}", checked.stdout);
    assert_eq!(checked.stdout.matches("note ").count(), 4, "{}", checked.stdout);

    // Its fields that pdk does not know do no harm, and its functions that pdk does not know are not called.
    let registry = registry("later");
    let (mut driver, _) = registry.driver("later", &Map::new()).unwrap();
    let mut frame = FrameBuf::new(4, 3);
    frame.as_mut().set_pixel(0, 0, [200, 0, 0]);
    for frames in [1.0, 2.0] {
        let cx = DriveContext { frame_index: 3, time: 0.5, speed: f64::NAN };
        let control = driver.drive(frame.as_ref(), &cx).unwrap();
        assert_eq!(control, Control { steering: 0.2, throttle: 0.05 + frames / 1000.0 });
    }
    // What it fails with is a number that pdk does not know.
    let error = registry.driver("later", &parameters(json!({ "tint": "blue" }))).err().unwrap();
    assert_eq!(error.kind(), ErrorKind::Failed);
    assert!(error.message().starts_with("driver `later`: it was asked for number 1 with {"), "{error}");

    let source = r#"pdk.drive({ simulator = "lane", driver = "later", duration = 1, scenarios = { {} } })"#;
    let out = folder.path().join("out");
    verb(&["run"]).arg("--out").arg(&out).arg(pipeline(folder.path(), source)).succeed();
    assert_eq!(json_lines(&out.join("scenarios.jsonl"))[0]["cause"], json!("time_out"));
}
