//! Files, scripts and components that mean harm, or are damaged: each is refused or survived in one sentence, soon, in little
//! memory, and never in silence.

use std::fs;
use std::os::unix::fs::symlink;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::{Duration, Instant};

use pdk_tests::process::pipeline;
use pdk_tests::{Pdk, pictures, temp};
use serde_json::json;

/// What is refused is refused in this time, also on a busy machine. Some of it would go on for ever, and the rest for hours.
const SOON: Duration = Duration::from_secs(180);

fn soon<T>(what: &str, work: impl FnOnce() -> T) -> T {
    let started = Instant::now();
    let result = work();
    assert!(started.elapsed() < SOON, "{what} took {:.0} s", started.elapsed().as_secs_f64());
    result
}

/// A pipe without a writer, a link to a device that never ends, and how each is named.
fn endless(folder: &Path) -> [(PathBuf, &'static str); 2] {
    let (pipe, zero) = (folder.join("pipe"), folder.join("zero"));
    assert!(Command::new("mkfifo").arg(&pipe).status().unwrap().success());
    symlink("/dev/zero", &zero).unwrap();
    [(pipe, "it is a pipe"), (zero, "it is a device")]
}

#[test]
fn an_irregular_file_is_not_read_wherever_a_file_is_named() {
    let folder = temp();
    pictures::write(&folder.path().join("in.png"), 16, 12);
    for (path, said) in endless(folder.path()) {
        let shown = path.to_str().unwrap();
        let here = |arguments: &[&str]| Pdk::new(arguments).folder(folder.path());
        let perturb = |with: &str, image: &str| here(&["perturb", image, "--with", with, "-o", "out.png"]);
        let mask = json!({ "mask": shown });
        soon("an image", || perturb("contrast@1", shown).fail(1, &[said]));
        soon("a mask", || perturb(&format!("contrast@1,region={mask}"), "in.png").fail(1, &[said]));
        soon("a clip", || perturb(&format!("overlay@2,clip={shown}"), "in.png").fail(1, &[said]));
        for option in ["--plugins", "--drop-ins"] {
            soon(option, || here(&["list", option, shown]).fail(1, &["is not a folder", option]));
        }
        soon("a pipeline", || here(&["run", shown]).fail(1, &[said]));
        soon("a plugin", || {
            let checked = here(&["check", shown]).run();
            assert_eq!(checked.code, Some(1), "{}{}", checked.stdout, checked.stderr);
            assert!(format!("{}{}", checked.stdout, checked.stderr).contains(said), "{}", checked.stdout);
        });
        let run = |source: &str| Pdk::new(["run"]).arg(pipeline(folder.path(), source)).folder(folder.path());
        soon("a model", || {
            run(&format!(
                "pdk.drive({{ simulator = 'lane', driver = {{ name = 'onnx', model = '{shown}' }}, scenarios = {{ {{}} }} }})"
            ))
            .fail(1, &[said]);
        });
        let evaluate = |reader: &str, dataset: &Path| {
            run(&format!(
                "pdk.evaluate({{ dataset = {{ name = '{reader}', path = '{}' }}, driver = 'lane_keeper', perturbations = \
                 {{ 'contrast' }}, levels = {{ 1 }} }})",
                dataset.display()
            ))
            .fail(1, &[said]);
        };
        let dataset = |name: &str| {
            let dataset = folder.path().join(format!("{name}-{}", path.file_name().unwrap().display()));
            fs::create_dir_all(dataset.join("images")).unwrap();
            dataset
        };
        // Inside of the dataset's folder, or it would be refused for that.
        let put = |target: PathBuf| match said {
            "it is a pipe" => assert!(Command::new("mkfifo").arg(target).status().unwrap().success()),
            _ => symlink("/dev/zero", target).unwrap(),
        };
        let inside = said == "it is a pipe";
        if inside {
            let tub = dataset("manifest");
            put(tub.join("manifest.json"));
            soon("a manifest", || evaluate("tub", &tub));
            let tub = dataset("catalog");
            fs::write(tub.join("manifest.json"), "{\"paths\":[\"c.catalog\"]}\n").unwrap();
            put(tub.join("c.catalog"));
            soon("a catalog", || evaluate("tub", &tub));
            let images = dataset("folder");
            pictures::write(&images.join("1_a.png"), 8, 8);
            put(images.join("record_1.json"));
            soon("a record", || evaluate("folder", &images));
        }
    }
}

#[test]
fn records_with_pipes_in_the_place_of_files_are_refused() {
    let folder = temp();
    let source = "pdk.drive({ simulator = 'misbehave', driver = 'misbehave', scenarios = { {} } })";
    let script = pipeline(folder.path(), source);
    let out = folder.path().join("record");
    let run = || Pdk::new(["run", "--out"]).arg(&out).arg(&script).misbehave();
    run().succeed();
    let lines = out.join("scenarios.jsonl");
    let before = fs::read(&lines).unwrap();
    fs::remove_file(&lines).unwrap();
    assert!(Command::new("mkfifo").arg(&lines).status().unwrap().success());
    for verb in ["report", "replay"] {
        soon(verb, || Pdk::new([verb]).arg(&out).misbehave().fail(1, &["record"]));
    }
    soon("a run that goes on", || run().fail(1, &["scenarios.jsonl", "it is a pipe"]));
    fs::remove_file(&lines).unwrap();
    fs::write(&lines, before).unwrap();
    run().succeed();
}

#[test]
fn nothing_that_a_terminal_would_obey_is_written_to_it() {
    let folder = temp();
    let name = "\u{1b}]0;x\u{7}\u{1b}[2J\u{9b}3J";
    let run = |source: &str| {
        Pdk::new(["run"]).arg(pipeline(folder.path(), source)).misbehave().folder(folder.path())
    };
    let lua = "\\27]0;x\\7\\27[2J\\194\\1553J";
    let mut finished = vec![
        run(&format!("print('{lua}') pdk.table({{ 'a{lua}' }}, {{ {{ '{lua}' }} }})")).run(),
        run(&format!("error('{lua}')")).run(),
        run(&format!(
            "pdk.show(pdk.drive({{ simulator = 'misbehave', driver = 'misbehave', scenarios = {{ {{ name = '{lua}' }} }} }}))"
        ))
        .run(),
        run(&format!(
            "pdk.drive({{ simulator = 'misbehave', driver = 'misbehave', scenarios = {{ {{ perturbations = {{ '{lua}' }} }} }} }})"
        ))
        .run(),
        run(&format!("require('./{lua}')")).run(),
    ];
    fs::write(folder.path().join(format!("{name}.png")), "no picture").unwrap();
    let perturb = Pdk::new(["perturb", &format!("{name}.png"), "--with", "contrast@1", "-o", "out.png"]);
    finished.push(perturb.folder(folder.path()).run());
    fs::create_dir(folder.path().join("perturbations")).unwrap();
    fs::write(folder.path().join(format!("perturbations/{name}.lua")), format!("error('{lua}')")).unwrap();
    finished.push(Pdk::new(["list", "--plugins", "perturbations"]).folder(folder.path()).run());
    for (number, finished) in finished.iter().enumerate() {
        let written = format!("{}{}", finished.stdout, finished.stderr);
        let obeyed = |c: char| c.is_control() && c != '\n' && c != '\t';
        assert!(!written.contains(obeyed), "{number}: {written:?}");
        assert!(written.contains("\\u{1b}"), "{number}: {written}");
    }
}

#[test]
fn json_has_nothing_that_a_terminal_would_obey_and_stays_json() {
    let folder = temp();
    pictures::write(&folder.path().join("in.png"), 16, 12);
    let name = "\u{7f}\u{9b}3J\u{202e}.png";
    let perturb = Pdk::new(["perturb", "in.png", "--with", "contrast@1", "--json", "-o", name]);
    let finished = perturb.folder(folder.path()).succeed();
    assert_eq!(finished.json()["outputs"][0], name);
    assert!(!finished.stdout.contains(['\u{7f}', '\u{9b}', '\u{202e}']), "{:?}", finished.stdout);
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn a_damaged_library_is_refused_by_name_and_the_others_are_there() {
    let folder = temp();
    let whole = fs::read(pdk_tests::test_library("misbehave")).unwrap();
    let path = folder.path().join("plugins/libdamaged.so");
    fs::create_dir(path.parent().unwrap()).unwrap();
    let mut refused = 0;
    for round in 0..40 {
        let mut damaged = whole.clone();
        // Where the system looks first, and anywhere.
        let place = match round % 2 {
            0 => 16 + round * 24,
            _ => whole.len() / 40 * round,
        };
        damaged[place..place + 8].iter_mut().for_each(|byte| *byte ^= 0x5a);
        fs::write(&path, damaged).unwrap();
        let list = Pdk::new(["list", "driver", "--plugins", "plugins"]).folder(folder.path());
        let finished = soon("a damaged library", || list.env("PDK_CACHE", folder.path().join("cache")).run());
        assert_eq!(finished.code, Some(0), "{place}: {}", finished.stderr);
        assert!(finished.stdout.contains("lane_keeper"), "{place}: {}", finished.stdout);
        let named = finished.stderr.contains("libdamaged.so");
        assert!(named || place != 16, "the kind of file and of machine were damaged, and nothing was said");
        refused += usize::from(named);
    }
    assert!(refused >= 5, "{refused} of 40 were refused");
}

/// The endings that a drop can come to and the words for them.
const ENDINGS: [(&str, &str); 4] = [
    ("segfault", "in `drop` was ended by signal 11"),
    ("abort", "in `drop` was ended by signal 6"),
    ("exit", "in `drop` ended the process with exit code"),
    ("hang", "in `drop` has not come back for"),
];

#[test]
#[ignore = "long: .ci/run runs it"]
fn a_component_that_ends_badly_is_named_and_the_run_fails() {
    let folder = temp();
    for (way, said) in ENDINGS {
        for (kind, simulator, driver) in [("driver", "behave", way), ("simulator", way, "behave")] {
            let how = |way: &str| match way {
                "behave" => way.to_owned(),
                way => format!("{way}_in_drop"),
            };
            let source = format!(
                "pdk.drive({{ simulator = {{ name = 'misbehave', how = '{}' }}, driver = {{ name = 'misbehave', how = '{}' }}, \
                 scenarios = {{ {{}}, {{ seed = 1 }} }} }})",
                how(simulator),
                how(driver)
            );
            let out = folder.path().join(format!("{kind}-{way}"));
            let run = Pdk::new(["run", "--set", "patience=1", "--out"]).arg(&out);
            let named = format!("{kind} `misbehave` {said}");
            let run = run.arg(pipeline(folder.path(), &source)).misbehave();
            soon(way, || run.fail(1, &[&named, "what was recorded is kept"]));
            // Whatever comes behind them, the scenarios came to their end.
            let outcomes = pdk_tests::process::json_lines(&out.join("scenarios.jsonl"));
            assert_eq!(outcomes.len(), 2);
            assert!(outcomes.iter().all(|outcome| outcome["cause"] == "finished"), "{outcomes:?}");
        }
    }
}

#[test]
fn a_scenario_that_is_asked_for_twice_fails_once() {
    let folder = temp();
    let source =
        "pdk.drive({ simulator = 'misbehave', driver = { name = 'misbehave', how = 'panic_in_drive' },
        scenarios = { {}, {}, { seed = 1 } } })";
    let run = Pdk::new(["run"]).arg(pipeline(folder.path(), source)).misbehave().folder(folder.path());
    run.fail(1, &["2 of 2 scenarios could not be driven"]);
}

#[test]
fn a_script_that_was_meant_as_a_perturbation_gets_a_reason_why_it_is_not_one() {
    let folder = temp();
    let source = "pdk.drive({ simulator = 'misbehave', driver = 'misbehave', scenarios = { { perturbations = { 'helper@1' } } } })";
    let run = || Pdk::new(["run"]).arg(pipeline(folder.path(), source)).misbehave().folder(folder.path());
    for (script, said) in [
        ("return { doc = 'Helps', aply = function() end }", "`aply`"),
        ("return { doc = 'Helps' }", "has no `apply`"),
        ("return { help = function() end }", "does not return a table with `apply`"),
    ] {
        fs::write(folder.path().join("helper.lua"), script).unwrap();
        run().fail(1, &["there is no perturbation `helper`", "helper.lua", said]);
    }
}

/// A file of those that ask for much, if they are at hand.
fn attack(name: &str) -> Option<PathBuf> {
    let data = std::env::var_os("PDK_TEST_DATA")
        .map_or_else(|| pdk_tests::repository().join("../shared"), PathBuf::from);
    let path = data.join("attacks").join(name);
    if !path.is_file() {
        eprintln!("skipped: there is no {}", path.display());
    }
    path.is_file().then_some(path)
}

#[test]
fn small_files_that_ask_for_much_are_refused() {
    let folder = temp();
    pictures::write(&folder.path().join("in.png"), 16, 12);
    for (name, said) in [
        ("jpeg_claims_16000.jpg", "it is 16000 x 16000, and pictures may have 64 megapixels"),
        ("jpeg_half_scan.jpg", "it is damaged"),
        ("jpeg_no_scan.jpg", "it is damaged"),
        ("idxbad.png", "it is damaged: a pixel has color"),
        ("samples_2e32.mp4", "it is damaged: its index claims 4294967295 frames"),
        ("gif_65535.gif", "it is 65535 x 65535, and pictures may have"),
    ] {
        let Some(path) = attack(name) else { continue };
        let shown = path.to_str().unwrap();
        if !name.ends_with(".gif") {
            let output = if name.ends_with(".mp4") { "out.mp4" } else { "out.png" };
            let perturb = Pdk::new(["perturb", shown, "--with", "contrast@1", "-o", output]);
            soon(name, || perturb.folder(folder.path()).fail(1, &[said]));
        }
        let overlay = format!("overlay@2,clip={shown}");
        let perturb = Pdk::new(["perturb", "in.png", "--with", &overlay, "-o", "out.png"]);
        soon(name, || perturb.folder(folder.path()).fail(1, &[said]));
    }
    if let Some(path) = attack("onnx_expand.onnx") {
        let source = format!(
            "pdk.drive({{ simulator = {{ name = 'lane', width = 80, height = 60 }}, driver = {{ name = 'onnx', model = '{}' }}, \
             scenarios = {{ {{}} }} }})",
            path.display()
        );
        let run = Pdk::new(["run"]).arg(pipeline(folder.path(), &source)).folder(folder.path());
        soon("onnx_expand.onnx", || run.fail(1, &["a tensor of the shape (1000000000, 2) is too large"]));
    }
}
