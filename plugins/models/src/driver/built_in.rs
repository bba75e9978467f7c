//! The networks that are part of this plugin, by their names.

use super::dave2::Dave2;
use super::dave2_augmented::Dave2Augmented;
use super::dave2_hardened::Dave2Hardened;
use super::dave2_quantised::Dave2Quantised;
use super::dave2_temporal::Dave2Temporal;
use super::dave2_tub::Dave2Tub;
use super::transformer::Transformer;
use super::waypoint_planner::WaypointPlanner;

const ALL: [(&str, &[u8]); 8] = [
    (Dave2::NAME, Dave2::CONTENT),
    (Dave2Augmented::NAME, Dave2Augmented::CONTENT),
    (Dave2Hardened::NAME, Dave2Hardened::CONTENT),
    (Dave2Quantised::NAME, Dave2Quantised::CONTENT),
    (Dave2Temporal::NAME, Dave2Temporal::CONTENT),
    (Dave2Tub::NAME, Dave2Tub::CONTENT),
    (Transformer::NAME, Transformer::CONTENT),
    (WaypointPlanner::NAME, WaypointPlanner::CONTENT),
];

/// The content of the file of the network that drives under this name; nothing if it is none of these.
pub fn content(name: &str) -> Option<&'static [u8]> {
    ALL.iter().find(|(known, _)| *known == name).map(|(_, content)| *content)
}

#[cfg(test)]
mod tests {
    use pdk_sdk::prelude::*;
    use pdk_sdk::serde_json::{Map, Value, json};

    use super::*;
    use crate::driver::onnx::Onnx;

    #[test]
    fn a_network_drives_as_the_file_that_it_was_made_from() {
        let file = concat!(env!("CARGO_MANIFEST_DIR"), "/../../scripts/models/dave2.onnx");
        let given = Map::from_iter([("model".to_owned(), file.into()), ("engine".to_owned(), "pdk".into())]);
        let mut from_file = Onnx::new(&Config::check(&Onnx::description(), &given).unwrap()).unwrap();
        let given = Map::from_iter([("engine".to_owned(), "pdk".into())]);
        let mut own = Dave2::new(&Config::check(&Dave2::description(), &given).unwrap()).unwrap();
        let pixels = (0..320 * 160 * 3).map(|i| (i * 31 % 251) as u8).collect();
        let frame = FrameBuf::from_vec(pixels, 320, 160).unwrap();
        let cx = DriveContext { speed: 7.0, ..DriveContext::default() };
        let expected = from_file.drive(frame.as_ref(), &cx).unwrap();
        assert_eq!(own.drive(frame.as_ref(), &cx).unwrap(), expected);
        assert!(expected.steering != 0.0, "a test that tells: {expected:?}");
        // Without a speed it says what to do, and a constant one stands for it.
        let unknown = DriveContext { speed: f64::NAN, ..cx };
        let error = own.drive(frame.as_ref(), &unknown).unwrap_err().to_string();
        assert!(
            error.contains("driver = { name = \"dave2\", speed = 8 } or --set driver.speed=8"),
            "{error}"
        );
        let assuming = |speed: Value| {
            let given = Map::from_iter([("speed".to_owned(), speed), ("engine".to_owned(), "pdk".into())]);
            Dave2::new(&Config::check(&Dave2::description(), &given).unwrap())
        };
        assert_eq!(assuming(json!(7)).unwrap().drive(frame.as_ref(), &unknown).unwrap(), expected);
        for wrong in [json!(-1), json!("fast")] {
            assert!(assuming(wrong).err().unwrap().to_string().contains("has to be a number of m/s"));
        }
        let hash = blake3::hash(&std::fs::read(file).unwrap()).to_hex().to_string();
        assert!(own.info().contains(&("network BLAKE3".to_owned(), hash)));
    }

    #[test]
    fn the_hashes_that_are_written_down_are_those_of_the_networks() {
        let all = [
            Dave2::description(),
            Dave2Augmented::description(),
            Dave2Hardened::description(),
            Dave2Quantised::description(),
            Dave2Temporal::description(),
            Dave2Tub::description(),
            Transformer::description(),
            WaypointPlanner::description(),
        ];
        for description in all {
            let hash = blake3::hash(content(&description.name).unwrap()).to_hex().to_string();
            assert_eq!(description.blake3, hash, "write the hash of `{}` down anew", description.name);
        }
    }
}
