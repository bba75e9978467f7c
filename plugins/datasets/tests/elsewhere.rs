//! Recordings that other programs wrote: those in `written` everywhere, and fresh ones where the programs are installed.
//!
//! `PDK_TEST_PYTHON` names a Python with numpy, Pillow and as many as possible of pandas, mcap-ros2-support,
//! mcap-protobuf-support, foxglove-schemas-protobuf, rosbags, pyarrow and donkeycar.

#![allow(clippy::unwrap_used)]

use std::path::Path;
use std::process::{Command, Stdio};

use pdk_datasets::{Comma2k19, Csv, Folder, LeRobot, Mcap, Rosbag2, Tub, Video};
use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::{self, Value, json};

const SIZE: (usize, usize) = (32, 16);

fn open<T: Component + Dataset + 'static>(path: &Path, given: &Value) -> Result<Box<dyn Dataset>> {
    let mut given = given.as_object().unwrap().clone();
    given.insert("path".to_owned(), json!(path));
    let config = Config::check(&T::description(), &given)?;
    T::input_files(&config)?;
    Ok(Box::new(T::new(&config)?))
}

/// The mean difference from what `elsewhere.py` draws as the picture of this number.
fn off(frame: &FrameBuf, number: usize) -> f64 {
    assert_eq!((frame.width(), frame.height()), SIZE);
    let pixel = |i: usize| [i % SIZE.0 * 8, i / SIZE.0 * 16, number * 40];
    let drawn = (0..SIZE.0 * SIZE.1).flat_map(pixel);
    let sum: u64 =
        frame.data().iter().zip(drawn).map(|(read, drawn)| u64::from(read.abs_diff(drawn as u8))).sum();
    sum as f64 / frame.data().len() as f64
}

/// Reads everything that a folder's `expected.json` lists. Returns how many recordings there are.
fn check(folder: &Path, has_ffmpeg: bool) -> usize {
    let text = std::fs::read_to_string(folder.join("expected.json")).unwrap();
    let listed: Value = serde_json::from_str(&text).unwrap();
    for (part, why) in listed["left_out"].as_object().unwrap() {
        println!("skipped: {part}: {why}");
    }
    let mut count = 0;
    for (name, expected) in listed["expected"].as_object().unwrap() {
        let path = folder.join(expected["path"].as_str().unwrap());
        let parameters = &expected["parameters"];
        let foreign =
            ["mkv", "avi", "webm", "comma2k19", "lerobot_3"].iter().any(|ending| name.ends_with(ending));
        if foreign && !has_ffmpeg {
            println!("skipped: {name}: no ffmpeg on the PATH");
            continue;
        }
        let opened = match expected["reader"].as_str().unwrap() {
            "comma2k19" => open::<Comma2k19>(&path, parameters),
            "lerobot" => open::<LeRobot>(&path, parameters),
            "csv" => open::<Csv>(&path, parameters),
            "folder" => open::<Folder>(&path, parameters),
            "mcap" => open::<Mcap>(&path, parameters),
            "rosbag2" => open::<Rosbag2>(&path, parameters),
            "tub" => open::<Tub>(&path, parameters),
            "video" => open::<Video>(&path, parameters),
            other => panic!("no reader {other}"),
        };
        let mut dataset = opened.unwrap_or_else(|error| panic!("{name}: {error}"));
        let frames = expected["frames"].as_array().unwrap();
        assert_eq!(dataset.len(), frames.len(), "{name}");
        // Backwards as well, so that it is read in any order.
        for index in (0..frames.len()).chain((0..frames.len()).rev()) {
            let entry = dataset.read(index).unwrap_or_else(|error| panic!("{name} {index}: {error}"));
            let frame = &frames[index];
            let values = [
                ("time", entry.time),
                ("steering", entry.steering),
                ("throttle", entry.throttle),
                ("speed", entry.speed),
            ];
            for (what, read) in values {
                match frame.get(what).and_then(Value::as_f64) {
                    Some(wanted) => {
                        assert!((read - wanted).abs() < 1e-6, "{name} {index} {what}: {read}, not {wanted}")
                    }
                    None => assert!(
                        read.is_nan() || what == "time",
                        "{name} {index} {what}: {read}, and none was recorded"
                    ),
                }
            }
            assert!((dataset.position(index).time - entry.time).abs() < 1e-9, "{name} {index}");
            let number = frame["picture"].as_u64().unwrap() as usize;
            let (off, most) = (off(&entry.frame, number), expected["off"].as_f64().unwrap());
            assert!(off <= most, "{name} {index}: pixels are {off} off on average");
        }
        println!("{name}: {} frames", dataset.len());
        count += 1;
    }
    count
}

fn runs(program: &str, arguments: &[&str]) -> bool {
    let status = Command::new(program).args(arguments).stdout(Stdio::null()).stderr(Stdio::null()).status();
    status.is_ok_and(|status| status.success())
}

#[test]
fn recordings_that_other_programs_wrote_are_read() {
    let written = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/written");
    let has_ffmpeg = runs("ffmpeg", &["-version"]);
    assert_eq!(check(&written, has_ffmpeg), 13 + 2 * usize::from(has_ffmpeg));
}

#[test]
fn recordings_that_other_programs_write_now_are_read() {
    let python = std::env::var("PDK_TEST_PYTHON").unwrap_or_else(|_| "python3".to_owned());
    if !runs(&python, &["-c", "import numpy, PIL"]) {
        println!("skipped: {python} has no numpy and Pillow (set PDK_TEST_PYTHON)");
        return;
    }
    let folder = tempfile::tempdir().unwrap();
    let script = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/elsewhere.py");
    assert!(Command::new(&python).arg(script).arg(folder.path()).status().unwrap().success());
    println!("{} recordings", check(folder.path(), true));
}
