//! Rounds of runs that get a signal at random moments, or whose processes do, and that are continued: each ends like an
//! undisturbed one, leaves nothing, and is in no way of a short run behind it.
//!
//! `PDK_KILLS` sets the number of rounds, and `PDK_KILLS_SEED` where the moments are drawn from;
//! `PDK_KILLS=200 cargo test --release --test faults kills:: -- --include-ignored --nocapture` prints what was met.

use std::collections::{BTreeMap, BTreeSet};
use std::os::unix::process::ExitStatusExt;
use std::path::{Path, PathBuf};
use std::process::Child;
use std::time::{Duration, Instant};

use pdk_tests::process::{LIMIT, pipeline};
use pdk_tests::processes::{self, BusFolder, Process, comes_true, ended_within, shared_memory};
use pdk_tests::random::Random;
use pdk_tests::records::{difference, files, lines, partial};
use pdk_tests::{Pdk, temp};
use rustix::process::Signal;

/// The default number of rounds.
const ROUNDS: usize = 12;
/// A run is killed at most this many times.
const MOST_KILLS: u32 = 3;

/// Eight short scenarios, of which the second half depends on what the first came to.
const SOURCE: &str = r#"
    local settings = pdk.settings({ width = 80 })
    local function drive(first, last, level)
        local scenarios = {}
        for number = first, last do
            table.insert(scenarios, {
                road = { angles = { 0, number, -number }, segment = 10 }, duration = number % 4 == 0 and 1 or 0.5,
                perturbations = { "gaussian_noise@" .. level, number % 3 == 0 and "banding@2" or "contrast@1" },
            })
        end
        return pdk.drive({
            simulator = { name = "lane", width = settings.width, height = 60 }, driver = "lane_keeper", images_every = 5,
            scenarios = scenarios,
        })
    end
    local first = drive(1, 4, 2)
    local frames = 0
    for _, outcome in first do
        frames = frames + outcome.frames
    end
    drive(5, 8, frames % 5 / 2)
    pdk.save("frames.json", { frames = frames })
"#;

/// One scenario, driven behind each round.
const SHORT: &str = r#"
    pdk.drive({ simulator = { name = "lane", width = 80, height = 60 }, driver = "lane_keeper", duration = 0.5, scenarios = {
        { road = { angles = { 0, 20, -10 }, segment = 10 }, perturbations = { "gaussian_noise@2" } } } })
"#;

/// Who gets a signal.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum Target {
    Run,
    Worker,
    Components,
    RunAndWorker,
    Everybody,
    /// Any of them is stopped for a while, and goes on.
    Paused,
}

const TARGETS: [Target; 6] = [
    Target::Run,
    Target::Worker,
    Target::Components,
    Target::RunAndWorker,
    Target::Everybody,
    Target::Paused,
];

/// What comes from outside. Half of all are kills, which a process cannot prepare for.
const SIGNALS: [Signal; 6] =
    [Signal::KILL, Signal::KILL, Signal::KILL, Signal::TERM, Signal::HUP, Signal::INT];
/// What a defect, or an accident, may end the run itself with besides.
const FAULTS: [Signal; 3] = [Signal::SEGV, Signal::ABORT, Signal::BUS];
/// A run that has not ended after so long hangs.
const HANGS: Duration = Duration::from_secs(120);

/// What is the same in all rounds.
struct Setting {
    script: PathBuf,
    expected: BTreeMap<PathBuf, Vec<u8>>,
    short: PathBuf,
    expected_short: BTreeMap<PathBuf, Vec<u8>>,
    /// How long an undisturbed run takes.
    length: Duration,
}

/// What a round met.
#[derive(Default)]
struct Met {
    counts: BTreeMap<String, usize>,
    /// The names of the buses that were seen, as they are in the names of files in shared memory.
    buses: BTreeSet<String>,
}

impl Met {
    fn count(&mut self, what: impl Into<String>) {
        *self.counts.entry(what.into()).or_default() += 1;
    }

    /// Notes the buses of a run.
    fn look(&mut self, bus: &BusFolder) {
        self.buses.extend(bus.buses());
    }
}

/// Starts a run. What it puts into the folder for temporary files lies in `temporary`.
fn start(script: &Path, out: &Path, bus: &BusFolder, temporary: &Path) -> Child {
    let (variable, value) = bus.variable();
    let run = Pdk::new(["run", "--workers", "2", "--out"]).arg(out).arg(script).env(variable, value);
    run.env("TMPDIR", temporary).folder(script.parent().unwrap()).spawn()
}

/// Waits for a moment, or the end of the run before it; whether the moment came.
fn wait_for(child: &mut Child, moment: Duration, bus: &BusFolder, met: &mut Met) -> bool {
    let started = Instant::now();
    while started.elapsed() < moment {
        if child.try_wait().unwrap().is_some() {
            return false;
        }
        met.look(bus);
        std::thread::sleep(Duration::from_micros(500).min(moment.saturating_sub(started.elapsed())));
    }
    met.look(bus);
    child.try_wait().unwrap().is_none()
}

/// Sends a signal, and says which and to whom.
fn kill(target: Target, child: &mut Child, bus: &BusFolder, random: &mut Random) -> String {
    let of_run: Vec<Process> = bus.processes();
    let any = SIGNALS[random.below(SIGNALS.len())];
    let kill_one = |ending: &str, random: &mut Random| {
        let found: Vec<&Process> =
            of_run.iter().filter(|process| process.command.ends_with(ending)).collect();
        match found.is_empty() {
            true => "no process".to_owned(),
            false => {
                found[random.below(found.len())].signal(any);
                ending.trim().to_owned()
            }
        }
    };
    let killed = match target {
        Target::Run => {
            let fault = random.below(4) == 0;
            let signal = if fault { FAULTS[random.below(FAULTS.len())] } else { any };
            processes::signal(child, signal);
            return format!("run {signal:?}");
        }
        Target::Worker => kill_one(" worker", random),
        Target::Components => kill_one(" worker --components", random),
        Target::RunAndWorker => {
            let ending = [" worker", " worker --components"][random.below(2)];
            let first = random.below(2) == 0;
            if first {
                processes::signal(child, any);
            }
            let other = kill_one(ending, random);
            if !first {
                processes::signal(child, any);
            }
            format!("run and {other}")
        }
        Target::Everybody => {
            // The run first, so that it does not start another process; then the processes that there are by now.
            processes::signal(child, Signal::STOP);
            bus.processes().iter().for_each(|process| process.signal(Signal::KILL));
            return "everybody KILL".to_owned();
        }
        Target::Paused => {
            if of_run.is_empty() {
                return "no process".to_owned();
            }
            let paused = &of_run[random.below(of_run.len())];
            paused.signal(Signal::STOP);
            std::thread::sleep(Duration::from_millis(300).mul_f64(random.unit()));
            paused.signal(Signal::CONT);
            return "paused".to_owned();
        }
    };
    format!("{killed} {any:?}")
}

/// A run that is killed and continued until it comes to its end. What is wrong with it then.
fn round(setting: &Setting, random: &mut Random, met: &mut Met) -> Result<(), String> {
    // As deep below the working folder as the undisturbed runs, since a record says where that is.
    let folder = tempfile::tempdir_in(setting.script.parent().unwrap()).unwrap();
    let bus = BusFolder::new();
    let out = folder.path().join("record");
    let temporary = folder.path().join("tmp");
    std::fs::create_dir(&temporary).unwrap();
    met.buses.clear();
    let mut kills = 0;
    let mut story = String::new();
    loop {
        let mut child = start(&setting.script, &out, &bus, &temporary);
        if kills == 0 || kills < MOST_KILLS && random.below(2) == 0 {
            let early = random.below(5) == 0;
            let length = if early { Duration::from_millis(50) } else { setting.length };
            let moment = length.mul_f64(random.unit());
            let target = TARGETS[random.below(TARGETS.len())];
            if wait_for(&mut child, moment, &bus, met) {
                let killed = kill(target, &mut child, &bus, random);
                story += &format!(
                    "[{killed} at {} ms, {} lines] ",
                    moment.as_millis(),
                    lines(&out.join("scenarios.jsonl"))
                );
                met.count(format!("killed: {killed}"));
                met.count(if early { "within 50 ms" } else { "at any time" });
            } else {
                met.count("over before the kill");
            }
            kills += 1;
        }
        let waiting = Instant::now();
        let status = loop {
            met.look(&bus);
            if let Some(status) = ended_within(&mut child, Duration::from_millis(2)) {
                break status;
            }
            if waiting.elapsed() > HANGS {
                bus.processes().iter().for_each(|process| process.signal(Signal::KILL));
                return Err(format!("{story}hangs"));
            }
        };
        let output = child.wait_with_output().unwrap();
        match (status.code(), status.signal()) {
            (Some(0), _) => break,
            // Interrupted, or ended by a signal: with a core file in the working folder, where the system leaves one.
            (Some(130 | 143), _) | (None, Some(_)) => met.count("continued"),
            _ => {
                let stderr = String::from_utf8_lossy(&output.stderr);
                return Err(format!("{story}ended with {status}: {stderr}"));
            }
        }
    }
    let fail = |what: String| Err(format!("{story}{what}"));
    if let Some(difference) = difference(&out, &setting.expected) {
        return fail(difference);
    }
    if !partial(&out).is_empty() {
        return fail(format!("left {:?}", partial(&out)));
    }
    let mut child = start(&setting.short, &folder.path().join("short"), &bus, &temporary);
    let Some(status) = ended_within(&mut child, HANGS) else {
        bus.processes().iter().for_each(|process| process.signal(Signal::KILL));
        return fail("the short run behind it hangs".to_owned());
    };
    let output = child.wait_with_output().unwrap();
    if !status.success() {
        return fail(format!("the short run behind it: {}", String::from_utf8_lossy(&output.stderr)));
    }
    if let Some(difference) = difference(&folder.path().join("short"), &setting.expected_short) {
        return fail(format!("the short run behind it: {difference}"));
    }
    let left: Vec<PathBuf> = std::fs::read_dir(&temporary)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .filter(|path| !path.file_name().is_some_and(|name| name.to_string_lossy().starts_with("core")))
        .collect();
    if !left.is_empty() {
        return fail(format!("left in the folder for temporary files: {left:?}"));
    }
    if !comes_true(LIMIT, || bus.processes().is_empty()) {
        return fail(format!("left processes: {:?}", bus.processes()));
    }
    if !bus.left().is_empty() {
        let inside: Vec<_> =
            bus.left().iter().flat_map(std::fs::read_dir).flatten().flatten().map(|e| e.path()).collect();
        return fail(format!("left in the folder of the buses: {:?} {inside:?}", bus.left()));
    }
    let left = shared_memory(&met.buses);
    if !left.is_empty() {
        return fail(format!("left in shared memory: {left:?}"));
    }
    Ok(())
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn runs_that_are_killed_at_any_moment_end_like_undisturbed_ones() {
    let number = |name: &str| std::env::var(name).ok().map(|text| text.parse::<usize>().unwrap());
    let rounds = number("PDK_KILLS").unwrap_or(ROUNDS);
    let seed = number("PDK_KILLS_SEED").unwrap_or(1);
    let folder = temp();
    let script = pipeline(folder.path(), SOURCE);
    let short = folder.path().join("short.lua");
    std::fs::write(&short, SHORT).unwrap();
    let mut setting = Setting {
        script,
        expected: BTreeMap::new(),
        short,
        expected_short: BTreeMap::new(),
        length: Duration::ZERO,
    };
    let mut met = Met::default();
    let bus = BusFolder::new();
    for name in ["first", "second", "short"] {
        let whole = folder.path().join("whole").join(name);
        let started = Instant::now();
        let script = if name == "short" { &setting.short } else { &setting.script };
        let mut child = start(script, &whole, &bus, folder.path());
        assert!(
            !wait_for(&mut child, Duration::from_secs(60), &bus, &mut met),
            "the run takes more than a minute"
        );
        let length = started.elapsed();
        let output = child.wait_with_output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        match name {
            "short" => setting.expected_short = files(&whole),
            _ => (setting.length, setting.expected) = (length, files(&whole)),
        }
    }
    assert_eq!(setting.expected.len(), 9 + 5, "{:?}", setting.expected.keys());
    assert!(met.buses.len() >= 2, "the buses of a run are not seen: {:?}", met.buses);
    println!("an undisturbed run takes {} ms; {rounds} rounds with seed {seed}", setting.length.as_millis());

    let mut random = Random::new(seed as u64);
    let mut failures = Vec::new();
    let started = Instant::now();
    for number in 0..rounds {
        if let Err(failure) = round(&setting, &mut random, &mut met) {
            println!("round {number}: {failure}");
            failures.push(format!("round {number}: {failure}"));
        }
    }
    println!("{rounds} rounds in {:.0} s, {} failed", started.elapsed().as_secs_f64(), failures.len());
    met.counts.iter().for_each(|(what, count)| println!("{count:6} {what}"));
    assert!(failures.is_empty(), "{} of {rounds} rounds failed:\n{}", failures.len(), failures.join("\n"));
    let killed: usize =
        met.counts.iter().filter(|(what, _)| what.starts_with("killed: ")).map(|(_, count)| count).sum();
    assert!(killed * 2 > rounds, "only {killed} kills in {rounds} rounds: {:?}", met.counts);
}
