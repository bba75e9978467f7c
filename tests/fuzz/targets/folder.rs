//! Folders of images with records: names and content of two files, beside one image.

#![no_main]

use std::path::{Path, PathBuf};
use std::sync::LazyLock;

use libfuzzer_sys::fuzz_target;
use pdk_datasets::Folder;
use pdk_sdk::component::Component;
use pdk_sdk::config::Config;
use pdk_sdk::dataset::Dataset;
use serde_json::json;

/// A picture of 8 x 8 pixels.
const IMAGE: &[u8] = include_bytes!("../corpus/image/small.png");

static FOLDER: LazyLock<PathBuf> = LazyLock::new(|| pdk_fuzz::folder("folder"));

fuzz_target!(|data: &[u8]| {
    let mut parts = pdk_fuzz::parts(data);
    let mut written = Vec::new();
    let mut write = |name: &[u8], content: &[u8]| {
        let name: String =
            String::from_utf8_lossy(name).chars().filter(|c| *c != '/' && *c != '\0').take(40).collect();
        let path = FOLDER.join(name);
        if std::fs::write(&path, content).is_ok() {
            written.push(path);
        }
    };
    write(b"1_a.png", IMAGE);
    write(b"record_1.json", parts.next().unwrap_or_default());
    write(parts.next().unwrap_or_default(), IMAGE);
    write(parts.next().unwrap_or_default(), parts.next().unwrap_or_default());
    read(&FOLDER);
    for path in written {
        let _ = std::fs::remove_file(path);
    }
});

fn read(folder: &Path) {
    let parameters = json!({ "path": folder });
    let config =
        Config::check(&Folder::description(), parameters.as_object().expect("a table")).expect("parameters");
    let Ok(mut folder) = Folder::new(&config) else { return };
    for index in 0..folder.len() {
        assert!(
            folder.read(index).map_or(true, |entry| entry.steering.abs() <= 1.0 && entry.time.is_finite())
        );
        let _ = folder.name(index);
    }
}
