//! Measures how long a frame takes, to compare versions on a busy machine.

use std::time::Instant;

use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::json;

use crate::conditions::NAMES;
use crate::tests::{guide, lane_with, scenario};

/// Frames of each drive that are measured, and drives.
const FRAMES: usize = 40;
const SEEDS: [u64; 3] = [1, 2, 3];
/// A frame is drawn this often, and the shortest time counts: what other processes take does not.
const REPEATS: usize = 20;
/// Steps from one measured frame to the next.
const STEPS: usize = 3;

/// Prints the mean time of a frame. The caches hold what the frame needs, which in a loop with a network they do in part.
#[test]
#[ignore = "prints figures"]
fn a_frame_takes_the_printed_time() {
    for conditions in NAMES {
        let mut sum = 0.0;
        for seed in SEEDS {
            let mut simulator =
                lane_with(json!({"width": 320, "height": 160, "conditions": conditions})).unwrap();
            let mut frame = FrameBuf::new(320, 160);
            let mut state = simulator.reset(&scenario(json!(null), seed), 0).unwrap();
            for _ in 0..FRAMES {
                let times = (0..REPEATS).map(|_| {
                    let started = Instant::now();
                    simulator.frame(frame.as_mut()).unwrap();
                    started.elapsed().as_secs_f64()
                });
                sum += times.fold(f64::INFINITY, f64::min);
                for _ in 0..STEPS {
                    state = simulator.act(guide(&simulator, &state)).unwrap();
                }
            }
        }
        println!("conditions {conditions}: {:.4} ms", sum * 1e3 / (FRAMES * SEEDS.len()) as f64);
    }
}
