//! CSV files beside one image: the table, and the columns that are guessed.

#![no_main]

use std::path::PathBuf;
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use pdk_datasets::Csv;
use pdk_sdk::component::Component;
use pdk_sdk::config::Config;
use pdk_sdk::dataset::Dataset;
use serde_json::json;

/// A picture of 8 x 8 pixels.
const IMAGE: &[u8] = include_bytes!("../corpus/image/small.png");

static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = pdk_fuzz::folder("csv");
    std::fs::create_dir_all(folder.join("IMG")).expect("a folder");
    std::fs::write(folder.join("IMG/0.png"), IMAGE).expect("an image");
    folder
});

fuzz_target!(|data: &[u8]| {
    std::fs::write(FOLDER.join("log.csv"), data).expect("a file");
    let parameters = json!({ "path": *FOLDER });
    let config =
        Config::check(&Csv::description(), parameters.as_object().expect("a table")).expect("parameters");
    let Ok(mut csv) = Csv::new(&config) else { return };
    for index in 0..csv.len().min(4) {
        assert!(csv.read(index).map_or(true, |entry| entry.is_plausible() && !(entry.steering.abs() > 1.0)));
        let _ = csv.name(index);
    }
});
