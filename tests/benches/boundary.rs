//! What a call across the boundary between pdk and a plugin costs, in nanoseconds, with components that do next to nothing:
//!
//! ```sh
//! cargo build --release && cargo bench --bench boundary
//! ```

// A benchmark may fail like a test.
#![allow(clippy::unwrap_used)]

use std::hint::black_box;
use std::time::Instant;

use pdk_components::search_path::SearchPath;
use pdk_sdk::prelude::*;
use pdk_tests::test_library;
use serde_json::Map;

/// Calls in a row, and how often they are timed.
const CALLS: u64 = 10_000;
const ROUNDS: usize = 200;

/// Nanoseconds of a call: the median over rounds.
fn nanoseconds(mut call: impl FnMut(u64)) -> f64 {
    let mut rounds: Vec<f64> = (0..ROUNDS)
        .map(|_| {
            let began = Instant::now();
            (0..CALLS).for_each(&mut call);
            began.elapsed().as_nanos() as f64 / CALLS as f64
        })
        .collect();
    rounds.sort_by(f64::total_cmp);
    rounds[ROUNDS / 2]
}

fn main() {
    let search = SearchPath { plugins: vec![test_library("misbehave")], ..SearchPath::default() };
    let registry = pdk_tests::registry(&search);
    let frame = FrameBuf::new(4, 3);
    let mut target = FrameBuf::new(4, 3);

    let (mut driver, _) = registry.driver("misbehave", &Map::new()).unwrap();
    let drive = nanoseconds(|frame_index| {
        let cx = DriveContext { frame_index, time: 0.5, speed: 8.0 };
        black_box(driver.drive(black_box(frame.as_ref()), &cx).unwrap());
    });
    let (mut perturbation, _) = registry.perturbation("misbehave", &Map::new()).unwrap();
    let key = Key([1; 32]);
    let apply = nanoseconds(|frame_index| {
        let cx = Context::new(2.0, frame_index, 0.5, &key);
        perturbation.apply(black_box(frame.as_ref()), target.as_mut(), &cx).unwrap();
    });
    let (mut simulator, _) = registry.simulator("misbehave", &Map::new()).unwrap();
    let act = nanoseconds(|_| {
        black_box(simulator.act(Control { steering: 0.0, throttle: 0.0 }).unwrap());
    });
    println!("a call of `drive` takes {drive:.1} ns, of `apply` {apply:.1} ns, of `act` {act:.1} ns");
}
