//! A pipeline that is run against something that goes wrong: what is said, how long it takes, what is kept, and that nothing is left.
//! `PDK_SHOW=1` prints all of it.

use std::path::Path;
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use serde_json::{Value, json};

use crate::process::{Finished, LIMIT, Pdk, json_lines, pipeline};
use crate::processes::{BusFolder, comes_true};
use crate::stand_in::{free_ports, program};
use crate::{repository, temp};

/// What came of a run.
pub struct Tried {
    /// How it ended.
    pub finished: Finished,
    /// How long it took.
    pub took: Duration,
    /// The lines of its ledger.
    pub lines: Vec<Value>,
}

/// Whether Python has what drivers and simulators in another process need.
pub fn python() -> bool {
    let found = Command::new("python3").args(["-c", "import iceoryx2, numpy"]).stderr(Stdio::null()).status();
    let found = found.is_ok_and(|status| status.success());
    if !found {
        eprintln!("skipped: python3 has no iceoryx2 and numpy");
    }
    found
}

/// Runs a pipeline with these settings and one worker, unless they say otherwise. Drivers in Python find their module.
///
/// # Panics
/// If a process of the run is left, or something of it in shared memory.
#[track_caller]
pub fn run(source: &str, settings: &[(&str, &str)]) -> Tried {
    let bus = BusFolder::new();
    run_at(&bus, source, settings)
}

/// The same, with its topics in this folder, which others may use as well. These have to be gone when it ends.
///
/// # Panics
/// As [`run`].
#[track_caller]
pub fn run_at(bus: &BusFolder, source: &str, settings: &[(&str, &str)]) -> Tried {
    let folder = temp();
    let out = folder.path().join("out");
    let mut command = Pdk::new(["run", "--out"]).arg(&out).arg(pipeline(folder.path(), source));
    if !settings.iter().any(|(key, _)| *key == "workers") {
        command = command.set("workers", 1);
    }
    for (key, value) in settings {
        command = command.set(key, value);
    }
    let (variable, place) = bus.variable();
    let command = command.env(variable, place).env("PYTHONPATH", repository().join("sdk/python"));
    let began = Instant::now();
    let finished = command.run();
    let took = began.elapsed();
    assert!(comes_true(LIMIT, || bus.processes().is_empty()), "{:?}", bus.processes());
    assert!(bus.left().is_empty(), "{:?}", bus.left());
    let tried = Tried { finished, took, lines: lines_of(&out) };
    if std::env::var_os("PDK_SHOW").is_some() {
        tried.show();
    }
    tried
}

fn lines_of(out: &Path) -> Vec<Value> {
    let lines = out.join("scenarios.jsonl");
    if lines.exists() { json_lines(&lines) } else { Vec::new() }
}

impl Tried {
    /// The causes of the outcomes that were kept.
    pub fn causes(&self) -> Vec<&str> {
        self.lines.iter().map(|line| line["cause"].as_str().unwrap()).collect()
    }

    /// The error of the first outcome, which is empty if there was none; if nothing was kept, what was said.
    pub fn error(&self) -> &str {
        match self.lines.first() {
            Some(line) => line["error"].as_str().unwrap_or_default(),
            None => self.finished.stderr.trim(),
        }
    }

    /// The kind of that error.
    pub fn kind(&self) -> &str {
        self.lines.first().and_then(|line| line["error_kind"].as_str()).unwrap_or_default()
    }

    /// It ended with this code, and said all of this.
    ///
    /// # Panics
    /// If not.
    #[track_caller]
    pub fn says(&self, code: i32, parts: &[&str]) {
        let stderr = &self.finished.stderr;
        assert_eq!(self.finished.code, Some(code), "{stderr}{}", self.finished.stdout);
        for part in parts {
            assert!(stderr.contains(part), "`{stderr}` does not say `{part}`");
        }
        assert!(!stderr.contains("(os error"), "{stderr}");
    }

    fn show(&self) {
        let said: Vec<_> = self.finished.stderr.lines().filter(|line| !line.is_empty()).collect();
        let frames: Vec<_> =
            self.lines.iter().map(|line| format!("{}: {}", line["cause"], line["frames"])).collect();
        eprintln!(
            "-- {:.1} s, exit code {:?}, kept: {frames:?}\n   {}",
            self.took.as_secs_f64(),
            self.finished.code,
            said.join("\n   ")
        );
    }
}

/// A simulator that pdk starts, and that dies or hangs in its first scenario, is started again, and the scenario driven again.
/// `which` is that of the stand-in, with `options`; the fault comes `at` this many controls.
///
/// # Panics
/// If it is not.
#[track_caller]
pub fn is_started_again(source: &str, simulator: &Value, which: &str, options: &str, at: u64) {
    for (fault, says) in [("die", "ended (exit status: 3)"), ("hang", "has not sent telemetry within 10 s")] {
        let folder = temp();
        let mark = folder.path().join("started");
        // Only the first one goes wrong.
        let stand_in = format!("exec {} {which} $0 {options}", program().display());
        let script = format!(
            "test -e {0} && {stand_in}; touch {0}; {stand_in} --fault {fault} --at {at}",
            mark.display()
        );
        let mut simulator = simulator.clone();
        simulator["port"] = json!(free_ports(1));
        simulator["launch"] = json!(["sh", "-c", script, "{port}"]);
        // The second one may be slow, on a machine that is busy.
        simulator["answer_seconds"] = json!(10);
        let tried = run(source, &[("simulator", &simulator.to_string())]);
        tried.says(0, &[says, "driven again"]);
        assert_eq!(tried.causes(), ["time_out"; 2], "{fault}");
    }
}
