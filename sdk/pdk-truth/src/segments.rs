//! A class for each pixel of a picture, in a PNG file whose values stand for classes, and what a network says of them.

use std::path::Path;

use pdk_image::samples;
use pdk_metrics::segmentation::Pixels;
use pdk_sdk::error::{Error, Place, Result};
use pdk_sdk::file;
use serde::{Deserialize, Serialize};

use crate::beside::Beside;
use crate::map::{Map, nearest};

/// What stands for a value that is of no class.
const NO_CLASS: usize = usize::MAX;

/// Masks of pictures.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Segments {
    /// The files.
    pub labels: Beside,
    /// The value that stands for each class, in the order in which the network has them.
    pub values: Vec<u16>,
    /// The values of pixels that do not count.
    pub ignored: Ignored,
}

/// The values of pixels that do not count.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Ignored {
    /// These.
    Values(Vec<u16>),
    /// All that stand for no class.
    Others,
}

/// Reads a mask: its width, its height, and its values row by row.
///
/// # Errors
/// If it is not a PNG file, is damaged, or has several channels.
pub fn parse(bytes: &[u8]) -> Result<(usize, usize, Vec<u16>)> {
    let mask = samples::read(bytes)?;
    match mask.channels {
        1 => Ok((mask.width, mask.height, mask.values)),
        channels => Err(Error::new(format!(
            "it has {channels} channels, but has to have one, with a number for each class; a mask in colours has to be converted"
        ))),
    }
}

impl Segments {
    /// Counts the pixels of a picture's mask and of an output of this shape: scores with an axis for the classes, or classes. A pixel of
    /// the mask is compared with the place of the output around its centre.
    ///
    /// # Errors
    /// If the picture has no mask, the mask has a value that is neither a class nor ignored, or the output has another shape.
    pub fn compare(&self, picture: &str, shape: &[usize], values: &[f32]) -> Result<Pixels> {
        let path = self.labels.of(picture)?;
        let (width, height, mask) = read(&path).place(format_args!("mask {}", path.display()))?;
        let map = Map::new(shape, values, self.values.len())?;
        let said = classes(&map);
        let (columns, rows) = (nearest(width, map.width), nearest(height, map.height));
        let known = self.known(&mask).place(format_args!("mask {}", path.display()))?;
        let mut pixels = Pixels::new(self.values.len());
        for (row, labelled) in rows.iter().zip(mask.chunks_exact(width)) {
            for (column, value) in columns.iter().zip(labelled) {
                // What is ignored is of no class, and is not counted.
                pixels.add(said[row * map.width + column], known[usize::from(*value)]);
            }
        }
        Ok(pixels)
    }

    /// The class of each value, for the values of a mask.
    fn known(&self, mask: &[u16]) -> Result<Vec<usize>> {
        let mut known = vec![NO_CLASS; usize::from(u16::MAX) + 1];
        let mut allowed = vec![self.ignored == Ignored::Others; known.len()];
        for (class, value) in self.values.iter().enumerate() {
            (known[usize::from(*value)], allowed[usize::from(*value)]) = (class, true);
        }
        if let Ignored::Values(values) = &self.ignored {
            for value in values {
                (known[usize::from(*value)], allowed[usize::from(*value)]) = (NO_CLASS, true);
            }
        }
        match mask.iter().find(|value| !allowed[usize::from(**value)]) {
            Some(value) => Err(Error::new(format!(
                "it has the value {value}, which is none of the {} classes; name the values that do not count with `ignore`, or those of \
                 the classes with `values`",
                self.values.len()
            ))),
            None => Ok(known),
        }
    }
}

fn read(path: &Path) -> Result<(usize, usize, Vec<u16>)> {
    parse(&file::read(path, pdk_image::LARGEST_FILE)?)
}

/// The class at each place: the one with the highest score, the first of several. What is not a number is the lowest.
fn classes(map: &Map<'_>) -> Vec<usize> {
    let places = (0..map.height).flat_map(|y| (0..map.width).map(move |x| (x, y)));
    let class = |(x, y)| match map.channels() {
        1 => {
            let value = map.at(x, y, 0);
            if value >= 0.0 && value.fract() == 0.0 { value as usize } else { NO_CLASS }
        }
        channels => {
            let score = |channel| Some(map.at(x, y, channel)).filter(|score| !score.is_nan());
            let mut best = (0, score(0).unwrap_or(f32::NEG_INFINITY));
            for channel in 1..channels {
                match score(channel) {
                    Some(score) if score > best.1 => best = (channel, score),
                    _ => {}
                }
            }
            best.0
        }
    };
    places.map(class).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn png(width: u32, height: u32, color: png::ColorType, values: &[u8]) -> Vec<u8> {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, width, height);
        encoder.set_color(color);
        encoder.set_palette(vec![9; 768]);
        let mut writer = encoder.write_header().unwrap();
        writer.write_image_data(values).unwrap();
        writer.finish().unwrap();
        bytes
    }

    fn segments(folder: &Path, ignored: Ignored) -> Segments {
        let labels = Beside { folder: folder.to_owned(), endings: vec!["png".to_owned()], replace: None };
        Segments { labels, values: vec![0, 7], ignored }
    }

    #[test]
    fn pixels_are_compared_with_the_place_around_them() {
        let folder = tempfile::tempdir().unwrap();
        let mask = png(4, 2, png::ColorType::Indexed, &[0, 0, 7, 255, 7, 7, 7, 0]);
        std::fs::write(folder.path().join("a.png"), mask).unwrap();
        let of = segments(folder.path(), Ignored::Values(vec![255]));
        // Two places side by side: the first is of class 0, the second of class 1.
        let scores = [0.5, 0.1, 0.2, f32::NAN];
        for (shape, values) in [(&[1, 2, 1, 2][..], &scores[..]), (&[1, 1, 2], &[0.0, 1.0])] {
            let mut values = values.to_vec();
            if shape.len() == 4 {
                values[3] = 0.9;
            }
            let pixels = of.compare("a.jpg", shape, &values).unwrap();
            let expected = Pixels { right: vec![2, 2], predicted: vec![4, 3], labelled: vec![3, 4] };
            assert_eq!(pixels, expected, "{shape:?}");
        }
        let error =
            segments(folder.path(), Ignored::Values(Vec::new())).compare("a.jpg", &[1, 2], &[0.0, 1.0]);
        assert!(error.unwrap_err().message().contains("the value 255, which is none of the 2 classes"));
        assert!(segments(folder.path(), Ignored::Others).compare("a.jpg", &[1, 2], &[0.0, 1.0]).is_ok());
        assert!(of.compare("b.jpg", &[1, 2], &[0.0, 1.0]).unwrap_err().message().contains("has no label"));
    }

    #[test]
    fn a_mask_in_colours_is_refused() {
        let error = parse(&png(1, 1, png::ColorType::Rgb, &[1, 2, 3])).unwrap_err();
        assert!(error.message().starts_with("it has 3 channels"), "{error}");
    }
}
