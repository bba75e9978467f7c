//! Pictures and timings for people:
//! `LANE_FRAMES=/tmp/frames cargo test --release -p pdk-lane -- --ignored --nocapture`.

use std::time::Instant;

use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::{Value, json};

use crate::tests::{guide, lane, lane_with, scenario};

#[test]
#[ignore = "writes pictures to LANE_FRAMES for a person to look at"]
fn frames_to_look_at() {
    let folder = std::env::var("LANE_FRAMES").expect("LANE_FRAMES names the folder for the pictures");
    std::fs::create_dir_all(&folder).unwrap();
    let hills = json!({"angles": [0, 12, -10, 8, -20, 15, -10, 0], "heights": [0, 3, 4, 1, -2, 0, 3, 3]});
    let traffic = json!({"vehicle_ahead": 14, "oncoming": 40});
    for (name, parameters, road) in [
        ("day", json!({}), Value::Null),
        ("night", json!({"light": "night", "vehicle_ahead": 14, "oncoming": 40}), Value::Null),
        ("standard", json!({"conditions": "standard"}), Value::Null),
        ("hard", json!({"conditions": "hard"}), Value::Null),
        ("hard_day", json!({"conditions": "hard", "light": "day", "vehicle_ahead": 20}), Value::Null),
        ("hard_night", json!({"conditions": "hard", "light": "night", "vehicle_ahead": 20}), Value::Null),
        ("hard_wet", json!({"conditions": "hard", "light": "overcast", "wetness": 1}), Value::Null),
        ("dusk", json!({"light": "dusk"}), Value::Null),
        ("overcast", json!({"light": "overcast"}), Value::Null),
        ("worn", json!({"markings": "worn"}), Value::Null),
        ("solid", json!({"markings": "solid"}), Value::Null),
        ("traffic", traffic.clone(), Value::Null),
        ("traffic_dusk", json!({"light": "dusk", "vehicle_ahead": 14, "oncoming": 40}), Value::Null),
        ("hills", json!({}), hills.clone()),
        ("hills_traffic", traffic, hills),
    ] {
        for seed in 1..=2 {
            let mut simulator = lane_with(parameters.clone()).unwrap();
            let (width, height) = (simulator.camera().width as usize, simulator.camera().height as usize);
            let mut state = simulator.reset(&scenario(road.clone(), seed), 0).unwrap();
            let mut frame = FrameBuf::new(width, height);
            for step in 0..280 {
                if step % 70 == 0 {
                    state = simulator.frame(frame.as_mut()).unwrap();
                    let name = format!("{folder}/{name}-{seed}-{step:03}.png");
                    let (width, height) = (width as u32, height as u32);
                    image::save_buffer(name, frame.data(), width, height, image::ExtendedColorType::Rgb8)
                        .unwrap();
                }
                state = simulator.act(guide(&simulator, &state)).unwrap();
            }
        }
    }
}

#[test]
#[ignore = "measures time, which depends on the machine"]
fn time_per_frame() {
    let sizes = [(320, 160), (320, 240), (640, 480)].map(|size| (size, "easy"));
    let conditions = ["standard", "hard"].map(|conditions| ((320, 160), conditions));
    for ((width, height), conditions) in sizes.into_iter().chain(conditions) {
        let parameters = json!({"width": width, "height": height, "conditions": conditions});
        let mut simulator = lane_with(parameters).unwrap();
        let mut state = simulator.reset(&scenario(Value::Null, 1), 0).unwrap();
        let mut frame = FrameBuf::new(width, height);
        let mut times = Vec::new();
        for _ in 0..400 {
            let start = Instant::now();
            simulator.frame(frame.as_mut()).unwrap();
            times.push(start.elapsed().as_secs_f64() * 1e3);
            state = simulator.act(guide(&simulator, &state)).unwrap();
        }
        times.sort_by(f64::total_cmp);
        println!(
            "{conditions} {width}x{height}: fastest {:.2} ms, median {:.2} ms, 99 % below {:.2} ms",
            times[0], times[200], times[396]
        );
    }
    let start = Instant::now();
    let mut simulator = lane(320, 240);
    println!("new: {:.1} ms", start.elapsed().as_secs_f64() * 1e3);
    let start = Instant::now();
    simulator.reset(&scenario(Value::Null, 1), 0).unwrap();
    println!("reset: {:.1} ms", start.elapsed().as_secs_f64() * 1e3);
}
