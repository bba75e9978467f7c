//! Tests of the simulator as a whole, and of the loop of simulator and driver.

use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::{Map, Value, json};

use crate::driver::LaneKeeper;
use crate::simulator::Lane;

/// A simulator with frames of this size.
pub fn lane(width: usize, height: usize) -> Lane {
    lane_with(json!({"width": width, "height": height})).unwrap()
}

fn lane_with(parameters: Value) -> Result<Lane> {
    let given: Map<String, Value> = parameters.as_object().unwrap().clone();
    Lane::new(&Config::check(&Lane::description(), &given)?)
}

/// A scenario of half a minute.
pub fn scenario(road: Value, seed: u64) -> Scenario {
    Scenario { index: 0, seed, road, duration: 30.0 }
}

/// Follows the lane by what only a test may know: the true state. Steers towards a point ahead, by pure pursuit.
pub fn guide(simulator: &Lane, state: &State) -> Control {
    let target = simulator.ahead_on_lane(7.0);
    let (dx, dz) = (target[0] - state.position[0], target[1] - state.position[2]);
    let (sine, cosine) = (libm::sin(state.heading), libm::cos(state.heading));
    let (right, ahead) = (dx * cosine - dz * sine, dx * sine + dz * cosine + 1.3);
    let curvature = 2.0 * right / (right * right + ahead * ahead);
    let angle = libm::atan(crate::vehicle::WHEELBASE * curvature);
    Control {
        steering: angle / crate::vehicle::LARGEST_STEERING_ANGLE,
        throttle: (0.5 * (8.0 - state.speed)).clamp(-1.0, 1.0),
    }
}

fn keeper(parameters: Value) -> LaneKeeper {
    let given = parameters.as_object().unwrap().clone();
    LaneKeeper::new(&Config::check(&LaneKeeper::description(), &given).unwrap()).unwrap()
}

/// What became of a scenario.
#[derive(Debug)]
struct Outcome {
    mean: f64,
    worst: f64,
    finished: bool,
    departed: bool,
    progress: f64,
    slowest: f64,
    seconds: f64,
}

/// Drives a scenario to its end with what the driver sees changed by `disturb`.
fn drive(
    simulator: &mut Lane,
    road: Value,
    seed: u64,
    mut disturb: impl FnMut(u64, FrameMut<'_>),
) -> Outcome {
    let mut driver = keeper(json!({}));
    let camera = simulator.camera();
    let mut frame = FrameBuf::new(camera.width as usize, camera.height as usize);
    let mut state = simulator.reset(&scenario(road, seed)).unwrap();
    driver.reset().unwrap();
    let (mut sum, mut steps, mut worst, mut slowest) = (0.0, 0u64, 0.0f64, f64::INFINITY);
    while state.time < 45.0 && !state.finished && !state.lane_departure {
        state = simulator.frame(frame.as_mut()).unwrap();
        disturb(steps, frame.as_mut());
        let cx = DriveContext { frame_index: steps, time: state.time, speed: state.speed };
        simulator.act(driver.drive(frame.as_ref(), &cx).unwrap()).unwrap();
        sum += state.cross_track_error.abs();
        worst = worst.max(state.cross_track_error.abs());
        slowest = slowest.min(state.speed);
        steps += 1;
        let next = simulator.state().unwrap();
        assert!(next.progress >= state.progress, "progress went back at {} s", next.time);
        state = next;
    }
    Outcome {
        mean: sum / steps as f64,
        worst,
        finished: state.finished,
        departed: state.lane_departure,
        progress: state.progress,
        slowest,
        seconds: state.time,
    }
}

#[test]
fn the_driver_completes_ten_random_roads() {
    let mut simulator = lane(320, 240);
    for seed in 0..10 {
        let outcome = drive(&mut simulator, Value::Null, seed, |_, _| {});
        println!("seed {seed}: {outcome:.3?}");
        assert!(outcome.finished && !outcome.departed, "seed {seed}: {outcome:?}");
        assert!(outcome.mean < 0.4, "seed {seed}: {outcome:?}");
    }
}

#[test]
#[ignore = "figures for a person: how the driver degrades"]
fn degradation() {
    let mut simulator = lane(320, 240);
    for angles in [
        [35, 35, 35, 35, 35, 35, 0, 0],
        [0, 35, -35, 35, -35, 35, -35, 0],
        [35, 35, -35, -35, 35, 35, -35, -35],
    ] {
        println!("{angles:?} {:.3?}", drive(&mut simulator, json!({"angles": angles}), 0, |_, _| {}));
    }
    for (w, h) in [(160, 120), (320, 160), (640, 480), (200, 66), (96, 72)] {
        println!("{w}x{h} {:.3?}", drive(&mut lane(w, h), Value::Null, 1, |_, _| {}));
    }
    for sigma in [0.03, 0.06, 0.12, 0.18, 0.22, 0.4, 0.6] {
        for seed in 0..3 {
            let o = drive(&mut simulator, Value::Null, seed, |step, mut frame| {
                add_noise(step, &mut frame, sigma)
            });
            println!("noise {sigma} seed {seed}: {o:.3?}");
        }
    }
    for radius in [1, 2, 3, 5, 8, 12, 20] {
        for seed in 0..3 {
            let o = drive(&mut simulator, Value::Null, seed, |_, mut frame| blur(&mut frame, radius));
            println!("blur {radius} seed {seed}: {o:.3?}");
        }
    }
}

/// Adds normal noise of this standard deviation (1 for the full range), another for each step.
fn add_noise(step: u64, frame: &mut FrameMut<'_>, sigma: f64) {
    let mut random = Key([9; 32]).frame(step);
    for row in frame.rows_mut() {
        for value in row {
            *value = (f64::from(*value) + 255.0 * sigma * random.normal()) as u8;
        }
    }
}

/// Replaces each pixel by the mean of a square around it.
fn blur(frame: &mut FrameMut<'_>, radius: usize) {
    let (width, height) = (frame.width(), frame.height());
    let pass = |length: usize, get: &dyn Fn(usize) -> u8| -> Vec<u8> {
        let at = |i: usize| u32::from(get(i));
        (0..length)
            .map(|i| {
                let (from, to) = (i.saturating_sub(radius), (i + radius).min(length - 1));
                ((from..=to).map(at).sum::<u32>() / (to - from + 1) as u32) as u8
            })
            .collect()
    };
    for y in 0..height {
        for c in 0..3 {
            let row = frame.row_mut(y).to_vec();
            for (x, v) in pass(width, &|x| row[x * 3 + c]).into_iter().enumerate() {
                frame.row_mut(y)[x * 3 + c] = v;
            }
        }
    }
    let copy = frame.as_ref().to_buf();
    for x in 0..width * 3 {
        for (y, v) in pass(height, &|y| copy.data()[y * width * 3 + x]).into_iter().enumerate() {
            frame.row_mut(y)[x] = v;
        }
    }
}
