//! Tests of the whole driver, with every engine that the machine has.

use std::time::Instant;

use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::{self, Map, Value, json};

use super::Onnx;
use crate::fixture::{self, Pilot};
use crate::locate::Search;

fn open(given: Value) -> Result<Onnx> {
    Onnx::new(&Config::check(&Onnx::description(), given.as_object().unwrap())?)
}

/// The engines to test; ONNX Runtime if it is found.
fn engines() -> Vec<&'static str> {
    match Search::from_environment().find().unwrap() {
        Some(_) => vec!["pdk", "onnxruntime"],
        None => {
            println!("skipped for onnxruntime: it is not installed");
            vec!["pdk"]
        }
    }
}

fn frame(width: usize, height: usize) -> FrameBuf {
    let pixels = (0..width * height * 3).map(|i| (i * 31 % 251) as u8).collect();
    FrameBuf::from_vec(pixels, width, height).unwrap()
}

fn drive(driver: &mut Onnx, frame: &FrameBuf) -> Control {
    driver.drive(frame.as_ref(), &DriveContext::default()).unwrap()
}

#[test]
fn steering_and_throttle_are_what_the_model_computes() {
    let frame = frame(6, 4);
    for engine in engines() {
        for (dims, batch) in [(["batch", "3", "4", "6"], "nchw"), (["1", "4", "6", "3"], "nhwc")] {
            let pilot = Pilot::new(&dims);
            let file = pilot.file();
            let mut driver = open(json!({"model": file.path(), "engine": engine, "layout": batch})).unwrap();
            let values: Vec<f32> = match batch {
                "nhwc" => frame.data().iter().map(|&v| f32::from(v)).collect(),
                _ => (0..3)
                    .flat_map(|c| frame.data().iter().skip(c).step_by(3).map(|&v| f32::from(v)))
                    .collect(),
            };
            let expected = &pilot.expected(&values)[0];
            let control = drive(&mut driver, &frame);
            assert!((control.steering - expected[0]).abs() < 1e-5, "{engine}: {control:?} {expected:?}");
            assert!((control.throttle - expected[1]).abs() < 1e-5, "{engine}: {control:?} {expected:?}");
            assert!(
                expected.iter().all(|v| v.abs() > 1e-3 && v.abs() < 1.0),
                "a test that tells: {expected:?}"
            );
            assert_eq!(control, drive(&mut driver, &frame));
        }
    }
}

#[test]
fn a_speed_input_gets_the_speed() {
    let frame = frame(6, 4);
    let plain = Pilot { gain: 0.1, ..Pilot::new(&["1", "3", "4", "6"]) };
    let with = Pilot { second_input: Some("speed"), gain: 0.1, ..Pilot::new(&["1", "3", "4", "6"]) };
    for engine in engines() {
        let (plain, with) = (plain.file(), with.file());
        let without = drive(&mut open(json!({"model": plain.path(), "engine": engine})).unwrap(), &frame);
        let mut driver = open(json!({"model": with.path(), "engine": engine})).unwrap();
        let cx = DriveContext { speed: 0.25, ..DriveContext::default() };
        let control = driver.drive(frame.as_ref(), &cx).unwrap();
        assert!((control.steering - without.steering - 0.25).abs() < 1e-5, "{control:?} {without:?}");
        let cx = DriveContext { speed: f64::NAN, ..cx };
        let error = driver.drive(frame.as_ref(), &cx).unwrap_err().to_string();
        assert!(error.contains("takes the vehicle's speed"), "{error}");
    }
}

#[test]
fn what_a_network_remembers_comes_back_with_the_next_frame() {
    let frame = frame(6, 4);
    let pilot = || Pilot { outputs: vec![("control", 1)], gain: 0.1, ..Pilot::new(&["1", "3", "4", "6"]) };
    let steers = pilot();
    // Adds what it gave before to what it gives.
    let sums = Pilot { second_input: Some("sum_in"), copy: Some("sum_out"), ..pilot() };
    let (steers, sums) = (steers.file(), sums.file());
    for engine in engines() {
        let alone =
            drive(&mut open(json!({"model": steers.path(), "engine": engine})).unwrap(), &frame).steering;
        assert!(alone.abs() > 1e-4, "a test that tells: {alone}");
        let mut driver = open(json!({"model": sums.path(), "engine": engine})).unwrap();
        for times in [1.0, 2.0, 3.0] {
            let control = drive(&mut driver, &frame);
            assert!((control.steering - times * alone).abs() < 1e-5, "{times}: {control:?}, {alone}");
            assert_eq!(control.throttle, 0.3, "the throttle is not taken from memory");
        }
        driver.reset().unwrap();
        assert!((drive(&mut driver, &frame).steering - alone).abs() < 1e-6, "it forgets between scenarios");
    }
    let two =
        Pilot { second_input: Some("sum_in"), copy: Some("sum_out"), ..Pilot::new(&["1", "3", "4", "6"]) };
    let file = two.file();
    let error = open(json!({"model": file.path(), "engine": "pdk"})).err().unwrap().to_string();
    assert!(error.contains("its output `sum_out` has 2 values, but the input `sum_in`"), "{error}");
    let alone = Pilot { second_input: Some("sum_in"), ..Pilot::new(&["1", "3", "4", "6"]) };
    let file = alone.file();
    let error = open(json!({"model": file.path()})).err().unwrap().to_string();
    assert!(error.contains("nothing says what `sum_in` gets"), "{error}");
}

#[test]
fn scale_and_colours_reach_the_model() {
    let frame = frame(6, 4);
    let pilot = Pilot { gain: 100.0, ..Pilot::new(&["1", "4", "6", "3"]) };
    let file = pilot.file();
    for engine in engines() {
        let given = json!({"model": file.path(), "engine": engine, "scale": "-1..1", "color": "bgr"});
        let control = drive(&mut open(given).unwrap(), &frame);
        let bgr = frame.data().chunks(3).flat_map(|p| [p[2], p[1], p[0]]);
        let values: Vec<f32> = bgr.map(|v| f32::from(v) / 127.5 - 1.0).collect();
        let expected = pilot.expected(&values)[0][0];
        assert!((control.steering - expected).abs() < 1e-5, "{engine}: {control:?} {expected}");
    }
}

#[test]
fn frames_of_another_size_are_resized() {
    let file = Pilot::new(&["1", "3", "4", "6"]).file();
    let large = frame(31, 17);
    let mut small = FrameBuf::new(6, 4);
    pdk_sdk::ops::resize::resize_linear(large.as_ref(), small.as_mut());
    for engine in engines() {
        let mut driver = open(json!({"model": file.path(), "engine": engine})).unwrap();
        let expected = drive(&mut driver, &small);
        assert_eq!(drive(&mut driver, &large), expected);
        assert_ne!(drive(&mut driver, &frame(6, 4)), expected);
    }
}

#[test]
fn other_outputs_are_used_as_the_parameters_say() {
    let frame = frame(6, 4);
    let pilot = Pilot { outputs: vec![("speed", 1), ("angle", 1)], ..Pilot::new(&["1", "4", "6", "3"]) };
    let alone = Pilot { outputs: vec![("angle", 1)], ..Pilot::new(&["1", "4", "6", "3"]) };
    let values: Vec<f32> = frame.data().iter().map(|&v| f32::from(v)).collect();
    let (expected, file, alone_file) = (pilot.expected(&values), pilot.file(), alone.file());
    for engine in engines() {
        let given = json!({"model": file.path(), "engine": engine, "throttle": "speed"});
        let control = drive(&mut open(given).unwrap(), &frame);
        assert!((control.steering - expected[1][0]).abs() < 1e-5, "{control:?} {expected:?}");
        assert!((control.throttle - expected[0][0]).abs() < 1e-5, "{control:?} {expected:?}");
        let given = json!({"model": alone_file.path(), "engine": engine, "throttle": 0.125});
        let control = drive(&mut open(given).unwrap(), &frame);
        assert!((control.steering - alone.expected(&values)[0][0]).abs() < 1e-5);
        assert_eq!(control.throttle, 0.125);
    }
}

#[test]
fn steering_stays_within_its_range_and_is_never_not_a_number() {
    let bright = FrameBuf::from_vec(vec![255; 72], 6, 4).unwrap();
    for engine in engines() {
        let file = Pilot { gain: 1e4, ..Pilot::new(&["1", "3", "4", "6"]) }.file();
        let control = drive(&mut open(json!({"model": file.path(), "engine": engine})).unwrap(), &bright);
        assert_eq!((control.steering.abs(), control.throttle.abs()), (1.0, 1.0));
        let file = Pilot { gain: f32::INFINITY, ..Pilot::new(&["1", "3", "4", "6"]) }.file();
        let mut driver = open(json!({"model": file.path(), "engine": engine})).unwrap();
        let cx = DriveContext { frame_index: 7, ..Default::default() };
        let error = driver.drive(bright.as_ref(), &cx).unwrap_err().to_string();
        assert!(error.contains(" on ") && error.contains("frame 7: its steering is NaN"), "{error}");
    }
}

#[test]
fn an_unsuitable_model_is_refused_when_it_is_opened() {
    for engine in engines() {
        let error = |pilot: Pilot| {
            let file = pilot.file();
            let given = json!({"model": file.path(), "engine": engine});
            let error = open(given).err().unwrap().to_string();
            assert!(error.starts_with(&format!("model `{}`: ", file.path().display())), "{error}");
            error
        };
        assert!(error(Pilot::new(&["1", "10"])).contains("has the shape (1, 10), but has to be an image"));
        let classes = Pilot { outputs: vec![("classes", 10)], ..Pilot::new(&["1", "3", "4", "6"]) };
        assert!(error(classes).contains("`classes` (10); a driving model has"));
        let unknown = error(Pilot { operator: "Imagine", ..Pilot::new(&["1", "3", "4", "6"]) });
        assert!(unknown.contains("Imagine"), "{unknown}");
        // The weights fit a flattened image only.
        let contradiction = error(Pilot { operator: "Relu", ..Pilot::new(&["1", "3", "4", "6"]) });
        assert!(contradiction.contains("cannot prepare the model"), "{contradiction}");
    }
    let missing = open(json!({"model": "/no/such.onnx"})).err().unwrap().to_string();
    assert!(missing.starts_with("model `/no/such.onnx`: there is no such file"), "{missing}");
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn a_damaged_model_is_an_error_or_a_driver_but_never_a_panic() {
    let whole = Pilot::new(&["batch", "3", "4", "6"]).bytes();
    let file = tempfile::NamedTempFile::new().unwrap();
    let mut refused = 0;
    for position in 0..whole.len() {
        // Most of the file is weights, in which any value is as good as another.
        if position > 120 && position < whole.len() - 160 {
            continue;
        }
        for bit in 0..8 {
            let mut bytes = whole.clone();
            bytes[position] ^= 1 << bit;
            std::fs::write(file.path(), bytes).unwrap();
            refused += usize::from(open(json!({"model": file.path(), "engine": "pdk"})).is_err());
        }
    }
    assert!(refused > 500, "{refused}");
}

/// The recorded steering of the drive that comes with the real model, with its frames.
fn tub() -> Option<(String, Vec<(FrameBuf, f64)>)> {
    let (model, tub) = (fixture::shared("tub_pilot.onnx")?, fixture::shared("tub")?);
    let catalog = std::fs::read_to_string(tub.join("catalog_0.catalog")).unwrap();
    let frames = catalog.lines().map(|line| {
        let record: Map<String, Value> = serde_json::from_str(line).unwrap();
        let path = tub.join("images").join(record["cam/image_array"].as_str().unwrap());
        let image = image::open(path).unwrap().into_rgb8();
        let (width, height) = (image.width() as usize, image.height() as usize);
        (FrameBuf::from_vec(image.into_raw(), width, height).unwrap(), record["user/angle"].as_f64().unwrap())
    });
    Some((model.to_str().unwrap().to_owned(), frames.collect()))
}

#[test]
fn a_real_model_steers_a_real_drive() {
    let Some((model, frames)) = tub() else { return };
    let mut steering: Vec<Vec<f64>> = Vec::new();
    for engine in engines() {
        let opening = Instant::now();
        let mut driver = open(json!({"model": model, "engine": engine})).unwrap();
        let opening = opening.elapsed().as_secs_f64() * 1e3;
        let driving = Instant::now();
        let controls: Vec<_> = frames.iter().map(|(frame, _)| drive(&mut driver, frame)).collect();
        let each = driving.elapsed().as_secs_f64() * 1e3 / frames.len() as f64;
        let errors =
            controls.iter().zip(&frames).map(|(control, (_, truth))| (control.steering - truth).abs());
        let error = errors.sum::<f64>() / frames.len() as f64;
        println!(
            "{}: mean absolute steering error {error:.4}, {each:.3} ms a frame, opened in {opening:.1} ms",
            driver.session.engine()
        );
        assert!((0.05..0.09).contains(&error), "{engine}: {error}");
        // A second instance, used from the last frame to the first, says the same bit for bit.
        let mut second = open(json!({"model": model, "engine": engine})).unwrap();
        for ((frame, _), control) in frames.iter().zip(&controls).rev() {
            assert_eq!(drive(&mut second, frame), *control);
        }
        steering.push(controls.iter().map(|control| control.steering).collect());
    }
    if let [pdk, onnxruntime] = steering.as_slice() {
        let largest = pdk.iter().zip(onnxruntime).map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
        println!("the engines differ by at most {largest:.2e}");
        assert!(largest < 1e-4);
    }
}

#[test]
fn instances_on_several_threads_say_the_same_as_one() {
    let Some((model, frames)) = tub() else { return };
    for engine in engines() {
        let steer = || -> Vec<u64> {
            let mut driver = open(json!({"model": model, "engine": engine})).unwrap();
            frames.iter().take(50).map(|(frame, _)| drive(&mut driver, frame).steering.to_bits()).collect()
        };
        let alone = steer();
        std::thread::scope(|scope| {
            let threads: Vec<_> = (0..4).map(|_| scope.spawn(steer)).collect();
            assert!(threads.into_iter().all(|thread| thread.join().unwrap() == alone));
        });
    }
}
