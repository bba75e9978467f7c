//! MCAP files with pictures and numbers: records, chunks, and messages of every kind.

#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use pdk_datasets::Mcap;
use pdk_sdk::component::Component;
use pdk_sdk::config::Config;
use pdk_sdk::dataset::Dataset;
use serde_json::json;

static FILE: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = pdk_fuzz::folder("mcap");
    std::fs::create_dir_all(&folder).expect("a folder");
    folder.join("drive.mcap")
});

fuzz_target!(|data: &[u8]| {
    std::fs::write(&*FILE, data).expect("a file");
    let parameters = json!({ "path": *FILE, "tolerance": 1e6, "full_lock": 1e6 });
    let config =
        Config::check(&Mcap::description(), parameters.as_object().expect("a table")).expect("parameters");
    let Ok(mut mcap) = Mcap::new(&config) else { return };
    for index in (0..mcap.len()).rev().take(4) {
        assert!(mcap.read(index).map_or(true, |entry| entry.is_plausible()));
    }
});
