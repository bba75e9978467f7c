//! A loop's step on the bus allocates no memory for frames: iceoryx2 0.10 keeps one small counted handle per
//! message on loan, and nothing else is asked of the allocator.

// The helpers of a test may fail like the test itself.
#![allow(clippy::unwrap_used)]

use std::{
    alloc::{GlobalAlloc, Layout, System},
    cell::Cell,
    time::Duration,
};

use pdk_bus::{Bus, Message, Stamp, Tap, Topic};
use pdk_model::{control::Control, state::State};

struct Counting;

thread_local! {
    static COUNT: Cell<usize> = const { Cell::new(0) };
    static BYTES: Cell<usize> = const { Cell::new(0) };
}

// SAFETY: every call goes to the system's allocator unchanged; the counters neither allocate nor have a
// destructor.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        COUNT.set(COUNT.get() + 1);
        BYTES.set(BYTES.get() + layout.size());
        // SAFETY: the caller keeps the contract of `alloc`.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller keeps the contract of `dealloc`, and `pointer` came from `System`.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// How often and how many bytes `work` allocates.
fn allocations(work: impl FnOnce()) -> (usize, usize) {
    let before = (COUNT.get(), BYTES.get());
    work();
    (COUNT.get() - before.0, BYTES.get() - before.1)
}

#[test]
fn a_step_allocates_one_handle_per_message() {
    assert_eq!(allocations(|| drop(std::hint::black_box(Box::new(1_u64)))), (1, 8), "the counter counts");

    let run = format!("test-allocation-{}", std::process::id());
    let bus = Bus::create(&run, 0, 320, 240).unwrap();
    let mut tap = Tap::open(&run, 0, Topic::Perturbed, Duration::from_secs(20)).unwrap();
    let mut step = |sequence| {
        let stamp = Stamp { scenario: 0, sequence, time: 0.0 };
        let mut raw = bus.loan_frame(Topic::Raw, stamp).unwrap();
        raw.fill(1);
        let raw = raw.publish().unwrap();
        let mut perturbed = bus.loan_frame(Topic::Perturbed, stamp).unwrap();
        perturbed.copy_from_slice(&raw);
        drop(perturbed.publish().unwrap());
        bus.publish_control(stamp, Control::default()).unwrap();
        bus.publish_state(stamp, State::default()).unwrap();
        // The tap is the other end of the same step; every third frame waits for the next.
        if sequence % 3 != 0 {
            let received = tap.receive(Duration::ZERO).unwrap();
            assert!(matches!(received, Some(Message::Frame(frame)) if frame[0] == 1));
        }
    };
    // The first step makes the connections to the tap.
    step(1);
    let (count, bytes) = allocations(|| (2..200).for_each(&mut step));
    let messages = 4 * 198;
    assert!(count <= messages, "{count} allocations for {messages} messages");
    assert!(bytes <= 256 * messages, "{bytes} bytes for {messages} messages");
    println!("{} bytes a message", bytes / messages);
}
