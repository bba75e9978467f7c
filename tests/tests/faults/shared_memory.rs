//! Another program writes nonsense into the shared memory of a run, again and again: it costs scenarios, and never the run.
//!
//! `PDK_DAMAGE` sets how many damages are done, and `PDK_DAMAGE_SEED` where their bytes are drawn from.

use std::fs::{File, OpenOptions};
use std::io::{Seek, SeekFrom, Write};
use std::os::unix::process::ExitStatusExt;
use std::path::Path;
use std::time::{Duration, Instant};

use pdk_tests::process::{LIMIT, json_lines, pipeline};
use pdk_tests::processes::{BusFolder, comes_true, ended_within, shared_memory};
use pdk_tests::random::Random;
use pdk_tests::records::wait_for_scenarios;
use pdk_tests::{Pdk, temp};

/// Scenarios of a run.
const SCENARIOS: usize = 24;
/// The most damages in a run. On a busy machine more would come before its scenarios get anywhere.
const MOST_DAMAGES: usize = 500;
/// Between one damage and the next.
const PAUSE: Duration = Duration::from_millis(15);
/// The default number of damages. A run lasts for some tens of them, or for fewer on a quick machine, which then needs more runs.
const DAMAGES: usize = 40;
/// More runs than this are not needed even if each is damaged only once.
const MOST_ROUNDS: usize = 2 * DAMAGES;

const SOURCE: &str = r#"
    local scenarios = {}
    for number = 1, pdk.settings({ scenarios = 24 }).scenarios do
        scenarios[number] = { seed = number, road = { angles = { 0, 5, -5 }, segment = 15 } }
    end
    pdk.drive({
        simulator = { name = "lane", width = 64, height = 48 }, driver = "lane_keeper", duration = 2, images_every = 0,
        scenarios = scenarios,
    })
"#;

/// Overwrites some places of a file, or cuts it off; false if it is gone meanwhile.
fn damage(path: &Path, random: &mut Random) -> bool {
    let try_it = |random: &mut Random| -> std::io::Result<()> {
        let mut file: File = OpenOptions::new().write(true).open(path)?;
        let size = file.metadata()?.len();
        if random.below(4) == 0 {
            return file.set_len(random.below(size as usize + 1) as u64);
        }
        for _ in 0..=random.below(40) {
            file.seek(SeekFrom::Start(random.below(size.max(1) as usize) as u64))?;
            let ones = random.below(3) == 0;
            let bytes: Vec<u8> =
                (0..=random.below(64)).map(|_| if ones { 0xff } else { random.below(256) as u8 }).collect();
            file.write_all(&bytes)?;
        }
        Ok(())
    };
    try_it(random).is_ok()
}

#[test]
fn nonsense_in_shared_memory_costs_scenarios_and_never_the_run() {
    let number = |name: &str| std::env::var(name).ok().map(|text| text.parse::<usize>().unwrap());
    let wanted = number("PDK_DAMAGE").unwrap_or(DAMAGES);
    let mut random = Random::new(number("PDK_DAMAGE_SEED").unwrap_or(1) as u64);
    let folder = temp();
    let script = pipeline(folder.path(), SOURCE);
    let run = |out: &Path, bus: &BusFolder| {
        let (variable, value) = bus.variable();
        Pdk::new(["run", "--workers", "2", "--out"]).arg(out).arg(&script).env(variable, value)
    };
    let (mut round, mut done) = (0, 0);
    while round < 2 || done < wanted {
        assert!(round < MOST_ROUNDS.max(wanted), "only {done} damages in {round} runs");
        let bus = BusFolder::new();
        let out = folder.path().join(format!("damaged-{round}"));
        let mut child = run(&out, &bus).spawn();
        let (started, mut damages, mut buses) = (Instant::now(), 0, bus.buses());
        while child.try_wait().unwrap().is_none() {
            assert!(started.elapsed() < LIMIT, "round {round}: the run hangs after {damages} damages");
            buses.extend(bus.buses());
            let files = bus.files();
            if !files.is_empty() && damages < MOST_DAMAGES {
                damages += usize::from(damage(&files[random.below(files.len())], &mut random));
            }
            std::thread::sleep(PAUSE);
        }
        let status = ended_within(&mut child, LIMIT).unwrap();
        let output = child.wait_with_output().unwrap();
        let said = String::from_utf8_lossy(&output.stderr);
        // 1 where scenarios were lost.
        assert!(
            matches!(status.code(), Some(0 | 1)),
            "round {round}: {status:?} {:?}: {said}",
            status.signal()
        );
        let lines = json_lines(&out.join("scenarios.jsonl"));
        assert_eq!(lines.len(), SCENARIOS, "round {round}: {said}");
        let lost = lines.iter().filter(|line| line["cause"] == "error").count();
        println!("round {round}: {damages} damages, {lost} of {SCENARIOS} scenarios lost");
        // The next run is its own.
        let behind = folder.path().join(format!("behind-{round}"));
        run(&behind, &bus).set("scenarios", 2).succeed();
        assert!(json_lines(&behind.join("scenarios.jsonl")).iter().all(|line| line["cause"] != "error"));
        assert!(comes_true(LIMIT, || bus.processes().is_empty()), "{:?}", bus.processes());
        assert!(bus.left().is_empty(), "round {round}: left {:?}", bus.left());
        assert!(shared_memory(&buses).is_empty(), "round {round}: left {:?}", shared_memory(&buses));
        (round, done) = (round + 1, done + damages);
    }
}

#[test]
fn a_folder_of_topics_that_is_removed_costs_no_scenario() {
    let (folder, bus) = (temp(), BusFolder::new());
    let out = folder.path().join("out");
    let (variable, value) = bus.variable();
    let mut child = Pdk::new(["run", "--workers", "1", "--out"])
        .arg(&out)
        .arg(pipeline(folder.path(), SOURCE))
        .set("scenarios", 200)
        .env(variable, value)
        .spawn();
    wait_for_scenarios(&mut child, &out, 1);
    let buses = bus.buses();
    for run in std::fs::read_dir(bus.path()).unwrap() {
        std::fs::remove_dir_all(run.unwrap().path()).unwrap();
    }
    let status = ended_within(&mut child, LIMIT).unwrap();
    // Without the folder no one knows whose these files are.
    shared_memory(&buses).iter().for_each(|file| _ = std::fs::remove_file(file));
    let output = child.wait_with_output().unwrap();
    assert_eq!(status.code(), Some(0), "{}", String::from_utf8_lossy(&output.stderr));
    let lines = json_lines(&out.join("scenarios.jsonl"));
    assert_eq!(lines.iter().filter(|line| line["cause"] != "error").count(), 200);
}
