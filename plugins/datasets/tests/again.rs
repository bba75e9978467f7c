//! Recordings that other programs wrote, written again by their readers: the pictures are others, and all else is as it was.

#![allow(clippy::unwrap_used)]

use std::collections::BTreeMap;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use pdk_datasets::{Comma2k19, LeRobot, Mcap, Rosbag2, Video};
use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::{self, Value, json};

/// All files of a folder, by their paths in it.
fn files(folder: &Path) -> BTreeMap<PathBuf, Vec<u8>> {
    let mut found = BTreeMap::new();
    let mut left = vec![folder.to_owned()];
    while let Some(here) = left.pop() {
        for entry in fs::read_dir(here).unwrap() {
            let path = entry.unwrap().path();
            match path.is_dir() {
                true => left.push(path),
                false => {
                    found.insert(path.strip_prefix(folder).unwrap().to_owned(), fs::read(&path).unwrap());
                }
            }
        }
    }
    found
}

fn open(reader: &str, path: &Path, parameters: &Value) -> Result<Box<dyn Dataset>> {
    fn of<T: Component + Dataset + 'static>(path: &Path, given: &Value) -> Result<Box<dyn Dataset>> {
        let mut given = given.as_object().unwrap().clone();
        given.insert("path".to_owned(), json!(path));
        Ok(Box::new(T::new(&Config::check(&T::description(), &given)?)?))
    }
    match reader {
        "comma2k19" => of::<Comma2k19>(path, parameters),
        "lerobot" => of::<LeRobot>(path, parameters),
        "mcap" => of::<Mcap>(path, parameters),
        "rosbag2" => of::<Rosbag2>(path, parameters),
        "video" => of::<Video>(path, parameters),
        other => panic!("no reader {other}"),
    }
}

/// Writes a recording to a folder, negative and, if its form allows that, as if mirrored. Returns whether that is so.
fn negative(dataset: &mut dyn Dataset, into: &Path) -> bool {
    let form = dataset.form().unwrap().unwrap();
    if form.whole {
        for (name, content) in files(&form.folder) {
            fs::create_dir_all(into.join(&name).parent().unwrap()).unwrap();
            fs::write(into.join(name), content).unwrap();
        }
    }
    let turned = form.unturned.is_none();
    for FormFile { name, frames, stored } in form.files {
        assert_eq!(frames > 0, !stored.is_empty(), "{name}");
        let mirrored = if turned { vec![true; dataset.len()] } else { Vec::new() };
        let wanted = Rewrite { file: name.clone(), into: into.join(&name), quality: 95, mirrored };
        let mut seen = 0;
        dataset
            .rewrite(&wanted, &mut |_, source, mut target| {
                seen += 1;
                let pixels: Vec<u8> = source.to_buf().into_vec().into_iter().map(|value| !value).collect();
                target.copy_from(Frame::new(&pixels, source.width(), source.height()).unwrap());
                Ok(())
            })
            .unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!(seen, frames, "{name}");
    }
    turned
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn recordings_are_written_in_the_form_that_they_have() {
    let written = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/written");
    let has_ffmpeg = Command::new("ffmpeg").arg("-version").output().is_ok();
    let listed: Value =
        serde_json::from_str(&fs::read_to_string(written.join("expected.json")).unwrap()).unwrap();
    let mut count = 0;
    for (name, expected) in listed["expected"].as_object().unwrap() {
        let (reader, parameters) = (expected["reader"].as_str().unwrap(), &expected["parameters"]);
        if reader == "csv" {
            continue;
        }
        if matches!(name.as_str(), "comma2k19" | "lerobot_3") && !has_ffmpeg {
            println!("skipped: {name}: no ffmpeg on the PATH");
            continue;
        }
        let path = written.join(expected["path"].as_str().unwrap());
        let mut before = open(reader, &path, parameters).unwrap();
        let copy = tempfile::tempdir().unwrap();
        let turned = negative(before.as_mut(), copy.path());
        let place = match path.is_file() {
            true => copy.path().join(path.file_name().unwrap()),
            false => copy.path().to_owned(),
        };
        let mut after = open(reader, &place, parameters).unwrap_or_else(|error| panic!("{name}: {error}"));
        assert_eq!((before.len(), before.info().len()), (after.len(), after.info().len()), "{name}");
        let is_lossy = expected["off"].as_f64().unwrap() > 0.0;
        for index in 0..before.len() {
            let (old, new) = (before.read(index).unwrap(), after.read(index).unwrap());
            let off: u64 = old
                .frame
                .data()
                .iter()
                .zip(new.frame.data())
                .map(|(a, b)| u64::from((!a).abs_diff(*b)))
                .sum();
            let off = off as f64 / old.frame.data().len() as f64;
            assert!(if is_lossy { off < 8.0 } else { off == 0.0 }, "{name} {index}: {off}");
            let steering = if turned { -old.steering } else { old.steering };
            let pairs = [
                (old.time, new.time),
                (steering, new.steering),
                (old.throttle, new.throttle),
                (old.speed, new.speed),
            ];
            // What was not recorded is not a number.
            assert!(
                pairs.iter().all(|(a, b)| a == b || a.is_nan() && b.is_nan()),
                "{name} {index}: {pairs:?}"
            );
        }
        // The same bytes again.
        let again = tempfile::tempdir().unwrap();
        negative(before.as_mut(), again.path());
        assert!(files(copy.path()) == files(again.path()), "{name}");
        println!("{name}: {} frames", before.len());
        count += 1;
    }
    assert_eq!(count, 12 + 2 * usize::from(has_ffmpeg));
}

#[test]
fn messages_of_other_topics_stay_as_they_are() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/written/ros2.mcap");
    let parameters = json!({"image": "/png", "full_lock": -1});
    let copy = tempfile::tempdir().unwrap();
    let mut dataset = open("mcap", &path, &parameters).unwrap();
    let notes = dataset.form().unwrap().unwrap().notes;
    assert!(notes[0].contains("/bgr8") && notes[0].contains("`image`"), "{notes:?}");
    negative(dataset.as_mut(), copy.path());
    let messages = |path: &Path| {
        let content = fs::read(path).unwrap();
        let all = mcap::MessageStream::new(&content).unwrap().map(|message| message.unwrap());
        let key = |message: mcap::Message<'_>| {
            let mcap::Message { channel, sequence, log_time, publish_time, data } = message;
            let schema =
                channel.schema.as_ref().map(|schema| (schema.id, schema.name.clone(), schema.data.to_vec()));
            let channel = (
                channel.id,
                channel.topic.clone(),
                channel.message_encoding.clone(),
                channel.metadata.clone(),
            );
            ((channel, schema, sequence, log_time, publish_time), data.into_owned())
        };
        all.map(key).collect::<Vec<_>>()
    };
    let (before, after) = (messages(&path), messages(&copy.path().join("ros2.mcap")));
    assert!(before.len() > 20 && before.len() == after.len());
    let mut changed = BTreeMap::new();
    for ((about, old), (same, new)) in before.iter().zip(&after) {
        assert_eq!(about, same);
        if old != new {
            *changed.entry(about.0.1.as_str()).or_insert(0) += 1;
        }
    }
    assert_eq!(changed.get("/png"), Some(&6));
    assert!(changed.len() == 2 && changed.keys().any(|topic| *topic != "/png"), "{changed:?}");
}
