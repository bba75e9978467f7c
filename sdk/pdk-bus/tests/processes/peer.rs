//! This program in another process, as the publisher or the tap, and what the tests of both kinds share.

use std::{
    fs,
    io::{BufRead, BufReader, Write},
    path::{Path, PathBuf},
    process::{Child, ChildStdin, ChildStdout, Command, Stdio},
    time::{Duration, SystemTime},
};

use pdk_bus::{Bus, Message, Stamp, Tap, Topic, run_hash, sweep};

pub const WIDTH: u32 = 64;
pub const HEIGHT: u32 = 48;
pub const SECOND: Duration = Duration::from_secs(1);
pub const SOON: Duration = Duration::from_secs(20);
const ROLE: &str = "PDK_BUS_TEST_ROLE";
const RUN: &str = "PDK_BUS_TEST_RUN";
const OWN_BASE: &str = "PDK_BUS_TEST_OWN_BASE";

/// A run id that no other test or process uses.
pub fn unique(test: &str) -> String {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap();
    format!("test-{test}-{}-{}", std::process::id(), now.as_nanos())
}

/// The byte at `index` of frame `sequence` of a run: differs between runs, frames and places.
pub fn byte(run: &str, sequence: u64, index: usize) -> u8 {
    (run_hash(run) ^ sequence.wrapping_mul(31) ^ (index as u64).wrapping_mul(7)) as u8
}

pub fn fill(run: &str, sequence: u64, frame: &mut [u8]) {
    frame.iter_mut().enumerate().for_each(|(index, value)| *value = byte(run, sequence, index));
}

pub fn is_intact(run: &str, sequence: u64, frame: &[u8]) -> bool {
    frame.len() == (WIDTH * HEIGHT * 3) as usize
        && frame.iter().enumerate().all(|(index, value)| *value == byte(run, sequence, index))
}

pub fn stamp(sequence: u64) -> Stamp {
    Stamp { scenario: 5, sequence, time: sequence as f64 / 30.0 }
}

pub fn publish(bus: &Bus, sequence: u64) {
    let mut loan = bus.loan_frame(Topic::Raw, stamp(sequence)).unwrap();
    fill(bus.run(), sequence, &mut loan);
    let own = loan.publish().unwrap();
    assert!(is_intact(bus.run(), sequence, &own));
}

pub fn frame(tap: &mut Tap, timeout: Duration) -> Option<pdk_bus::FrameSample> {
    match tap.receive(timeout).unwrap() {
        Some(Message::Frame(frame)) => Some(frame),
        None => None,
        other => panic!("not a frame: {other:?}"),
    }
}

/// This program in another process, in the given role. Killed when dropped.
pub struct Peer {
    pub process: Child,
    input: Option<ChildStdin>,
    output: BufReader<ChildStdout>,
}

impl Peer {
    pub fn start(role: &str, run: &str) -> Self {
        Self::start_with(role, run, &[])
    }

    pub fn start_with(role: &str, run: &str, variables: &[(&str, &Path)]) -> Self {
        let mut process = Command::new(std::env::current_exe().unwrap())
            .envs(variables.iter().copied())
            .args(["peer::peer_process", "--exact", "--nocapture", "--test-threads=1"])
            .env(ROLE, role)
            .env(RUN, run)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let input = process.stdin.take();
        let output = BufReader::new(process.stdout.take().unwrap());
        let mut peer = Self { process, input, output };
        peer.expect("ready");
        peer
    }

    /// Sends a command and waits until it is done.
    pub fn command(&mut self, command: &str) {
        let input = self.input.as_mut().unwrap();
        writeln!(input, "{command}").unwrap();
        input.flush().unwrap();
        self.expect("done");
    }

    pub fn expect(&mut self, word: &str) {
        let mut line = String::new();
        loop {
            line.clear();
            assert_ne!(
                self.output.read_line(&mut line).unwrap(),
                0,
                "the other process ended before `{word}`"
            );
            // The test harness of the other process writes to the same pipe, even into the same line.
            if line.trim_end().ends_with(word) {
                return;
            }
        }
    }

    /// Closes the input, on which the process ends by itself.
    pub fn end(mut self) {
        self.input = None;
        self.process.wait().unwrap();
    }

    pub fn kill(mut self) {
        self.process.kill().unwrap();
        self.process.wait().unwrap();
    }
}

impl Drop for Peer {
    fn drop(&mut self) {
        // Both fail where the process has ended already.
        let _ = self.process.kill();
        let _ = self.process.wait();
    }
}

/// Runs the calling test once more in another process with a base of its own, in which the files of other tests
/// do not count; the variable of the base is read from the environment, which a process does not change. Returns
/// the base there, and `None` here: then all is done, and nothing was left.
pub fn own_base(test: &str) -> Option<PathBuf> {
    if let Some(base) = std::env::var_os(OWN_BASE) {
        return Some(base.into());
    }
    let base = PathBuf::from(format!("/dev/shm/{}", unique("base")));
    let output = Command::new(std::env::current_exe().unwrap())
        .args([test, "--exact", "--nocapture", "--test-threads=1"])
        .env(OWN_BASE, &base)
        .env(pdk_bus::BASE_VARIABLE, &base)
        .output()
        .unwrap();
    let text = String::from_utf8_lossy(&output.stdout);
    assert!(
        output.status.success() && text.contains("1 passed"),
        "{text}{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let left: Vec<_> = fs::read_dir(&base).unwrap().flatten().collect();
    assert!(left.is_empty(), "{left:?}");
    fs::remove_dir(base).unwrap();
    None
}

/// The roots below a base, in whatever state.
pub fn roots(base: &Path) -> Vec<PathBuf> {
    let inside =
        |folder: &Path| fs::read_dir(folder).into_iter().flatten().flatten().map(|entry| entry.path());
    inside(base).flat_map(|run| inside(&run).collect::<Vec<_>>()).collect()
}

/// The files in /dev/shm of the bus with this root.
pub fn shared_memory(root: &Path) -> Vec<PathBuf> {
    let name = root.file_name().unwrap().to_str().unwrap();
    let prefix = format!("pdk_{}_", name.split_once('-').unwrap().1);
    let files = fs::read_dir("/dev/shm").unwrap().flatten().map(|entry| entry.path());
    files.filter(|file| file.file_name().unwrap().to_string_lossy().starts_with(&prefix)).collect()
}

/// Not a test by itself: what the other process does.
#[test]
fn peer_process() {
    let (Ok(role), Ok(run)) = (std::env::var(ROLE), std::env::var(RUN)) else { return };
    let mut commands = std::io::stdin().lines().map_while(Result::ok);
    let done = |word: &str| println!("\n{word}");
    match role.as_str() {
        // Each command is the number of frames to publish next.
        "publisher" | "watcher" => {
            let bus = Bus::create(&run, 0, WIDTH, HEIGHT).unwrap();
            let taps = (role == "watcher").then(|| {
                let tap = Tap::open(&run, 0, Topic::Control, SOON).unwrap();
                assert!(!tap.is_over().unwrap());
                assert!(Tap::list().unwrap().iter().any(|found| found.run == run));
                sweep().unwrap();
                // One that is closed again while the bus lives.
                drop(Tap::open(&run, 0, Topic::State, SOON).unwrap());
                tap
            });
            done("ready");
            let mut sequence = 0;
            for command in commands {
                for _ in 0..command.parse::<u64>().unwrap() {
                    publish(&bus, sequence);
                    sequence += 1;
                }
                done("done");
            }
            drop(taps);
        }
        // Takes as many frames as it may hold and keeps them until it is killed.
        "holder" => {
            let mut tap = Tap::open(&run, 0, Topic::Raw, SOON).unwrap();
            done("ready");
            commands.next();
            let held = [frame(&mut tap, SOON).unwrap(), frame(&mut tap, SOON).unwrap()];
            done("done");
            commands.next();
            drop(held);
        }
        "sweeper" => {
            sweep().unwrap();
            done("ready");
            commands.next();
        }
        // Those that are killed on the way.
        "maker" => {
            done("ready");
            let bus = Bus::create(&run, 0, WIDTH, HEIGHT).unwrap();
            for sequence in 0.. {
                publish(&bus, sequence);
            }
        }
        "opener" => {
            done("ready");
            loop {
                let mut tap = Tap::open(&run, 0, Topic::Raw, SOON).unwrap();
                frame(&mut tap, SOON);
            }
        }
        "many" => {
            let buses: Vec<_> = (0..10).map(|slot| Bus::create(&run, slot, WIDTH, HEIGHT).unwrap()).collect();
            done("ready");
            commands.next();
            drop(buses);
        }
        // Ends while one of its threads is inside the bus.
        "stuck" => {
            let bus = Bus::create(&run, 0, WIDTH, HEIGHT).unwrap();
            let root = bus.root().to_owned();
            std::thread::spawn(move || {
                for sequence in 0.. {
                    publish(&bus, sequence);
                }
            });
            done("ready");
            commands.next();
            pdk_bus::remove(&root).unwrap();
            rustix::process::kill_process(rustix::process::getpid(), rustix::process::Signal::KILL).unwrap();
        }
        // Uses a base that is a symbolic link.
        "refused" => {
            let errors = [
                Bus::create(&run, 0, WIDTH, HEIGHT).unwrap_err(),
                Tap::open(&run, 0, Topic::Raw, SOON).unwrap_err(),
                Tap::list().unwrap_err(),
                sweep().unwrap_err(),
                pdk_bus::sweep_run(&run).unwrap_err(),
            ];
            for error in errors {
                assert!(
                    error.message().contains("is a symbolic link: remove it, or name another"),
                    "{error}"
                );
            }
            done("ready");
            commands.next();
        }
        other => panic!("no role {other}"),
    }
}
