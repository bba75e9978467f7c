//! Small recordings in the formats that pdk reads.

use std::path::Path;

use serde_json::json;

use crate::pictures;

/// The recorded steering of frame `number`.
pub fn steering(number: u32) -> f64 {
    f64::from(number % 7) / 10.0 - 0.3
}

/// A folder of `count` images with one record each.
///
/// # Panics
/// If it cannot be written.
pub fn folder(path: &Path, count: u32, width: u32, height: u32) {
    std::fs::create_dir_all(path).unwrap();
    for number in 0..count {
        pictures::road(width, height, number).save(path.join(format!("{number}_camera.jpg"))).unwrap();
        let record = json!({ "user/angle": steering(number), "user/throttle": 0.4 });
        std::fs::write(path.join(format!("record_{number}.json")), record.to_string()).unwrap();
    }
}

/// A DonkeyCar tub, version 2, of `count` images.
///
/// # Panics
/// If it cannot be written.
pub fn tub(path: &Path, count: u32, width: u32, height: u32) {
    std::fs::create_dir_all(path.join("images")).unwrap();
    let mut catalog = String::new();
    for number in 0..count {
        let name = format!("{number}_cam_image_array_.jpg");
        pictures::road(width, height, number).save(path.join("images").join(&name)).unwrap();
        let record = json!({
            "_index": number, "_timestamp_ms": 1_000 + 50 * number, "cam/image_array": name,
            "user/angle": steering(number), "user/throttle": 0.4,
        });
        catalog += &format!("{record}\n");
    }
    std::fs::write(path.join("catalog_0.catalog"), catalog).unwrap();
    let listing = json!({ "paths": ["catalog_0.catalog"], "current_index": count, "deleted_indexes": [] });
    let manifest =
        format!("[\"cam/image_array\"]\n[\"image_array\"]\n{{}}\n{{\"created_at\": 1.0}}\n{listing}\n");
    std::fs::write(path.join("manifest.json"), manifest).unwrap();
}
