//! Tests of the simulator as a whole, and of the loop of simulator and driver.

use pdk_sdk::model::component::ComponentSpec;
use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::{Map, Value, json};

use crate::driver::LaneKeeper;
use crate::simulator::Lane;

/// A simulator with frames of this size.
pub fn lane(width: usize, height: usize) -> Lane {
    lane_with(json!({"width": width, "height": height})).unwrap()
}

pub fn lane_with(parameters: Value) -> Result<Lane> {
    let given: Map<String, Value> = parameters.as_object().unwrap().clone();
    Lane::new(&Config::check(&Lane::description(), &given)?)
}

/// A scenario of half a minute.
pub fn scenario(road: Value, seed: u64) -> Scenario {
    let component = ComponentSpec::new;
    Scenario { seed, road, ..Scenario::new(component("lane"), component("lane_keeper")) }
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

/// What became of a scenario; some of it for people only, who read it in the output.
#[derive(Debug)]
#[allow(dead_code)]
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
    let mut state = simulator.reset(&scenario(road, seed), 0).unwrap();
    driver.reset().unwrap();
    let (mut sum, mut steps, mut worst, mut slowest) = (0.0, 0u64, 0.0f64, f64::INFINITY);
    while state.time < 45.0 && !state.finished && !state.lane_departure {
        state = simulator.frame(frame.as_mut()).unwrap();
        disturb(steps, frame.as_mut());
        let cx = DriveContext { frame_index: steps, time: state.time, speed: state.speed };
        let next = simulator.act(driver.drive(frame.as_ref(), &cx).unwrap()).unwrap();
        sum += state.cross_track_error.abs();
        worst = worst.max(state.cross_track_error.abs());
        slowest = slowest.min(state.speed);
        steps += 1;
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
#[ignore = "long: .ci/run runs it"]
fn the_driver_completes_random_roads() {
    let mut simulator = lane(320, 240);
    for seed in 0..4 {
        let outcome = drive(&mut simulator, Value::Null, seed, |_, _| {});
        println!("seed {seed}: {outcome:.3?}");
        assert!(outcome.finished && !outcome.departed, "seed {seed}: {outcome:?}");
        assert!(outcome.mean < 0.4, "seed {seed}: {outcome:?}");
    }
}

#[test]
fn heavy_blur_and_heavy_noise_make_the_driver_fail() {
    let mut simulator = lane(320, 240);
    let blurred = drive(&mut simulator, Value::Null, 1, |_, mut frame| blur(&mut frame, 12));
    assert!(blurred.departed && blurred.progress < 0.5, "{blurred:?}");
    let noisy = drive(&mut simulator, Value::Null, 1, |step, mut frame| add_noise(step, &mut frame, 0.5));
    assert!(noisy.departed && noisy.progress < 1.0, "{noisy:?}");
}

#[test]
fn the_driver_masters_sharp_bends_and_other_frame_sizes() {
    let sharp = json!({"angles": [0, 35, -35, 35, -35, 35, -35, 0]});
    for (size, road) in
        [((160, 120), sharp), ((160, 80), Value::Null), ((200, 66), Value::Null), ((96, 72), Value::Null)]
    {
        let outcome = drive(&mut lane(size.0, size.1), road, 1, |_, _| {});
        assert!(outcome.finished && outcome.mean < 0.4, "{size:?}: {outcome:?}");
    }
}

#[test]
#[ignore = "figures for a person: takes minutes"]
fn how_the_driver_degrades() {
    let mut simulator = lane(320, 240);
    for seed in 0..3 {
        for sigma in [0.06, 0.12, 0.18, 0.22, 0.4, 0.6] {
            let outcome = drive(&mut simulator, Value::Null, seed, |step, mut frame| {
                add_noise(step, &mut frame, sigma)
            });
            println!("seed {seed}, noise {sigma}: {outcome:.3?}");
        }
        for radius in [1, 2, 3, 5, 8, 12] {
            let outcome = drive(&mut simulator, Value::Null, seed, |_, mut frame| blur(&mut frame, radius));
            println!("seed {seed}, blur {radius}: {outcome:.3?}");
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

/// The frame of a simulator after some steps of a scenario.
pub fn frame_after(simulator: &mut Lane, seed: u64, steps: usize) -> FrameBuf {
    let camera = simulator.camera();
    let mut state = simulator.reset(&scenario(Value::Null, seed), 0).unwrap();
    for _ in 0..steps {
        state = simulator.act(guide(simulator, &state)).unwrap();
    }
    let mut frame = FrameBuf::new(camera.width as usize, camera.height as usize);
    simulator.frame(frame.as_mut()).unwrap();
    frame
}

#[test]
fn the_same_seed_gives_the_same_bytes_whatever_came_before() {
    let mut fresh = lane(160, 120);
    let expected = frame_after(&mut fresh, 7, 40);
    let mut used = lane(160, 120);
    let other = frame_after(&mut used, 8, 13);
    assert_ne!(other, expected);
    assert_eq!(frame_after(&mut used, 7, 40), expected);
    // Drawing has no effect on what is drawn next.
    let mut again = FrameBuf::new(160, 120);
    used.frame(again.as_mut()).unwrap();
    assert_eq!(again, expected);
    assert_eq!(std::thread::spawn(|| frame_after(&mut lane(160, 120), 7, 40)).join().unwrap(), expected);
}

#[test]
fn a_step_returns_the_state_of_the_next_frame_and_the_slot_changes_nothing() {
    let road = json!({"angles": [0, 20, -30, 10], "heights": [0, 2, 1, 0]});
    let parameters = json!({"width": 16, "height": 8, "vehicle_ahead": 9, "vehicle_ahead_speed": 4});
    let mut frame = FrameBuf::new(16, 8);
    let runs = [0, 7].map(|slot| {
        let mut simulator = lane_with(parameters.clone()).unwrap();
        let mut states = vec![simulator.reset(&scenario(road.clone(), 2), slot).unwrap()];
        // Off the lane, and into the vehicle ahead, so that everything in the state changes.
        for step in 0..200 {
            assert_eq!(simulator.frame(frame.as_mut()).unwrap(), states[step]);
            states.push(simulator.act(Control { steering: 0.02, throttle: 0.4 }).unwrap());
        }
        states
    });
    assert_eq!(runs[0], runs[1]);
    let ever = |flag: usize| runs[0].iter().any(|state| state.flags()[flag]);
    assert!(ever(0) && ever(1), "{:?}", runs[0].last());
}

#[test]
fn a_stride_changes_nothing_and_its_gap_is_left_alone() {
    let mut simulator = lane(80, 60);
    let expected = frame_after(&mut simulator, 3, 5);
    let mut bytes = vec![77; 256 * 60];
    simulator.frame(FrameMut::with_stride(&mut bytes, 80, 60, 256).unwrap()).unwrap();
    assert_eq!(Frame::with_stride(&bytes, 80, 60, 256).unwrap(), expected.as_ref());
    assert!(bytes.chunks(256).all(|row| row[240..].iter().all(|&b| b == 77)));
}

#[test]
fn every_pixel_is_drawn_whatever_was_there() {
    let mut simulator = lane(64, 48);
    let expected = frame_after(&mut simulator, 3, 5);
    let mut frame = FrameBuf::from_vec(vec![255; 64 * 48 * 3], 64, 48).unwrap();
    simulator.frame(frame.as_mut()).unwrap();
    assert_eq!(frame, expected);
}

#[test]
fn sky_is_above_and_asphalt_between_the_lines_below() {
    let mut simulator = lane(320, 240);
    simulator.reset(&scenario(json!({"angles": [0, 0, 0, 0]}), 1), 0).unwrap();
    let mut frame = FrameBuf::new(320, 240);
    simulator.frame(frame.as_mut()).unwrap();
    let frame = frame.as_ref();
    let sum = |x: usize, y: usize| frame.pixel(x, y).iter().map(|&v| u32::from(v)).sum::<u32>();
    for x in (0..320).step_by(10) {
        let [r, _, b] = frame.pixel(x, 0);
        assert!(b >= r, "the sky at {x} is {:?}", frame.pixel(x, 0));
    }
    let [r, g, b] = frame.pixel(160, 220);
    assert!(r.abs_diff(g) < 12 && g.abs_diff(b) < 12 && (50..130).contains(&r), "{r} {g} {b}");
    // Where the white line has to be, on the row that shows the ground 5 m ahead.
    let projection = crate::camera::Projection::new(320, 240, crate::camera::MOUNTING);
    let [x, y, _] = projection.project(1.9, 5.0, 0.0).unwrap();
    assert!(sum(x as usize, y as usize) > 600, "no line at {x:.0}, {y:.0}");
    assert!(sum(x as usize - 20, y as usize) < 400);
}

#[test]
fn motion_shows_on_the_ground() {
    let mut simulator = lane(160, 120);
    let before = frame_after(&mut simulator, 3, 0);
    let after = frame_after(&mut simulator, 3, 1);
    let changed = |rows: std::ops::Range<usize>| {
        rows.clone()
            .flat_map(|y| (0..160).map(move |x| (x, y)))
            .filter(|&(x, y)| before.as_ref().pixel(x, y) != after.as_ref().pixel(x, y))
            .count() as f64
            / (rows.len() * 160) as f64
    };
    assert!(changed(80..120) > 0.5, "{}", changed(80..120));
}

#[test]
fn frames_of_any_size_can_be_drawn() {
    for (width, height) in [(1, 1), (1, 240), (320, 1), (2, 3), (17, 5), (3, 500)] {
        frame_after(&mut lane(width, height), 1, 3);
    }
}

#[test]
fn cross_track_error_is_positive_to_the_right_and_departs_at_two_metres() {
    for side in [1.0, -1.0] {
        let mut simulator = lane(16, 12);
        let mut state = simulator.reset(&scenario(json!({"angles": [0, 0, 0, 0, 0]}), 0), 0).unwrap();
        assert!(state.cross_track_error.abs() < 1e-9 && !state.lane_departure);
        while !state.lane_departure {
            state = simulator.act(Control { steering: 0.1 * side, throttle: 0.0 }).unwrap();
            assert_eq!(state.lane_departure, state.cross_track_error.abs() >= 2.0);
            assert!(state.time < 10.0);
        }
        assert!((state.position[0] - state.cross_track_error).abs() < 1e-9);
        assert!(state.cross_track_error * side > 2.0);
    }
}

#[test]
fn a_straight_road_is_finished_on_time() {
    let mut simulator = lane_with(
        json!({"width": 8, "height": 6, "initial_speed": 10, "speed_limit": 10, "straight_ends": 0}),
    )
    .unwrap();
    let road = json!({"waypoints": [[5, 2, 5], [5, 2, 105]]});
    let mut state = simulator.reset(&scenario(road, 0), 0).unwrap();
    assert_eq!((state.position, state.speed, state.progress), ([5.0, 2.0, 5.0], 10.0, 0.0));
    while !state.finished {
        state = simulator.act(Control { steering: 0.0, throttle: 1.0 }).unwrap();
    }
    assert!((state.time - 10.0).abs() < 0.04 && state.progress == 1.0, "{state:?}");
    assert_eq!(simulator.waypoints(), [[5.0, 2.0, 5.0], [5.0, 2.0, 105.0]]);
}

#[test]
fn misuse_is_refused_with_a_sentence() {
    let mut simulator = lane(8, 6);
    let mut frame = FrameBuf::new(8, 7);
    assert_eq!(
        simulator.frame(frame.as_mut()).unwrap_err().to_string(),
        "it has no scenario yet: call reset first"
    );
    assert!(simulator.act(Control::default()).is_err());
    assert!(simulator.waypoints().is_empty());
    let error = simulator.reset(&scenario(json!({"angle": 1}), 0), 0).unwrap_err().to_string();
    assert!(error.starts_with("the road has an unknown key `angle`"), "{error}");
    simulator.reset(&scenario(Value::Null, 0), 0).unwrap();
    assert_eq!(
        simulator.frame(frame.as_mut()).unwrap_err().to_string(),
        "it was given a 8x7 frame, but its camera delivers 8x6"
    );
    assert_eq!(
        simulator.act(Control { steering: f64::NAN, throttle: 0.0 }).unwrap_err().to_string(),
        "steering is NaN at 0.00 s, but has to be a number from -1 to 1"
    );
    let error = lane_with(json!({"initial_speed": 30})).err().unwrap().to_string();
    assert!(error.contains("initial_speed is 30 m/s, above speed_limit, which is 20 m/s"), "{error}");
    let small = FrameBuf::new(8, 6);
    let error = keeper(json!({})).drive(small.as_ref(), &DriveContext::default()).unwrap_err().to_string();
    assert!(error.contains("cannot make out a lane in frames of 8x6 pixels"), "{error}");
}

#[test]
fn without_a_lane_the_steering_decays_and_the_vehicle_rolls() {
    let mut simulator = lane_with(json!({"width": 320, "height": 240, "straight_ends": 0})).unwrap();
    simulator.reset(&scenario(json!({"angles": [30, 30, 0, 0]}), 0), 0).unwrap();
    let mut frame = FrameBuf::new(320, 240);
    simulator.frame(frame.as_mut()).unwrap();
    let mut driver = keeper(json!({}));
    let cx = DriveContext { speed: 8.0, ..DriveContext::default() };
    let seen = driver.drive(frame.as_ref(), &cx).unwrap();
    assert!(seen.steering > 0.05, "{seen:?}");
    let dark = FrameBuf::new(320, 240);
    let first = driver.drive(dark.as_ref(), &cx).unwrap();
    let second = driver.drive(dark.as_ref(), &cx).unwrap();
    assert!(first.steering < seen.steering && second.steering < first.steering && second.steering > 0.0);
    assert_eq!(second.throttle, 0.0);
    driver.reset().unwrap();
    assert_eq!(driver.drive(dark.as_ref(), &cx).unwrap().steering, 0.0);
    // Without a speed it still steers, and holds a little throttle.
    let unknown = DriveContext { speed: f64::NAN, ..cx };
    let control = driver.drive(frame.as_ref(), &unknown).unwrap();
    assert!(control.steering > 0.05 && control.throttle > 0.0);
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn every_light_and_marking_can_be_driven_by_its_lines() {
    for (seed, parameters) in [
        (1, json!({"light": "dusk"})),
        (2, json!({"light": "overcast"})),
        (3, json!({"markings": "solid"})),
        (1, json!({"markings": "worn"})),
        (2, json!({"oncoming": 60})),
    ] {
        let outcome = drive(&mut lane_with(parameters.clone()).unwrap(), Value::Null, seed, |_, _| {});
        assert!(outcome.finished && outcome.mean < 0.4, "{parameters} {seed}: {outcome:?}");
    }
}

#[test]
fn hills_can_be_driven_and_show_in_the_state() {
    let road = json!({"angles": [0, 12, -10, 8, -20, 15, -10, 0], "heights": [0, 2, 3, 1, -1, 0, 2, 2]});
    let mut simulator = lane_with(json!({"initial_speed": 8})).unwrap();
    let outcome = drive(&mut simulator, road, 1, |_, _| {});
    assert!(outcome.finished && outcome.mean < 0.5, "{outcome:?}");
    let height = simulator.frame(FrameBuf::new(320, 160).as_mut()).unwrap().position[1];
    assert!((height - 2.0).abs() < 0.2, "{height}");
}

#[test]
fn a_vehicle_that_is_not_heeded_is_hit() {
    let parameters = json!({"vehicle_ahead": 12, "vehicle_ahead_speed": 4, "width": 16, "height": 8});
    let mut simulator = lane_with(parameters).unwrap();
    let mut state = simulator.reset(&scenario(json!({"angles": [0, 0, 0, 0, 0, 0]}), 1), 0).unwrap();
    assert!((state.vehicle_ahead - 12.0).abs() < 1e-9 && !state.collision);
    let mut before = f64::INFINITY;
    while !state.collision {
        before = state.vehicle_ahead;
        state = simulator.act(Control { steering: 0.0, throttle: 0.3 }).unwrap();
        assert!(state.time < 20.0 && !state.finished, "{state:?}");
    }
    assert!(before < 1.0 && state.vehicle_ahead == 0.0, "{before} {state:?}");
}

#[test]
fn a_vehicle_ahead_shows() {
    let with = |parameters: Value| {
        let mut simulator = lane_with(parameters).unwrap();
        simulator.reset(&scenario(json!({"angles": [0, 0, 0, 0]}), 1), 0).unwrap();
        let mut frame = FrameBuf::new(320, 160);
        simulator.frame(frame.as_mut()).unwrap();
        frame
    };
    let (free, followed) = (with(json!({"oncoming": 0})), with(json!({"oncoming": 0, "vehicle_ahead": 10})));
    let changed: Vec<(usize, usize)> = (0..160)
        .flat_map(|y| (0..320).map(move |x| (x, y)))
        .filter(|&(x, y)| free.as_ref().pixel(x, y) != followed.as_ref().pixel(x, y))
        .collect();
    // 1.8 m at about 11.7 m are 32 pixels, in the middle of the frame.
    let (left, right) = changed.iter().fold((320, 0), |(l, r), &(x, _)| (l.min(x), r.max(x)));
    assert!((28..50).contains(&(right - left)) && left > 120 && right < 200, "{left} {right}");
}

#[test]
fn a_wandering_driver_visits_both_sides_of_its_lane() {
    let mut simulator = lane(160, 80);
    let mut driver = keeper(json!({"wander": 1.2}));
    let mut frame = FrameBuf::new(160, 80);
    let mut state = simulator.reset(&scenario(Value::Null, 4), 0).unwrap();
    let (mut left, mut right) = (0.0f64, 0.0f64);
    while !state.finished {
        simulator.frame(frame.as_mut()).unwrap();
        let cx = DriveContext { time: state.time, speed: state.speed, ..DriveContext::default() };
        state = simulator.act(driver.drive(frame.as_ref(), &cx).unwrap()).unwrap();
        assert!(!state.lane_departure && state.time < 40.0, "{state:?}");
        left = left.min(state.cross_track_error);
        right = right.max(state.cross_track_error);
    }
    assert!(left < -0.5 && right > 0.5, "{left} {right}");
}

/// At a low rate a step is longer than vehicles are, and than the part of the road on which the vehicle is looked for.
#[test]
fn long_steps_lose_neither_the_road_nor_a_collision() {
    let straight = json!({"waypoints": [[0, 0, 0], [0, 0, 100], [0, 0, 200]]});
    for (rate, speed) in [(1.0, 20.0), (2.0, 30.0), (3.0, 38.0)] {
        let parameters = json!({"rate": rate, "initial_speed": speed, "speed_limit": 40, "oncoming": 0});
        let mut simulator = lane_with(parameters).unwrap();
        let mut state = simulator.reset(&scenario(straight.clone(), 1), 0).unwrap();
        while !state.finished {
            state = simulator.act(Control { steering: 0.0, throttle: 0.2 }).unwrap();
            assert!(!state.lane_departure && state.cross_track_error.abs() < 0.1, "{rate}: {state:?}");
            assert!(state.time < 30.0);
        }
    }
    // 30 m a step, past a vehicle that is 4.4 m long.
    let parameters = json!({"rate": 1, "initial_speed": 30, "speed_limit": 40, "vehicle_ahead": 20, "vehicle_ahead_speed": 1});
    let mut simulator = lane_with(parameters).unwrap();
    simulator.reset(&scenario(straight, 1), 0).unwrap();
    let state = simulator.act(Control { steering: 0.0, throttle: 1.0 }).unwrap();
    assert!(state.collision && !state.lane_departure, "{state:?}");
}

#[test]
fn labels_say_what_the_pixels_show() {
    let parameters = json!({"vehicle_ahead": 12, "oncoming": 0});
    let mut simulator = lane_with(parameters).unwrap();
    let (width, height) = (simulator.camera().width as usize, simulator.camera().height as usize);
    simulator.reset(&scenario(Value::Null, 3), 0).unwrap();
    let mut frame = FrameBuf::new(width, height);
    let state = simulator.frame(frame.as_mut()).unwrap();
    let names = simulator.label_names();
    let mut labels = vec![u8::MAX; width * height];
    simulator.labels(&mut labels).unwrap();
    let count = |name: &str| {
        let number = names.iter().position(|known| known == name).unwrap() as u8;
        labels.iter().filter(|label| **label == number).count()
    };
    assert_eq!(
        ["sky", "ground", "road", "marking", "vehicle", "vegetation", "building", "post", "traffic_sign"]
            .map(count)
            .iter()
            .sum::<usize>(),
        width * height
    );
    for (name, least) in [("sky", 100), ("ground", 100), ("road", 100), ("vehicle", 3)] {
        assert!(count(name) * 1000 > width * height * least, "{name}: {}", count(name));
    }
    let at = |x: usize, y: usize| names[usize::from(labels[y * width + x])].as_str();
    assert_eq!(at(width / 2, 0), "sky");
    assert!(["road", "marking"].contains(&at(width / 2, height - 1)));
    // Grass is green and asphalt is grey, but for the pixels that show some of both.
    let near = labels.iter().enumerate().filter(|(at, _)| at / width > height * 3 / 4);
    let road: Vec<_> = near.filter(|(_, label)| names[usize::from(**label)] == "road").collect();
    let grey = road.iter().filter(|(at, _)| {
        let [red, green, blue] = frame.as_ref().pixel(at % width, at / width).map(i32::from);
        (green - red).abs() < 40 && (green - blue).abs() < 40
    });
    assert!(grey.count() * 100 > road.len() * 98, "{}", road.len());
    // To ask for labels changes nothing.
    let mut again = FrameBuf::new(width, height);
    assert_eq!(simulator.frame(again.as_mut()).unwrap(), state);
    assert!(again == frame);
    assert!(simulator.labels(&mut [0; 3]).unwrap_err().message().contains("room for 3 labels"));
}

#[test]
fn distances_are_those_of_the_camera() {
    let parameters = json!({"vehicle_ahead": 12, "oncoming": 0});
    let mut simulator = lane_with(parameters).unwrap();
    let (width, height) = (simulator.camera().width as usize, simulator.camera().height as usize);
    simulator.reset(&scenario(Value::Null, 3), 0).unwrap();
    let mut frame = FrameBuf::new(width, height);
    simulator.frame(frame.as_mut()).unwrap();
    let (mut labels, mut depth) = (vec![0; width * height], vec![0.0; width * height]);
    simulator.labels(&mut labels).unwrap();
    simulator.depth(&mut depth).unwrap();
    let names = simulator.label_names();
    let of = |name: &str| -> Vec<f32> {
        let shown = |label: u8| names[usize::from(label)] == name;
        depth.iter().zip(&labels).filter(|(_, label)| shown(**label)).map(|(depth, _)| *depth).collect()
    };
    assert!(of("sky").iter().all(|depth| *depth == f32::INFINITY));
    // The vehicle's rear is 12 m ahead of the bumper, and its other end a vehicle's length farther.
    let vehicle = of("vehicle");
    assert!(!vehicle.is_empty() && vehicle.iter().all(|depth| (11.0..22.0).contains(depth)), "{vehicle:?}");
    // On flat ground a row's distance follows from the camera alone: height over the tangent of the row's angle.
    let road = of("road");
    let nearest = road.iter().copied().fold(f32::INFINITY, f32::min);
    assert!((1.0..6.0).contains(&nearest), "{nearest}");
    let column: Vec<f32> = (height * 2 / 3..height).map(|y| depth[y * width + width / 2]).collect();
    assert!(column.is_sorted_by(|far, near| far > near), "{column:?}");
    assert!(simulator.depth(&mut [0.0; 3]).unwrap_err().message().contains("room for 3 distances"));
}

/// The frames of a few scenarios, so that records of drives keep their meaning: a number for each, FNV-1a over the bytes of some
/// frames. If one changes on purpose, so does the simulator's version.
#[test]
fn frames_are_those_of_earlier_versions() {
    let hills = json!({"angles": [0, 12, -10, 8, -20, 15, -10, 0], "heights": [0, 3, 4, 1, -2, 0, 3, 3]});
    let digest = |parameters: Value, road: Value, seed: u64| {
        let mut simulator = lane_with(parameters).unwrap();
        let camera = simulator.camera();
        let mut frame = FrameBuf::new(camera.width as usize, camera.height as usize);
        let mut state = simulator.reset(&scenario(road, seed), 0).unwrap();
        let mut digest = 0xcbf2_9ce4_8422_2325u64;
        for step in 0..200 {
            if step % 8 == 0 {
                state = simulator.frame(frame.as_mut()).unwrap();
                for byte in frame.data() {
                    digest = (digest ^ u64::from(*byte)).wrapping_mul(0x100_0000_01b3);
                }
            }
            state = simulator.act(guide(&simulator, &state)).unwrap();
        }
        digest
    };
    let found = [
        digest(json!({}), Value::Null, 1),
        digest(json!({"width": 320, "height": 240, "markings": "solid"}), Value::Null, 2),
        digest(json!({"light": "dusk", "vehicle_ahead": 14, "oncoming": 40}), Value::Null, 3),
        digest(json!({"light": "overcast", "markings": "worn", "width": 161, "height": 83}), Value::Null, 4),
        digest(json!({"vehicle_ahead": 20, "oncoming": 30}), hills, 5),
    ];
    assert_eq!(
        found.map(|digest| format!("{digest:016x}")),
        ["f9da81cc838a1e5e", "5be2760335357c4d", "0fcfba1dcfb603b0", "a1a6c846c6998804", "d576f7fe5896575f"]
    );
}

#[test]
fn a_vehicle_starts_beside_the_lane_and_turned_as_the_parameters_say() {
    let start = |parameters: Value| {
        let mut simulator = lane_with(parameters).unwrap();
        simulator.reset(&scenario(json!({"angles": [0, 20, -10]}), 4), 0).unwrap()
    };
    let middle = start(json!({}));
    assert_eq!(middle.cross_track_error, 0.0);
    for offset in [-1.5, 0.75] {
        let beside = start(json!({"start_offset": offset, "start_heading": 6.0}));
        assert!((beside.cross_track_error - offset).abs() < 1e-9, "{}", beside.cross_track_error);
        assert!((beside.heading - middle.heading - 6f64.to_radians()).abs() < 1e-12);
    }
}

#[test]
fn gusts_push_a_vehicle_off_its_lane_in_the_same_way_each_time() {
    let straight = |gusts: f64, seed: u64| {
        let mut simulator = lane_with(json!({"gusts": gusts, "initial_speed": 12})).unwrap();
        let mut state = simulator.reset(&scenario(json!({"angles": [0, 0, 0, 0, 0, 0]}), seed), 0).unwrap();
        let mut course = vec![state.cross_track_error];
        for _ in 0..100 {
            state = simulator.act(Control { steering: 0.0, throttle: 0.05 }).unwrap();
            course.push(state.cross_track_error);
        }
        course
    };
    assert!(straight(0.0, 3).iter().all(|error| error.abs() < 1e-9));
    let blown = straight(5.0, 3);
    assert!(blown.iter().any(|error| error.abs() > 0.3), "{blown:?}");
    assert_eq!(straight(5.0, 3), blown);
    assert_ne!(straight(5.0, 4), blown);
}

#[test]
fn put_back_to_a_frame_it_goes_on_as_it_did() {
    // Everything that a drive remembers: controls on their way, the wind, noise, traffic.
    for parameters in [
        json!({}),
        json!({"conditions": "hard", "gusts": 12.0, "vehicle_ahead": 30.0, "control_delay": 0.12}),
    ] {
        let mut simulator = lane_with(parameters).unwrap();
        let camera = simulator.camera();
        let mut saved = vec![vec![0.0; simulator.saved_numbers().len()]; 60];
        let step = |simulator: &mut Lane, at: u64| {
            let mut frame = FrameBuf::new(camera.width as usize, camera.height as usize);
            let state = simulator.frame(frame.as_mut()).unwrap();
            simulator.act(Control { steering: 0.2 * libm::sin(at as f64 / 4.0), throttle: 0.4 }).unwrap();
            (frame, state)
        };
        simulator.reset(&scenario(json!({"angles": [0, 20, -20], "segment": 25}), 3), 0).unwrap();
        let mut first = Vec::new();
        for (at, saved) in (0..).zip(&mut saved) {
            simulator.save(saved).unwrap();
            first.push(step(&mut simulator, at));
        }
        // Forwards and backwards in time.
        for from in [40, 10, 55, 0] {
            let state = simulator.restore(from as u64, &saved[from]).unwrap();
            assert_eq!(state, first[from].1);
            for (at, expected) in first.iter().enumerate().skip(from).take(5) {
                assert!(step(&mut simulator, at as u64) == *expected, "frame {at} after {from}");
            }
        }
    }
}

#[test]
fn put_back_to_other_numbers_it_is_there() {
    let mut simulator = lane(64, 32);
    let mut saved = vec![0.0; simulator.saved_numbers().len()];
    assert!(simulator.save(&mut saved).unwrap_err().to_string().contains("call reset first"));
    let state = simulator.reset(&scenario(Value::Null, 1), 0).unwrap();
    simulator.save(&mut saved).unwrap();
    let moved = |place: usize, by: f64| {
        let mut moved = saved.clone();
        moved[place] += by;
        moved
    };
    let heading = simulator.restore(0, &moved(2, 0.1)).unwrap().heading;
    assert!((heading - state.heading - 0.1).abs() < 1e-12);
    // Slower than standing there is not.
    assert_eq!(simulator.restore(0, &moved(3, -100.0)).unwrap().speed, 0.0);
    assert!(simulator.restore(0, &moved(2, f64::NAN)).unwrap_err().to_string().contains("finite"));
    assert!(simulator.restore(0, &saved[1..]).unwrap_err().to_string().contains("it saves 8"));
}
