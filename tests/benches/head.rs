//! How many scenarios a second the head of a run gives out and records, and what memory it takes, with workers that are not there: a pool that answers
//! each scenario with the outcome of the first one, after the time that the scenario is to take.
//!
//! ```sh
//! cargo build --release && cargo bench --bench head [-- --seconds S]
//! ```
//!
//! There are S scenarios for each slot, or S tenths if they take 10 s; S is 10 if it is not given. First the pool answers at once. Then it has thousands of slots, and a scenario takes half of a mean time to one and a half of it. Ideal is a scenario for each slot
//! in the mean time. The pool shares the processors with the head.

// A benchmark may fail like a test.
#![allow(clippy::unwrap_used)]

use std::cmp::Reverse;
use std::collections::BinaryHeap;
use std::fs;
use std::io::{BufRead, BufReader, Write, stdin, stdout};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::time::{Duration, Instant};

use pdk_tests::{built, temp};
use serde_json::Value;

/// Submits scenarios of two frames, and takes the outcomes as they come, or all together.
const PIPELINE: &str = r#"
local settings = pdk.settings({ count = 1, together = false })
local shared = { simulator = "lane", driver = "lane_keeper", duration = 0.05, images_every = 0 }
local function scenario(number)
	local angles = { 0, number % 30, 10, -20, 15, 0, 5, number // 30 / 1000 }
	return {
		road = { angles = angles, segment = 25 },
		perturbations = { { name = "gaussian_noise", level = number % 5 } },
	}
end
if settings.together then
	shared.scenarios = {}
	for number = 1, settings.count do
		table.insert(shared.scenarios, scenario(number))
	end
	assert(#pdk.drive(shared) == settings.count)
else
	local session = pdk.session(shared)
	for number = 1, settings.count do
		session:submit(scenario(number))
	end
	local taken = 0
	while session:next() do
		taken += 1
	end
	assert(taken == settings.count)
end
"#;

fn main() {
    let arguments: Vec<String> = std::env::args().collect();
    if let Some(place) = arguments.iter().position(|argument| argument == "pool") {
        let numbers: Vec<f64> = arguments[place + 1..].iter().map(|number| number.parse().unwrap()).collect();
        return pool(numbers[0] as u64, numbers[1]);
    }
    let seconds = arguments.iter().position(|argument| argument == "--seconds");
    let seconds: f64 = seconds.map_or(10.0, |place| arguments[place + 1].parse().unwrap());
    println!("the pool answers at once:");
    // A script that holds 100,000 outcomes at the same time needs more memory than scripts may have.
    for (count, together) in [(10_000, false), (10_000, true), (100_000, false)] {
        let (took, memory) = run(count, together, 64, 0.0);
        let how = if together { "one pdk.drive" } else { "session:submit" };
        println!(
            "  {count:6} scenarios by {how:14} {took:5.1} s, {:5.0} a second, {memory:4.0} MB at most",
            f64::from(count) / took
        );
    }
    println!("a scenario takes some time:");
    for (slots, mean) in
        [(1_000, 1.0), (2_000, 1.0), (3_000, 1.0), (4_500, 1.0), (6_000, 1.0), (32_000, 10.0)]
    {
        let count = (f64::from(slots) * seconds / mean) as u32;
        let (took, memory) = run(count, false, slots, mean);
        let rate = f64::from(count) / took;
        println!(
            "  {slots:5} slots, {mean:2} s on average: {count:6} scenarios in {took:5.1} s, {rate:5.0} a second, {:3.0} % of ideal, {memory:4.0} MB at most",
            100.0 * rate * mean / f64::from(slots)
        );
    }
}

/// Runs the pipeline, and returns how many seconds that took and the most memory in MB.
fn run(count: u32, together: bool, slots: u32, mean: f64) -> (f64, f64) {
    let folder = temp();
    let pipeline = folder.path().join("many.lua");
    fs::write(&pipeline, PIPELINE).unwrap();
    let own = std::env::current_exe().unwrap();
    let start = Instant::now();
    let mut head = Command::new(built("pdk"))
        .arg("run")
        .arg(&pipeline)
        .args(["--set", &format!("count={count}"), "--set", &format!("together={together}")])
        .args(["--pool", &format!("{} pool {slots} {mean}", own.display())])
        .arg("--out")
        .arg(folder.path().join("record"))
        .stdout(Stdio::null())
        .spawn()
        .unwrap();
    let mut memory = 0.0;
    let status = loop {
        memory = most_memory(&head).unwrap_or(memory);
        match head.try_wait().unwrap() {
            Some(status) => break status,
            None => std::thread::sleep(Duration::from_millis(20)),
        }
    };
    assert!(status.success(), "{status}");
    (start.elapsed().as_secs_f64(), memory)
}

/// The most memory that a process has had so far, in MB.
fn most_memory(process: &Child) -> Option<f64> {
    let status = fs::read_to_string(format!("/proc/{}/status", process.id())).ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    Some(line.trim().strip_suffix(" kB")?.parse::<f64>().ok()? * 1024.0 / 1e6)
}

/// A pool with this many slots, whose scenarios take half of the mean time to one and a half of it. A worker does all other work, and the first
/// scenario.
fn pool(slots: u64, mean: f64) {
    let mut worker = Command::new(built("pdk"))
        .arg("worker")
        .stdin(Stdio::piped())
        .stdout(Stdio::piped())
        .spawn()
        .unwrap();
    let (mut to, mut from) =
        (worker.stdin.take().unwrap(), BufReader::new(worker.stdout.take().unwrap()).lines());
    let mut lines = stdin().lines().map(Result::unwrap);
    writeln!(to, "{}", lines.next().unwrap()).unwrap();
    let mut ready: Value = serde_json::from_str(&from.next().unwrap().unwrap()).unwrap();
    ready["ready"]["slots"] = slots.into();
    say(&[ready.to_string()]);
    let (jobs, given) = channel::<(Instant, u64, String)>();
    std::thread::spawn(move || {
        let mut due: BinaryHeap<Reverse<(Instant, u64, String)>> = BinaryHeap::new();
        loop {
            let wait = due.peek().map(|Reverse((time, ..))| time.saturating_duration_since(Instant::now()));
            match given.recv_timeout(wait.unwrap_or(Duration::from_secs(1))) {
                Ok(job) => due.push(Reverse(job)),
                Err(RecvTimeoutError::Timeout) => {}
                Err(RecvTimeoutError::Disconnected) => return,
            }
            due.extend(given.try_iter().map(Reverse));
            let mut answers = Vec::new();
            while due.peek().is_some_and(|Reverse((time, ..))| *time <= Instant::now()) {
                answers.extend(due.pop().map(|Reverse((.., answer))| answer));
            }
            say(&answers);
        }
    });
    // What the first scenario came to, around its number.
    let mut sample: Option<(String, String)> = None;
    for line in lines {
        let number = number_of(&line);
        let is_drive = line.contains(r#""work":{"drive""#);
        if let (Some((before, after)), true) = (&sample, is_drive) {
            // The same for the same scenario, and spread evenly.
            let share = 0.5 + (number * 7919 % 1000) as f64 / 1000.0;
            let due = Instant::now() + Duration::from_secs_f64(mean * share);
            jobs.send((due, number, format!("{before}{number}{after}"))).unwrap();
            continue;
        }
        writeln!(to, "{line}").unwrap();
        for answer in from.by_ref().map(Result::unwrap) {
            let done = answer.starts_with(r#"{"done""#);
            if done && is_drive {
                let (before, after) = answer.split_once(&format!(r#""number":{number},"#)).unwrap();
                sample = Some((format!(r#"{before}"number":"#), format!(",{after}")));
            }
            say(&[answer]);
            if done {
                break;
            }
        }
    }
    drop(to);
    worker.wait().unwrap();
}

fn number_of(job: &str) -> u64 {
    let (_, rest) = job.split_once(r#""number":"#).unwrap();
    rest[..rest.find(|c: char| !c.is_ascii_digit()).unwrap()].parse().unwrap()
}

/// Writes lines to the head. If it is gone, the end of the input says so.
fn say(lines: &[String]) {
    if !lines.is_empty() {
        let _ = stdout().lock().write_all((lines.join("\n") + "\n").as_bytes());
    }
}
