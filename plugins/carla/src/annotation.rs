//! What CARLA says of the pixels of its frames: what they show, and how far away that is.
//!
//! Both come from cameras of their own beside the one whose frames are driven by, with the same place and optics. The pixels of one
//! have a tag in red, those of the other a distance in all three colours.

use pdk_sdk::prelude::{Error, Result};

use crate::server::Version;

/// The camera whose pixels say what they show.
pub const LABELS: &str = "sensor.camera.semantic_segmentation";
/// The camera whose pixels say how far away that is.
pub const DEPTH: &str = "sensor.camera.depth";

/// What can be told apart, in all versions alike.
pub const NAMES: [&str; 18] = [
    "other",
    "road",
    "sidewalk",
    "building",
    "wall",
    "fence",
    "pole",
    "traffic_light",
    "traffic_sign",
    "vegetation",
    "ground",
    "sky",
    "pedestrian",
    "vehicle",
    "marking",
    "bridge",
    "guard_rail",
    "water",
];

/// The places among the names of CARLA's tags, from tag 0, as the official clients of 0.9.13 name them.
const TAGS_0_9_13: [u8; 23] = [0, 3, 5, 0, 12, 6, 14, 1, 2, 9, 13, 4, 8, 11, 10, 15, 0, 16, 7, 0, 0, 17, 10];
/// As those of 0.9.14 to 0.9.16 name them. Riders are pedestrians; cars, lorries, buses, trains and cycles are vehicles.
const TAGS: [u8; 29] =
    [0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 12, 13, 13, 13, 13, 13, 13, 0, 0, 0, 17, 14, 10, 15, 0, 16];
/// The distance in metres that the largest number stands for. What is as far as that is the sky.
const FARTHEST: f64 = 1000.0;
const LARGEST: u32 = (1 << 24) - 1;

/// Writes the place among the names for each pixel, red, green and blue, of a server of this version.
///
/// # Errors
/// If there is another number of pixels.
pub fn labels(pixels: &[u8], version: Version, into: &mut [u8]) -> Result<()> {
    fits(pixels, into.len())?;
    let tags: &[u8] = if version < Version::CITYSCAPES { &TAGS_0_9_13 } else { &TAGS };
    for (pixel, label) in pixels.chunks_exact(3).zip(into) {
        // A tag that was added to CARLA's own is something else.
        *label = tags.get(usize::from(pixel[0])).copied().unwrap_or(0);
    }
    Ok(())
}

/// Writes the distance in metres for each pixel, red, green and blue; infinite for the sky.
///
/// # Errors
/// If there is another number of pixels.
pub fn depth(pixels: &[u8], into: &mut [f32]) -> Result<()> {
    fits(pixels, into.len())?;
    for (pixel, distance) in pixels.chunks_exact(3).zip(into) {
        let number = u32::from_le_bytes([pixel[0], pixel[1], pixel[2], 0]);
        *distance = match number {
            LARGEST => f32::INFINITY,
            number => (f64::from(number) / f64::from(LARGEST) * FARTHEST) as f32,
        };
    }
    Ok(())
}

fn fits(pixels: &[u8], given: usize) -> Result<()> {
    match pixels.len() == 3 * given {
        true => Ok(()),
        false => Err(Error::new(format!(
            "it was given room for {given} pixels, but its frames have {}",
            pixels.len() / 3
        ))),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The names in the official clients' `CityObjectLabel`, in the order of their numbers.
    const CLIENT_0_9_13: &str = "none building fence other pedestrian pole marking road sidewalk vegetation vehicle wall \
         traffic_sign sky ground bridge rail_track guard_rail traffic_light static dynamic water terrain";
    const CLIENT: &str = "none road sidewalk building wall fence pole traffic_light traffic_sign vegetation terrain sky \
         pedestrian rider car truck bus train motorcycle bicycle static dynamic other water marking ground bridge rail_track \
         guard_rail";

    #[test]
    fn tags_of_all_versions_have_the_same_names() {
        for (version, client) in [("0.9.13", CLIENT_0_9_13), ("0.9.14", CLIENT), ("0.9.16", CLIENT)] {
            let tags: Vec<&str> = client.split_whitespace().collect();
            let pixels: Vec<u8> = (0..tags.len() as u8 + 1).flat_map(|tag| [tag, 9, 9]).collect();
            let mut labels = vec![255; tags.len() + 1];
            super::labels(&pixels, version.parse().unwrap(), &mut labels).unwrap();
            for (tag, label) in tags.iter().zip(&labels) {
                let name = match *tag {
                    "none" | "other" | "static" | "dynamic" | "rail_track" => "other",
                    "terrain" => "ground",
                    "rider" => "pedestrian",
                    "car" | "truck" | "bus" | "train" | "motorcycle" | "bicycle" => "vehicle",
                    same => same,
                };
                assert_eq!(NAMES[usize::from(*label)], name, "{version}: {tag}");
            }
            assert_eq!(labels.last(), Some(&0));
        }
        let error = super::labels(&[0; 6], Version::SPOKEN[1], &mut [0; 3]).unwrap_err();
        assert!(error.message().contains("room for 3 pixels"), "{error}");
    }

    #[test]
    fn distances_are_read_from_three_colours() {
        let mut into = [0.0; 4];
        depth(&[0, 0, 0, 255, 255, 255, 0, 0, 1, 1, 0, 0], &mut into).unwrap();
        assert_eq!(into[0], 0.0);
        assert_eq!(into[1], f32::INFINITY);
        assert!((into[2] - 1000.0 * 65536.0 / 16_777_215.0).abs() < 1e-4, "{}", into[2]);
        assert!((into[3] - 1000.0 / 16_777_215.0).abs() < 1e-9);
    }
}
