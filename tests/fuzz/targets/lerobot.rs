//! Recordings of LeRobot: `meta/info.json`, and a Parquet file with the columns of frames and those of episodes.

#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use pdk_datasets::LeRobot;
use pdk_sdk::component::Component;
use pdk_sdk::config::Config;
use pdk_sdk::dataset::Dataset;
use serde_json::json;

/// A video of H.264.
const VIDEO: &[u8] = include_bytes!("../corpus/mp4/small.mp4");

static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
    // The library that reads Parquet panics on some damaged files, which is caught: so a panic is not a finding by itself, but one
    // that comes through is.
    std::panic::set_hook(Box::new(|_| {}));
    let folder = pdk_fuzz::folder("lerobot");
    for inside in ["meta/episodes/a", "data/a"] {
        std::fs::create_dir_all(folder.join(inside)).expect("a folder");
    }
    std::fs::write(folder.join("v.mp4"), VIDEO).expect("a video");
    folder
});

fuzz_target!(|data: &[u8]| {
    // Bytes of Parquet may be any, so that only the first of these divides.
    let mut parts = data.splitn(2, |byte| *byte == 0xff);
    let mut write = |names: &[&str]| {
        let part = parts.next().unwrap_or_default();
        names.iter().for_each(|name| std::fs::write(FOLDER.join(name), part).expect("a file"));
    };
    write(&["meta/info.json"]);
    write(&["meta/episodes/a/f.parquet", "data/a/f.parquet"]);
    let parameters = json!({ "path": *FOLDER, "full_lock": 1e6 });
    let config =
        Config::check(&LeRobot::description(), parameters.as_object().expect("a table")).expect("parameters");
    let Ok(mut recording) = LeRobot::new(&config) else { return };
    for index in (0..recording.len()).rev().take(4) {
        assert!(recording.read(index).map_or(true, |entry| entry.is_plausible()));
        let _ = (recording.name(index), recording.position(index));
    }
});
