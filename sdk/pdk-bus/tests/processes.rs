//! Topics between processes: this test program starts itself again as the publisher or the tap.

// The helpers of a test may fail like the test itself.
#![allow(clippy::unwrap_used)]

use std::{
    fs,
    io::{BufRead, BufReader, Write},
    process::{Child, ChildStdin, ChildStdout, Command, Stdio},
    time::{Duration, Instant, SystemTime},
};

use pdk_bus::{
    Bus, ControlMessage, LATEST, Message, Stamp, StateMessage, Tap, Topic, cleanup_dead,
    monotonic_nanoseconds, run_hash,
};

const WIDTH: u32 = 64;
const HEIGHT: u32 = 48;
const SECOND: Duration = Duration::from_secs(1);
const SOON: Duration = Duration::from_secs(20);
const ROLE: &str = "PDK_BUS_TEST_ROLE";
const RUN: &str = "PDK_BUS_TEST_RUN";

/// A run id that no other test or process uses.
fn unique(test: &str) -> String {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH).unwrap();
    format!("test-{test}-{}-{}", std::process::id(), now.as_nanos())
}

/// The byte at `index` of frame `sequence` of a run: differs between runs, frames and places.
fn byte(run: &str, sequence: u64, index: usize) -> u8 {
    (run_hash(run) ^ sequence.wrapping_mul(31) ^ (index as u64).wrapping_mul(7)) as u8
}

fn fill(run: &str, sequence: u64, frame: &mut [u8]) {
    frame.iter_mut().enumerate().for_each(|(index, value)| *value = byte(run, sequence, index));
}

fn is_intact(run: &str, sequence: u64, frame: &[u8]) -> bool {
    frame.len() == (WIDTH * HEIGHT * 3) as usize
        && frame.iter().enumerate().all(|(index, value)| *value == byte(run, sequence, index))
}

fn stamp(sequence: u64) -> Stamp {
    Stamp { scenario: 5, sequence, time: sequence as f64 / 30.0 }
}

fn publish(bus: &Bus, sequence: u64) {
    let mut loan = bus.loan_frame(Topic::Raw, stamp(sequence)).unwrap();
    fill(bus.run(), sequence, &mut loan);
    let own = loan.publish().unwrap();
    assert!(is_intact(bus.run(), sequence, &own));
}

fn frame(tap: &mut Tap, timeout: Duration) -> Option<pdk_bus::FrameSample> {
    match tap.receive(timeout).unwrap() {
        Some(Message::Frame(frame)) => Some(frame),
        None => None,
        other => panic!("not a frame: {other:?}"),
    }
}

/// This program in another process, in the given role. Killed when dropped.
struct Peer {
    process: Child,
    input: ChildStdin,
    output: BufReader<ChildStdout>,
}

impl Peer {
    fn start(role: &str, run: &str) -> Self {
        let mut process = Command::new(std::env::current_exe().unwrap())
            .args(["peer_process", "--exact", "--nocapture", "--test-threads=1"])
            .env(ROLE, role)
            .env(RUN, run)
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()
            .unwrap();
        let input = process.stdin.take().unwrap();
        let output = BufReader::new(process.stdout.take().unwrap());
        let mut peer = Self { process, input, output };
        peer.expect("ready");
        peer
    }

    /// Sends a command and waits until it is done.
    fn command(&mut self, command: &str) {
        writeln!(self.input, "{command}").unwrap();
        self.input.flush().unwrap();
        self.expect("done");
    }

    fn expect(&mut self, word: &str) {
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

    fn kill(mut self) {
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
                cleanup_dead().unwrap();
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
        "cleaner" => {
            cleanup_dead().unwrap();
            done("ready");
            commands.next();
        }
        other => panic!("no role {other}"),
    }
}

#[test]
fn a_tap_in_another_process_gets_every_byte() {
    let run = unique("content");
    let mut publisher = Peer::start("publisher", &run);
    let mut tap = Tap::open(&run, 0, Topic::Raw, SOON).unwrap();
    let mut sequence = 0;
    for _ in 0..20 {
        publisher.command("4");
        for _ in 0..4 {
            let frame = frame(&mut tap, SOON).expect("a frame");
            let header = frame.header();
            assert!(is_intact(&run, sequence, &frame), "frame {sequence}");
            assert_eq!((header.run, header.scenario, header.sequence), (run_hash(&run), 5, sequence));
            assert_eq!((header.number, header.time), (sequence, sequence as f64 / 30.0));
            assert_eq!((header.lane, header.width, header.height, header.format), (0, WIDTH, HEIGHT, 1));
            let age = monotonic_nanoseconds().checked_sub(header.sent_at).expect("sent in the past");
            assert!(age < SOON.as_nanos() as u64, "{age} ns");
            sequence += 1;
        }
    }
    assert_eq!(tap.lost(), 0);
    assert!(frame(&mut tap, Duration::from_millis(5)).is_none());
}

#[test]
fn a_tap_may_start_before_its_run() {
    let run = unique("early");
    let wanted = run.clone();
    let waiting = std::thread::spawn(move || {
        let mut tap = Tap::open(&wanted, 0, Topic::Raw, SOON).unwrap();
        let frame = frame(&mut tap, SOON).expect("a frame");
        frame.header().run
    });
    std::thread::sleep(Duration::from_millis(100));
    let bus = Bus::create(&run, 0, WIDTH, HEIGHT).unwrap();
    let deadline = Instant::now() + SOON;
    while !waiting.is_finished() && Instant::now() < deadline {
        publish(&bus, 0);
        std::thread::sleep(Duration::from_millis(5));
    }
    assert_eq!(waiting.join().unwrap(), run_hash(&run));
}

#[test]
fn a_slow_tap_loses_the_oldest_frames_and_never_blocks_the_loop() {
    let run = unique("slow");
    let bus = Bus::create(&run, 0, WIDTH, HEIGHT).unwrap();
    let mut holder = Peer::start("holder", &run);
    let mut tap = Tap::open(&run, 0, Topic::Raw, SOON).unwrap();
    publish(&bus, 0);
    publish(&bus, 1);
    holder.command("hold");
    let held = frame(&mut tap, SOON).expect("a frame");

    let start = Instant::now();
    (2..1_000).for_each(|sequence| publish(&bus, sequence));
    assert!(start.elapsed() < 10 * SECOND, "{:?}", start.elapsed());

    // What was held is still what it was, and the queue holds the newest eight.
    assert!(is_intact(&run, 0, &held));
    drop(held);
    let mut kept = Vec::new();
    while let Some(frame) = frame(&mut tap, Duration::ZERO) {
        assert!(is_intact(&run, frame.header().sequence, &frame));
        kept.push(frame.header().sequence);
    }
    assert_eq!(kept, (992..1_000).collect::<Vec<_>>());
    assert_eq!(tap.lost(), 991);
}

#[test]
fn every_tap_may_hold_its_frames_at_the_same_time() {
    let run = unique("holders");
    let bus = Bus::create(&run, 0, WIDTH, HEIGHT).unwrap();
    let mut taps: Vec<_> = (0..7).map(|_| Tap::open(&run, 0, Topic::Raw, SOON).unwrap()).collect();
    let error = Tap::open(&run, 0, Topic::Raw, SECOND).unwrap_err();
    assert!(error.message().contains("end another tap"), "{error}");

    // Every tap takes frames that no other holds, then lets its queue overflow.
    let mut held = Vec::new();
    let mut sequence = 0;
    for tap in &mut taps {
        for _ in 0..2 {
            for _ in 0..20 {
                publish(&bus, sequence);
                sequence += 1;
            }
            held.push(frame(tap, SOON).expect("a frame"));
        }
    }
    // Two loans and two own frames more is what the loop is promised.
    let own = bus.loan_frame(Topic::Raw, stamp(0)).unwrap().publish().unwrap();
    let loans =
        [bus.loan_frame(Topic::Raw, stamp(1)).unwrap(), bus.loan_frame(Topic::Raw, stamp(2)).unwrap()];
    drop((own, loans));
    (sequence..sequence + 100).for_each(|sequence| publish(&bus, sequence));
    assert!(held.iter().all(|frame| is_intact(&run, frame.header().sequence, frame)));
    let error = (0..3).find_map(|_| taps[0].receive(SECOND).err()).expect("a third frame is refused");
    assert!(error.message().contains("drop the frames received before"), "{error}");
}

#[test]
fn a_loan_is_clean_and_is_not_sent_before_it_is_published() {
    let run = unique("loan");
    let bus = Bus::create(&run, 0, WIDTH, HEIGHT).unwrap();
    let mut tap = Tap::open(&run, 0, Topic::Raw, SOON).unwrap();
    for sequence in 0..100 {
        let loan = bus.loan_frame(Topic::Raw, stamp(sequence)).unwrap();
        assert_eq!(loan.len(), (WIDTH * HEIGHT * 3) as usize);
        assert!(loan.iter().all(|value| *value == 0), "frame {sequence} shows an earlier one");
        drop(loan);
        publish(&bus, sequence);
        assert_eq!(frame(&mut tap, SOON).expect("a frame").header().number, sequence);
        assert!(frame(&mut tap, Duration::ZERO).is_none());
    }
    let error = bus.loan_frame(Topic::Control, stamp(0)).unwrap_err();
    assert_eq!(error.message(), "topic `control` has no frames: use raw or perturbed");
}

#[test]
fn a_loop_may_hold_two_of_its_frames() {
    let run = unique("held");
    let bus = Bus::create(&run, 0, WIDTH, HEIGHT).unwrap();
    let send = |sequence| bus.loan_frame(Topic::Perturbed, stamp(sequence)).unwrap().publish();
    let held = [send(0).unwrap(), send(1).unwrap()];
    let error = send(2).unwrap_err();
    assert!(error.message().contains("drop earlier frames"), "{error}");
    drop(held);
    assert_eq!(send(3).unwrap().header().sequence, 3);
}

#[test]
fn loops_start_and_end_on_many_threads_at_once() {
    fn movable<T: Send>(value: T) -> T {
        value
    }
    let run = unique("threads");
    std::thread::scope(|scope| {
        for lane in 0..8 {
            let bus = movable(Bus::create(&run, lane, WIDTH, HEIGHT).unwrap());
            let run = &run;
            scope.spawn(move || {
                (0..50).for_each(|sequence| publish(&bus, sequence));
                drop(bus);
                for _ in 0..10 {
                    let bus = Bus::create(run, lane, WIDTH, HEIGHT).unwrap();
                    let mut tap = Tap::open(run, lane, Topic::Raw, SOON).unwrap();
                    publish(&bus, 1);
                    assert_eq!(frame(&mut tap, SOON).expect("a frame").header().lane, lane);
                }
            });
        }
    });
}

#[test]
fn signals_keep_their_default_meaning() {
    let publisher = Peer::start("publisher", &unique("signals"));
    let status = fs::read_to_string(format!("/proc/{}/status", publisher.process.id())).unwrap();
    let caught = status.lines().find_map(|line| line.strip_prefix("SigCgt:")).unwrap();
    let caught = u64::from_str_radix(caught.trim(), 16).unwrap();
    for (signal, name) in [(1, "SIGHUP"), (2, "SIGINT"), (15, "SIGTERM")] {
        assert_eq!(caught >> (signal - 1) & 1, 0, "{name} is caught");
    }
}

#[test]
fn control_and_state_arrive_with_the_stamp_of_their_frame() {
    let run = unique("control");
    let bus = Bus::create(&run, 2, WIDTH, HEIGHT).unwrap();
    let mut control = Tap::open(&run, 2, Topic::Control, SOON).unwrap();
    let mut state = Tap::open(&run, 2, Topic::State, SOON).unwrap();
    let answer = ControlMessage { steering: -0.25, throttle: 0.5 };
    let seen = StateMessage {
        position: [1.0, 2.0, 3.0],
        speed: 8.5,
        flags: StateMessage::LANE_DEPARTURE | StateMessage::FINISHED,
        ..Default::default()
    };
    bus.publish_control(stamp(7), answer).unwrap();
    bus.publish_state(stamp(8), seen).unwrap();
    match control.receive(SOON).unwrap() {
        Some(Message::Control(header, message)) => {
            assert_eq!((header.sequence, header.lane, message), (7, 2, answer));
        }
        other => panic!("{other:?}"),
    }
    match state.receive(SOON).unwrap() {
        Some(Message::State(header, message)) => assert_eq!((header.sequence, message), (8, seen)),
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_killed_publisher_leaves_nothing_in_the_way_of_the_next() {
    let run = unique("killed");
    for round in 0..3 {
        let mut publisher = Peer::start("publisher", &run);
        let mut tap = Tap::open(&run, 0, Topic::Raw, SOON).unwrap();
        publisher.command("5");
        assert!(!tap.is_over().unwrap());
        assert!(Tap::list().unwrap().iter().any(|found| found.run == run && found.lanes == [0]));
        publisher.kill();

        assert!(tap.is_over().unwrap(), "round {round}");
        assert!(Tap::list().unwrap().iter().all(|found| found.run != run));
        // The frames that were on their way are still readable.
        for sequence in 0..5 {
            assert!(is_intact(&run, sequence, &frame(&mut tap, SECOND).expect("a frame")), "round {round}");
        }
        // In two rounds the tap is gone when the next publisher comes, in one it lives on.
        if round == 1 {
            let mut next = Peer::start("publisher", &run);
            next.command("1");
            assert!(is_intact(&run, 0, &frame(&mut tap, SOON).expect("a frame of the next publisher")));
            assert_eq!(tap.lost(), 0);
            next.kill();
        }
    }
    cleanup_dead().unwrap();
}

#[test]
fn killed_taps_do_not_wear_the_loop_down() {
    let run = unique("taps");
    let bus = Bus::create(&run, 0, WIDTH, HEIGHT).unwrap();
    let mut sequence = 0;
    let mut publish_some = |count: u64| {
        (0..count).for_each(|_| {
            publish(&bus, sequence);
            sequence += 1;
        });
    };
    // More than there are places for taps, each killed while it holds frames.
    for _ in 0..12 {
        let mut holder = Peer::start("holder", &run);
        publish_some(3);
        holder.command("hold");
        publish_some(30);
        holder.kill();
        publish_some(30);
    }
    let mut tap = Tap::open(&run, 0, Topic::Raw, SOON).unwrap();
    publish_some(1);
    assert!(frame(&mut tap, SOON).is_some());
}

#[test]
fn runs_side_by_side_do_not_see_each_other() {
    let run = unique("one");
    let buses = [Bus::create(&run, 0, WIDTH, HEIGHT).unwrap(), Bus::create(&run, 1, WIDTH, HEIGHT).unwrap()];
    let other = unique("two");
    let mut publisher = Peer::start("publisher", &other);
    let mut taps = [
        Tap::open(&run, 0, Topic::Raw, SOON).unwrap(),
        Tap::open(&run, 1, Topic::Raw, SOON).unwrap(),
        Tap::open(&other, 0, Topic::Raw, SOON).unwrap(),
    ];
    let found = Tap::list().unwrap();
    assert_eq!(found.iter().find(|found| found.run == run).unwrap().lanes, [0, 1]);
    assert_eq!(found.iter().find(|found| found.run == run).unwrap().process, std::process::id());
    assert_ne!(found.iter().find(|found| found.run == other).unwrap().process, std::process::id());

    for sequence in 0..50 {
        buses.iter().for_each(|bus| publish(bus, sequence));
        publisher.command("1");
        for (index, (tap, run)) in taps.iter_mut().zip([&run, &run, &other]).enumerate() {
            let got = frame(tap, SOON).expect("a frame");
            assert!(is_intact(run, sequence, &got));
            assert_eq!(got.header().lane, u32::from(index == 1));
            drop(got);
            assert!(frame(tap, Duration::ZERO).is_none(), "a frame too many");
        }
    }
}

#[test]
fn a_lane_has_one_publisher_at_a_time() {
    let run = unique("taken");
    let bus = Bus::create(&run, 0, WIDTH, HEIGHT).unwrap();
    let tap = Tap::open(&run, 0, Topic::Raw, SOON).unwrap();
    let error = Bus::create(&run, 0, WIDTH, HEIGHT).unwrap_err();
    assert!(error.message().contains("another loop publishes it at this moment"), "{error}");
    assert!(!tap.is_over().unwrap());
    drop(bus);
    assert!(tap.is_over().unwrap());
    Bus::create(&run, 0, WIDTH, HEIGHT).unwrap();
}

#[test]
fn cleaning_up_spares_the_living() {
    let run = unique("living");
    // It has looked at itself, which must not make it look dead to others: a process loses its lock on a file
    // as soon as it closes that file once more.
    let mut watcher = Peer::start("watcher", &run);
    let files = shared_memory(&watcher.process.id().to_string());
    assert!(files.len() >= 8, "{files:?}");
    for _ in 0..3 {
        cleanup_dead().unwrap();
        drop(Peer::start("cleaner", &run));
    }
    assert!(files.iter().all(|file| fs::exists(file).unwrap()), "{files:?}");
    assert!(Tap::list().unwrap().iter().any(|found| found.run == run));
    let mut tap = Tap::open(&run, 0, Topic::Raw, SOON).unwrap();
    watcher.command("1");
    assert!(is_intact(&run, 0, &frame(&mut tap, SOON).expect("a frame")));
}

#[test]
fn the_latest_run_is_the_one_that_started_last() {
    // Other tests start runs at the same time, so only the order of ours is certain.
    let first = Bus::create(&unique("first"), 0, WIDTH, HEIGHT).unwrap();
    let second = Bus::create(&unique("second"), 0, WIDTH, HEIGHT).unwrap();
    let runs = Tap::list().unwrap();
    let place = |bus: &Bus| runs.iter().position(|found| found.run == bus.run()).unwrap();
    assert!(place(&second) < place(&first));
    assert!(runs.windows(2).all(|pair| pair[0].started >= pair[1].started));

    // A lane that nobody else uses makes the answer of `latest` certain.
    let lane = std::process::id() + 1_000_000;
    let _older = Bus::create(&unique("older"), lane, WIDTH, HEIGHT).unwrap();
    let newer = Bus::create(&unique("newer"), lane, WIDTH, HEIGHT).unwrap();
    let tap = Tap::open(LATEST, lane, Topic::Perturbed, SOON).unwrap();
    assert_eq!(tap.run(), newer.run());
}

#[test]
fn a_run_that_never_appears_is_named() {
    let run = unique("absent");
    let error = Tap::open(&run, 0, Topic::Raw, Duration::from_millis(30)).unwrap_err();
    assert!(error.message().contains(&run) && error.message().contains("start the run"), "{error}");
    for (width, height) in [(0, 1), (1, 0), (u32::MAX, u32::MAX)] {
        let error = Bus::create(&run, 0, width, height).unwrap_err();
        assert!(error.message().contains("cannot be the size of a frame"), "{error}");
    }
    let error = Bus::create(&run, 0, 18_000, 18_000).unwrap_err();
    assert!(error.message().contains("of shared memory"), "{error}");
}

/// The shared memory that a process has mapped, except the counter that all processes share for good.
fn shared_memory(process: &str) -> Vec<String> {
    let maps = fs::read_to_string(format!("/proc/{process}/maps")).unwrap();
    let mut files: Vec<_> = maps
        .lines()
        .filter_map(|line| line.find("/dev/shm/").map(|start| line[start..].to_owned()))
        .filter(|file| !file.ends_with(".global_mgmt"))
        .collect();
    files.dedup();
    files
}

#[test]
fn a_killed_publisher_is_cleaned_up_to_the_last_file() {
    let run = unique("corpse");
    let mut publisher = Peer::start("publisher", &run);
    publisher.command("5");
    let files = shared_memory(&publisher.process.id().to_string());
    assert!(files.len() >= 8, "{files:?}");
    publisher.kill();

    // Another test's process may have begun the same work; then it is done shortly after.
    let deadline = Instant::now() + SOON;
    loop {
        cleanup_dead().unwrap();
        let left: Vec<_> = files.iter().filter(|file| fs::exists(file).unwrap()).collect();
        if left.is_empty() {
            break;
        }
        assert!(Instant::now() < deadline, "{left:?}");
        std::thread::sleep(Duration::from_millis(10));
    }
}

#[test]
fn ended_runs_leave_no_files() {
    // In a folder of its own, so that the files of other tests do not count. The folder is read from the
    // environment once per process, so another process does it.
    let folder = format!("/tmp/{}/", unique("files"));
    let output = Command::new(std::env::current_exe().unwrap())
        .args(["short_runs", "--exact", "--nocapture", "--test-threads=1"])
        .env(pdk_bus::ROOT_VARIABLE, &folder)
        .env(ROLE, "short")
        .env(RUN, unique("files"))
        .output()
        .unwrap();
    assert!(output.status.success(), "{output:?}");

    let used = String::from_utf8(output.stdout).unwrap();
    let used: Vec<_> = used.lines().filter(|line| line.starts_with("/dev/shm/")).collect();
    assert!(used.len() >= 50 * 8, "{used:?}");
    let left: Vec<_> = used.iter().filter(|file| fs::exists(file).unwrap()).collect();
    assert!(left.is_empty(), "{left:?}");

    for part in ["nodes", "services"] {
        let left: Vec<_> = fs::read_dir(format!("{folder}{part}")).unwrap().flatten().collect();
        assert!(left.is_empty(), "{left:?}");
    }
    fs::remove_dir_all(folder).unwrap();
}

/// Not a test by itself: many short runs in a process of their own.
#[test]
fn short_runs() {
    if std::env::var(ROLE).as_deref() != Ok("short") {
        return;
    }
    let run = std::env::var(RUN).unwrap();
    for round in 0..50 {
        let bus = Bus::create(&format!("{run}-{round}"), 0, WIDTH, HEIGHT).unwrap();
        let mut tap = Tap::open(bus.run(), 0, Topic::Raw, SOON).unwrap();
        publish(&bus, 0);
        assert!(frame(&mut tap, SOON).is_some());
        println!();
        shared_memory("self").iter().for_each(|file| println!("{file}"));
    }
}
