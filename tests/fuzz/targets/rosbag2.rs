//! Bags of ROS 2 in SQLite: pages, rows and what is in their columns.

#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use pdk_datasets::Rosbag2;
use pdk_sdk::component::Component;
use pdk_sdk::config::Config;
use pdk_sdk::dataset::Dataset;
use serde_json::json;

static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = pdk_fuzz::folder("rosbag2");
    std::fs::write(folder.join("metadata.yaml"), "rosbag2_bagfile_information:\n").expect("a file");
    folder
});

fuzz_target!(|data: &[u8]| {
    std::fs::write(FOLDER.join("drive.db3"), data).expect("a file");
    let parameters = json!({ "path": *FOLDER, "tolerance": 1e6, "full_lock": 1e6 });
    let config =
        Config::check(&Rosbag2::description(), parameters.as_object().expect("a table")).expect("parameters");
    let Ok(mut bag) = Rosbag2::new(&config) else { return };
    for index in (0..bag.len()).rev().take(4) {
        assert!(bag.read(index).map_or(true, |entry| entry.is_plausible()));
        let _ = bag.name(index);
    }
});
