//! DonkeyCar tubs: the manifest and a catalog, beside one image.

#![no_main]

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use pdk_datasets::Tub;
use pdk_sdk::component::Component;
use pdk_sdk::config::Config;
use pdk_sdk::dataset::Dataset;
use serde_json::json;

/// A picture of 8 x 8 pixels.
const IMAGE: &[u8] = include_bytes!("../corpus/image/small.png");

static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| {
    let folder = pdk_fuzz::folder("tub");
    std::fs::create_dir_all(folder.join("images")).expect("a folder");
    std::fs::write(folder.join("images/0.png"), IMAGE).expect("an image");
    folder
});

fuzz_target!(|data: &[u8]| {
    let mut parts = pdk_fuzz::parts(data);
    let write = |name: &str, text: &[u8]| std::fs::write(FOLDER.join(name), text).expect("a file");
    write("manifest.json", parts.next().unwrap_or_default());
    write("c.catalog", parts.next().unwrap_or_default());
    read(&FOLDER);
});

fn read(folder: &Path) {
    let parameters = json!({ "path": folder });
    let config =
        Config::check(&Tub::description(), parameters.as_object().expect("a table")).expect("parameters");
    let Ok(mut tub) = Tub::new(&config) else { return };
    for index in 0..tub.len().min(4) {
        assert!(tub.read(index).map_or(true, |entry| entry.steering.abs() <= 1.0 && entry.time.is_finite()));
        let _ = tub.name(index);
    }
}
