//! What the tests of this crate share.

use std::path::{Path, PathBuf};

use image::{ImageFormat, Rgb, RgbImage};
use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::Value;

/// The checked configuration of a component.
pub fn config<T: Component>(given: Value) -> Config {
    Config::check(&T::description(), given.as_object().unwrap()).unwrap()
}

/// A picture with structure in every block, so that losing any part of it shows.
pub fn picture(width: u32, height: u32) -> RgbImage {
    RgbImage::from_fn(width, height, |x, y| {
        Rgb([(x * 37 + y * 11) as u8, ((x * 5) ^ (y * 29)) as u8, !(x * 13 + y * 7) as u8])
    })
}

/// Writes a picture in the format that its name says.
pub fn image(path: &Path, width: u32, height: u32) {
    picture(width, height).save(path).unwrap();
}

/// Writes a JPEG.
pub fn jpeg(path: &Path, width: u32, height: u32) {
    picture(width, height).save_with_format(path, ImageFormat::Jpeg).unwrap();
}

/// A file or folder of the data that lies outside the repository; says so if it is not there.
pub fn shared(name: &str) -> Option<PathBuf> {
    let root = std::env::var_os("PDK_TEST_DATA")
        .map(PathBuf::from)
        .unwrap_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared"));
    let found = [root.join(name), root.join("data").join(name)].into_iter().find(|path| path.exists());
    if found.is_none() {
        println!("skipped: there is no `{name}` under {}", root.display());
    }
    found
}
