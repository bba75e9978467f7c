//! What travels on the topics, and between whom.

use std::{
    fs,
    time::{Duration, Instant},
};

use pdk_bus::{Bus, LATEST, Message, SlotTopics, Tap, Topic, monotonic_nanoseconds, run_hash};
use pdk_model::{control::Control, state::State};

use crate::peer::{HEIGHT, Peer, SECOND, SOON, WIDTH, frame, is_intact, publish, stamp, unique};

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
            assert_eq!((header.slot, header.width, header.height, header.format), (0, WIDTH, HEIGHT, 1));
            let age = monotonic_nanoseconds().checked_sub(header.sent_at).expect("sent in the past");
            assert!(age < SOON.as_nanos() as u64, "{age} ns");
            sequence += 1;
        }
    }
    assert_eq!(tap.lost(), 0);
    assert!(frame(&mut tap, Duration::from_millis(5)).is_none());
    publisher.end();
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

/// How often this thread has given up the processor by itself, as a waiting thread does.
fn sleeps() -> u64 {
    let status = fs::read_to_string("/proc/thread-self/status").unwrap();
    let count = status.lines().find_map(|line| line.strip_prefix("voluntary_ctxt_switches:"));
    count.unwrap().trim().parse().unwrap()
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

    // By how often the thread slept, and not by time, which on a busy machine says nothing: a loop that waits for a tap sleeps for every
    // frame that the tap does not take.
    let slept = sleeps();
    (2..1_000).for_each(|sequence| publish(&bus, sequence));
    let slept = sleeps() - slept;
    assert!(slept < 100, "the loop waited {slept} times for 998 frames");

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
        for slot in 0..8 {
            let bus = movable(Bus::create(&run, slot, WIDTH, HEIGHT).unwrap());
            let run = &run;
            scope.spawn(move || {
                (0..50).for_each(|sequence| publish(&bus, sequence));
                drop(bus);
                for _ in 0..10 {
                    let bus = Bus::create(run, slot, WIDTH, HEIGHT).unwrap();
                    let mut tap = Tap::open(run, slot, Topic::Raw, SOON).unwrap();
                    publish(&bus, 1);
                    assert_eq!(frame(&mut tap, SOON).expect("a frame").header().slot, slot);
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
    publisher.end();
}

#[test]
fn control_and_state_arrive_with_the_stamp_of_their_frame() {
    let run = unique("control");
    let bus = Bus::create(&run, 2, WIDTH, HEIGHT).unwrap();
    let mut control = Tap::open(&run, 2, Topic::Control, SOON).unwrap();
    let mut state = Tap::open(&run, 2, Topic::State, SOON).unwrap();
    let answer = Control { steering: -0.25, throttle: 0.5 };
    let seen = State {
        position: [1.0, 2.0, 3.0],
        speed: 8.5,
        lane_departure: true,
        finished: true,
        ..Default::default()
    };
    bus.publish_control(stamp(7), answer).unwrap();
    bus.publish_state(stamp(8), seen).unwrap();
    match control.receive(SOON).unwrap() {
        Some(Message::Control(header, message)) => {
            assert_eq!((header.sequence, header.slot, message), (7, 2, answer));
        }
        other => panic!("{other:?}"),
    }
    match state.receive(SOON).unwrap() {
        Some(Message::State(header, message)) => assert_eq!((header.sequence, message), (8, seen)),
        other => panic!("{other:?}"),
    }
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
    let slots_of = |run: &str| found.iter().find(|found| found.run == run).unwrap().slots.clone();
    let here = std::process::id();
    let expected: Vec<_> = buses
        .iter()
        .map(|bus| SlotTopics { slot: bus.slot(), process: here, root: bus.root().to_owned() })
        .collect();
    assert_eq!(slots_of(&run), expected);
    assert_eq!(slots_of(&other).len(), 1);
    assert_eq!(slots_of(&other)[0].process, publisher.process.id());

    for sequence in 0..50 {
        buses.iter().for_each(|bus| publish(bus, sequence));
        publisher.command("1");
        for (index, (tap, run)) in taps.iter_mut().zip([&run, &run, &other]).enumerate() {
            let got = frame(tap, SOON).expect("a frame");
            assert!(is_intact(run, sequence, &got));
            assert_eq!(got.header().slot, u32::from(index == 1));
            drop(got);
            assert!(frame(tap, Duration::ZERO).is_none(), "a frame too many");
        }
    }
    publisher.end();
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

    // A slot without other users makes the answer of `latest` certain.
    let slot = std::process::id() + 1_000_000;
    let _older = Bus::create(&unique("older"), slot, WIDTH, HEIGHT).unwrap();
    let newer = Bus::create(&unique("newer"), slot, WIDTH, HEIGHT).unwrap();
    let tap = Tap::open(LATEST, slot, Topic::Perturbed, SOON).unwrap();
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

#[test]
fn a_loan_is_not_sent_before_it_is_published() {
    let run = unique("loan");
    let bus = Bus::create(&run, 0, WIDTH, HEIGHT).unwrap();
    let mut tap = Tap::open(&run, 0, Topic::Raw, SOON).unwrap();
    for sequence in 0..100 {
        let loan = bus.loan_frame(Topic::Raw, stamp(sequence)).unwrap();
        assert_eq!(loan.len(), (WIDTH * HEIGHT * 3) as usize);
        drop(loan);
        publish(&bus, sequence);
        assert_eq!(frame(&mut tap, SOON).expect("a frame").header().number, sequence);
        assert!(frame(&mut tap, Duration::ZERO).is_none());
    }
    let error = bus.loan_frame(Topic::Control, stamp(0)).unwrap_err();
    assert_eq!(error.message(), "topic `control` has no frames: use raw or perturbed");
}

#[test]
fn a_slot_has_one_publisher_at_a_time() {
    let run = unique("taken");
    let bus = Bus::create(&run, 0, WIDTH, HEIGHT).unwrap();
    let tap = Tap::open(&run, 0, Topic::Raw, SOON).unwrap();
    let error = Bus::create(&run, 0, WIDTH, HEIGHT).unwrap_err();
    assert!(error.message().contains("at this moment: give this run another id"), "{error}");
    assert!(!tap.is_over().unwrap());
    drop(bus);
    assert!(tap.is_over().unwrap());
    Bus::create(&run, 0, WIDTH, HEIGHT).unwrap();
}

#[test]
fn a_tap_goes_over_to_the_next_loop_in_its_slot() {
    let run = unique("next");
    let bus = Bus::create(&run, 0, WIDTH, HEIGHT).unwrap();
    let other_slot = Bus::create(&run, 1, WIDTH, HEIGHT).unwrap();
    let mut tap = Tap::open(&run, 0, Topic::Raw, SOON).unwrap();
    (0..3).for_each(|sequence| publish(&bus, sequence));
    drop(bus);
    assert!(tap.is_over().unwrap());

    let next = Bus::create(&run, 0, 2 * WIDTH, HEIGHT).unwrap();
    assert!(!tap.is_over().unwrap());
    // First what the old loop has sent.
    for sequence in 0..3 {
        assert!(is_intact(&run, sequence, &frame(&mut tap, SOON).expect("a frame")));
    }
    let deadline = Instant::now() + SOON;
    let seen = loop {
        publish(&other_slot, 0);
        drop(next.loan_frame(Topic::Raw, stamp(100)).unwrap().publish().unwrap());
        if let Some(seen) = frame(&mut tap, Duration::from_millis(5)) {
            break seen;
        }
        assert!(Instant::now() < deadline, "the tap does not find the next loop");
    };
    assert_eq!((seen.header().sequence, seen.header().width, seen.len()), (100, 2 * WIDTH, 2 * 64 * 48 * 3));
    assert_eq!(tap.lost(), 0);
    drop(next);
    assert!(tap.is_over().unwrap());
}
