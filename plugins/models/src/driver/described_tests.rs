//! Networks with descriptions of every kind, against what a plain Python program computes with them.
//!
//! `tests/networks/make.py` made the networks, and `plain.py` there computed what is expected, with ONNX Runtime, NumPy, OpenCV and PIL.

use std::path::PathBuf;

use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::{self, Map, Value, json};

use super::Onnx;
use crate::driver::waypoint_planner::WaypointPlanner;
use crate::gradient_tests::engines;

/// Networks by name, each with steering and throttle for each frame.
type Expected = Map<String, Value>;

/// The folder of the networks.
fn folder() -> PathBuf {
    [env!("CARGO_MANIFEST_DIR"), "../../tests/networks"].iter().collect()
}

fn road() -> image::RgbImage {
    image::open(folder().join("../../docs/road.png")).unwrap().into_rgb8()
}

/// The frames of `plain.py`: the road, moved to the side and darker with each.
fn road_frames(count: usize) -> Vec<FrameBuf> {
    let road = road();
    let (width, height) = (road.width() as usize, road.height() as usize);
    let frame = |i: usize| {
        let mut bytes = Vec::new();
        for y in 0..height {
            for x in 0..width {
                let from = (x + width - 23 * i % width) % width;
                let pixel = road.get_pixel(from as u32, y as u32).0;
                bytes.extend(pixel.map(|value| (usize::from(value) * (16 - i) / 16) as u8));
            }
        }
        FrameBuf::from_vec(bytes, width, height).unwrap()
    };
    (0..count).map(frame).collect()
}

/// The largest difference between what each network gives and what is expected, on an engine.
fn differences(engine: &str, frames: &[FrameBuf], expected: &Expected) -> Vec<(String, f64)> {
    let of = |(name, expected): (&String, &Value)| {
        let model = folder().join(format!("{name}.onnx"));
        let given = serde_json::json!({"model": model, "engine": engine});
        let config = Config::check(&Onnx::description(), given.as_object().unwrap()).unwrap();
        let mut driver = Onnx::new(&config).unwrap_or_else(|error| panic!("{error}"));
        let mut largest: f64 = 0.0;
        // Twice, so that what is remembered has to be forgotten.
        for _ in 0..2 {
            driver.reset().unwrap();
            for (frame, expected) in frames.iter().zip(expected.as_array().unwrap()) {
                let Control { steering, throttle } =
                    driver.drive(frame.as_ref(), &DriveContext::default()).unwrap();
                for (found, expected) in [(steering, &expected[0]), (throttle, &expected[1])] {
                    largest = largest.max((found - expected.as_f64().unwrap()).abs());
                }
            }
        }
        (name.clone(), largest)
    };
    expected.iter().map(of).collect()
}

fn read(text: &str) -> Expected {
    serde_json::from_str(text).unwrap()
}

#[test]
fn described_networks_drive_as_in_a_plain_program() {
    let expected = read(&std::fs::read_to_string(folder().join("expected.json")).unwrap());
    let frames = road_frames(expected["yuv"].as_array().unwrap().len());
    let files = std::fs::read_dir(folder()).unwrap().map(|entry| entry.unwrap().path());
    assert_eq!(
        files.filter(|file| file.extension().is_some_and(|ending| ending == "onnx")).count(),
        expected.len()
    );
    for (name, values) in &expected {
        let first = &values[0];
        assert!(values.as_array().unwrap().iter().any(|value| value != first), "{name} tells nothing");
    }
    for engine in engines() {
        for (name, difference) in differences(engine, &frames, &expected) {
            println!("{engine} {name}: {difference:.1e}");
            // Numbers of 16 bits have three digits.
            let most = if name == "half" { 1e-3 } else { 1e-4 };
            assert!(difference < most, "{name} on {engine}: {difference}");
        }
    }
}

/// With `PDK_PLAIN` as the file that `plain.py --frames` wrote, and `PDK_PLAIN_FRAMES` as its folder.
#[test]
fn described_networks_drive_on_frames_of_a_recording_as_in_a_plain_program() {
    let (Some(plain), Some(frames)) = (std::env::var_os("PDK_PLAIN"), std::env::var_os("PDK_PLAIN_FRAMES"))
    else {
        println!("skipped: PDK_PLAIN and PDK_PLAIN_FRAMES do not name what plain.py wrote and read");
        return;
    };
    let expected = read(&std::fs::read_to_string(plain).unwrap());
    let mut files: Vec<PathBuf> =
        std::fs::read_dir(frames).unwrap().map(|entry| entry.unwrap().path()).collect();
    let number = |file: &PathBuf| -> u32 {
        let name = file.file_name().unwrap().to_str().unwrap();
        name.chars().take_while(char::is_ascii_digit).collect::<String>().parse().unwrap()
    };
    files.sort_by_key(number);
    let frames = files.iter().map(|file| {
        let image = image::open(file).unwrap().into_rgb8();
        let (width, height) = (image.width() as usize, image.height() as usize);
        FrameBuf::from_vec(image.into_raw(), width, height).unwrap()
    });
    let frames: Vec<FrameBuf> = frames.collect();
    for engine in engines() {
        for (name, difference) in differences(engine, &frames, &expected) {
            println!("{engine} {name}: {difference:.1e} on {} frames", frames.len());
            let most = if name == "half" { 1e-3 } else { 1e-4 };
            assert!(difference < most, "{name} on {engine}: {difference}");
        }
    }
}

#[test]
fn a_network_that_plans_drives_and_has_a_gradient() {
    let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scripts/models/waypoint_planner.onnx");
    let vehicle = json!({
        "output": "waypoints", "axes": "right_forward", "interval": 0.25, "aim": 0.8, "origin": 1.3, "wheelbase": 2.6, "full_lock": 25, "gain": 0.86
    });
    let given = json!({"model": file, "waypoints": vehicle, "resize": "linear"});
    let mut driver =
        Onnx::new(&Config::check(&Onnx::description(), given.as_object().unwrap()).unwrap()).unwrap();
    let mut own =
        WaypointPlanner::new(&Config::check(&WaypointPlanner::description(), &Map::new()).unwrap()).unwrap();
    let frame = road_frames(1).remove(0);
    let cx = DriveContext { speed: 8.0, ..DriveContext::default() };
    let control = driver.drive(frame.as_ref(), &cx).unwrap();
    assert_eq!(own.drive(frame.as_ref(), &cx).unwrap(), control);
    assert!(control.steering != 0.0 && control.throttle != 0.0, "a test that tells: {control:?}");
    // Along the gradient, the steering changes as the gradient says.
    let mut gradient = vec![0.0; frame.data().len()];
    assert!((driver.gradient(frame.as_ref(), &cx, &mut gradient).unwrap() - control.steering).abs() < 1e-6);
    let mut places: Vec<usize> = (0..gradient.len()).collect();
    places.sort_by(|a, b| gradient[*b].abs().total_cmp(&gradient[*a].abs()));
    let moved = |by: f32| {
        let (mut bytes, mut expected) = (frame.data().to_vec(), 0.0);
        for &place in &places[..200] {
            let old = f32::from(bytes[place]);
            let new = (old + by * gradient[place].signum()).clamp(0.0, 255.0);
            bytes[place] = new as u8;
            expected += f64::from(gradient[place]) * f64::from(new - old);
        }
        (FrameBuf::from_vec(bytes, frame.width(), frame.height()).unwrap(), expected)
    };
    for by in [-8.0, 8.0] {
        let (frame, expected) = moved(by);
        let change = driver.drive(frame.as_ref(), &cx).unwrap().steering - control.steering;
        assert!((change - expected).abs() < 0.25 * expected.abs(), "{by}: {change} instead of {expected}");
    }
    let unknown = DriveContext { speed: f64::NAN, ..cx };
    assert!(
        driver.drive(frame.as_ref(), &unknown).unwrap_err().to_string().contains("takes the vehicle's speed")
    );
}
