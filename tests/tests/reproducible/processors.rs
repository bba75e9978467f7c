//! The same scenario on other processors: the same id, the same outcome, byte for byte. The processors are emulated by qemu-user, if it is
//! installed.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use pdk_tests::process::pipeline;
use pdk_tests::{Pdk, built, temp};

const PIPELINE: &str = r#"
    pdk.show(pdk.drive {
        simulator = { name = "lane", width = 160, height = 80 },
        driver = "dave2",
        duration = 0.4,
        scenarios = {
            {},
            { perturbations = { { name = "gaussian_noise", level = 2 }, { name = "fog_filter", level = 3 } } },
        },
    })
"#;

/// Networks of every make that comes with pdk, beside convolutions of floats: of integers, a transformer, and a planner with its controller.
const MAKES: &str = r#"
    for _, driver in { "dave2_quantised", "transformer", "waypoint_planner" } do
        pdk.drive({ simulator = { name = "lane", width = 160, height = 80 }, driver = driver, duration = 0.05, scenarios = { {} } })
    end
"#;

/// Starts pdk, and all that it starts of itself, on an emulated processor.
struct Emulator {
    qemu: PathBuf,
    shim: PathBuf,
}

impl Emulator {
    /// None, with a word, if there is no qemu-user or no C compiler.
    fn find(folder: &Path) -> Option<Self> {
        let path = std::env::var_os("PATH")?;
        let Some(qemu) =
            std::env::split_paths(&path).map(|at| at.join("qemu-x86_64")).find(|file| file.is_file())
        else {
            eprintln!("skipped: other processors, because qemu-user is not installed");
            return None;
        };
        let shim = folder.join("emulate.so");
        let source = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/reproducible/emulate.c");
        let compiled = Command::new("cc")
            .args(["-O1", "-shared", "-fPIC", "-o"])
            .arg(&shim)
            .args([source, "-ldl"])
            .status();
        if !compiled.is_ok_and(|status| status.success()) {
            eprintln!("skipped: other processors, because `cc` cannot compile {source}");
            return None;
        }
        Some(Self { qemu, shim })
    }

    fn run(&self, processor: &str, arguments: &[&str], folder: &Path) -> Output {
        let preload = format!("LD_PRELOAD={}", self.shim.display());
        Command::new(&self.qemu)
            .args(["-cpu", processor, "-E", &preload])
            .arg(built("pdk"))
            .args(arguments)
            .env("PDK_EMULATOR", &self.qemu)
            .env("PDK_EMULATED", processor)
            .env("LD_PRELOAD", &self.shim)
            .current_dir(folder)
            .output()
            .unwrap()
    }
}

#[test]
#[cfg(target_arch = "x86_64")]
#[ignore = "long: .ci/run runs it"]
fn a_network_drives_the_same_on_every_processor() {
    let folder = temp();
    let folder = folder.path();
    let Some(emulator) = Emulator::find(folder) else { return };
    let pipeline = pipeline(folder, &[PIPELINE, MAKES].concat());
    let pipeline = pipeline.to_str().unwrap();
    let ledger = |record: &str| fs::read_to_string(folder.join(record).join("scenarios.jsonl")).unwrap();
    let drive = |processor: Option<&str>, record: &str| {
        let arguments = ["run", pipeline, "--workers", "1", "--out", record, "--set", "patience=600"];
        let output = match processor {
            Some(processor) => emulator.run(processor, &arguments, folder),
            None => Command::new(built("pdk")).args(arguments).current_dir(folder).output().unwrap(),
        };
        assert!(output.status.success(), "{record}: {}", String::from_utf8_lossy(&output.stderr));
        ledger(record)
    };
    let drive = &drive;
    // The last has no vector instructions of 256 bits, and no multiply-add. They take minutes each, so two are emulated at a time.
    let pairs = [["Haswell", "Skylake-Client"], ["EPYC-Milan", "Nehalem"]];
    let ledgers: Vec<(&str, String)> = std::thread::scope(|scope| {
        let lanes = pairs.map(|pair| scope.spawn(move || pair.map(|name| (name, drive(Some(name), name)))));
        lanes.into_iter().flat_map(|lane| lane.join().unwrap()).collect()
    });
    let here = drive(None, "here");
    assert_eq!(here.lines().count(), 5);
    for (processor, ledger) in ledgers {
        assert!(ledger == here, "{processor} wrote another ledger than this processor");
    }
}

#[test]
fn an_engine_that_this_machine_does_not_have_ends_the_run_before_anything_is_driven() {
    let folder = temp();
    let out = folder.path().join("out");
    let pipeline = pipeline(folder.path(), PIPELINE);
    let run = |engine: &str, expected: &str| {
        Pdk::new(["run", "--set", engine, "--out"]).arg(&out).arg(&pipeline).fail(1, &[expected]);
        assert!(!out.join("scenarios.jsonl").exists(), "nothing was driven");
    };
    let absent = "driver `dave2`: parameter `engine` is \"onnxruntime 0.1.0/z80\", which this machine does not have; it has ";
    run("engine=onnxruntime 0.1.0/z80", absent);
    run("engine=pkd", "has to be one of pdk, auto, onnxruntime");
}

#[test]
fn the_engine_is_recorded_once_however_it_was_asked_for() {
    let folder = temp();
    let pipeline = pipeline(folder.path(), PIPELINE);
    let ledger = |name: &str, more: &[&str]| {
        let out = folder.path().join(name);
        let run = Pdk::new(["run", "--out"]).arg(&out).args(more).arg(&pipeline).succeed();
        let engine =
            run.stdout.lines().chain(run.stderr.lines()).find_map(|line| line.strip_prefix("engine: "));
        (fs::read_to_string(out.join("scenarios.jsonl")).unwrap(), engine.unwrap().to_owned())
    };
    let (by_default, engine) = ledger("default", &[]);
    assert!(
        by_default.contains(&format!(r#""driver":{{"name":"dave2","parameters":{{"engine":"{engine}"}}}}"#)),
        "{by_default}"
    );
    for (asked, name) in [("pdk", "asked"), (engine.as_str(), "full")] {
        assert_eq!(ledger(name, &["--set", &format!("engine={asked}")]).0, by_default);
    }
}
