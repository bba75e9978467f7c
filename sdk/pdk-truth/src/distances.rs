//! A distance for each pixel of a picture, in a PNG file or an array of numpy, and what a network says of them.

use std::path::Path;

use pdk_image::samples;
use pdk_metrics::depth::{DepthErrors, errors, median_factor};
use pdk_sdk::error::{Error, ErrorKind, Place, Result};
use pdk_sdk::file;
use serde::{Deserialize, Serialize};

use crate::beside::Beside;
use crate::map::{Map, nearest};
use crate::npy;

/// Bytes of an array.
const LARGEST: u64 = 1 << 30;

/// Measured distances.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct Distances {
    /// The files.
    pub labels: Beside,
    /// The distance that 1 stands for in a file. Those of numpy have distances if it is not set.
    pub unit: Option<f64>,
    /// The smallest distance that counts. Smaller predictions count as this.
    pub nearest: f64,
    /// The largest distance that counts. Larger predictions count as this.
    pub farthest: f64,
    /// Whether predictions are known up to a factor, which gives them the median of what was measured.
    pub median: bool,
}

/// Rows of distances.
struct Measured {
    width: usize,
    height: usize,
    values: Vec<f64>,
}

impl Distances {
    /// The errors of an output of this shape. What was measured as 0, or not at all, does not count. A measured pixel is compared with
    /// the place of the output around its centre.
    ///
    /// # Errors
    /// If the picture has no file, nothing in it counts, or the output has another shape or is not finite where something was measured.
    pub fn compare(&self, picture: &str, shape: &[usize], values: &[f32]) -> Result<DepthErrors> {
        let path = self.labels.of(picture)?;
        let place = || format!("label {}", path.display());
        let Measured { width, height, values: measured } = self.read(&path).place(place())?;
        let map = Map::new(shape, values, 1)?;
        let (columns, rows) = (nearest(width, map.width), nearest(height, map.height));
        let mut pixels = Vec::new();
        for (row, measured) in rows.iter().zip(measured.chunks_exact(width.max(1))) {
            for (column, measured) in columns.iter().zip(measured) {
                // What is not a number is in no range.
                if *measured > 0.0 && (self.nearest..=self.farthest).contains(measured) {
                    pixels.push((f64::from(map.at(*column, *row, 0)), *measured));
                }
            }
        }
        if pixels.is_empty() {
            let sentence = format!("it has no distance from {} to {}", self.nearest, self.farthest);
            return Err(Error::new(sentence).at(place()));
        }
        if let Some((wrong, _)) = pixels.iter().find(|(predicted, _)| !predicted.is_finite()) {
            return Err(Error::of(ErrorKind::Nonsense, format!("it gave {wrong} as a distance")));
        }
        let factor = match self.median {
            true => median_factor(&pixels).ok_or_else(|| {
                Error::of(
                    ErrorKind::Nonsense,
                    "the median of its distances is not positive, so that no factor fits",
                )
            })?,
            false => 1.0,
        };
        pixels.iter_mut().for_each(|(predicted, _)| {
            *predicted = (*predicted * factor).clamp(self.nearest, self.farthest);
        });
        errors(&pixels).ok_or_else(|| Error::new("it has no pixels"))
    }

    fn read(&self, path: &Path) -> Result<Measured> {
        let bytes = file::read(path, LARGEST)?;
        self.parse(&bytes, path.extension().is_some_and(|ending| ending == "npy"))
    }

    fn parse(&self, bytes: &[u8], of_numpy: bool) -> Result<Measured> {
        let (width, height, mut values) = match of_numpy {
            true => {
                let npy::Array { shape, values } = npy::read(bytes)?;
                let sides: Vec<usize> = shape.iter().copied().filter(|side| *side != 1).collect();
                match (shape.as_slice(), sides.as_slice()) {
                    ([height, width], _) | (_, [height, width]) => (*width, *height, values),
                    _ => {
                        return Err(Error::new(format!(
                            "it has the shape {shape:?}, but has to have rows and columns"
                        )));
                    }
                }
            }
            false => {
                let read = samples::read(bytes)?;
                if read.channels != 1 {
                    let channels = read.channels;
                    return Err(Error::new(format!("it has {channels} channels, but has to have one")));
                }
                (read.width, read.height, read.values.into_iter().map(f64::from).collect())
            }
        };
        let unit = self.unit.or(of_numpy.then_some(1.0)).ok_or_else(|| {
            Error::new("the unit of its values is not known; set `unit` of the task to the metres that 1 stands for, such as 1/256 or 0.001")
        })?;
        values.iter_mut().for_each(|value| *value *= unit);
        Ok(Measured { width, height, values })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn distances(folder: &Path) -> Distances {
        let labels = Beside {
            folder: folder.to_owned(),
            endings: ["png", "npy"].map(str::to_owned).to_vec(),
            replace: None,
        };
        Distances { labels, unit: Some(0.5), nearest: 1e-3, farthest: 80.0, median: false }
    }

    fn array(path: &Path, values: [f32; 4]) {
        let head = "{'descr': '<f4', 'fortran_order': False, 'shape': (2, 2), }\n";
        let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
        bytes.extend((head.len() as u16).to_le_bytes());
        bytes.extend(head.as_bytes());
        bytes.extend(values.map(f32::to_le_bytes).concat());
        std::fs::write(path, bytes).unwrap();
    }

    #[test]
    fn what_was_measured_counts_and_the_rest_does_not() {
        let folder = tempfile::tempdir().unwrap();
        array(&folder.path().join("a.npy"), [2.0, 8.0, f32::NAN, 200.0]);
        let of = distances(folder.path());
        // 1 m and 4 m were measured; 100 m is too far.
        let found = of.compare("a.png", &[1, 1, 2, 2], &[1.0, 2.0, 7.0, 7.0]).unwrap();
        assert!((found.absolute_relative - 0.25).abs() < 1e-12 && (found.near - 0.5).abs() < 1e-12);
        let median = Distances { median: true, ..of.clone() };
        let found = median.compare("a.png", &[2, 2], &[0.1, 0.4, 0.0, 0.0]).unwrap();
        assert!(found.absolute_relative < 1e-6, "{found:?}");
        let plain = Distances { unit: None, ..of.clone() };
        assert!((plain.compare("a.png", &[2, 2], &[2.0, 8.0, 0.0, 0.0]).unwrap().root_mean_square) < 1e-9);
        array(&folder.path().join("b.npy"), [0.0; 4]);
        assert!(of.compare("b.png", &[2, 2], &[1.0; 4]).unwrap_err().message().contains("no distance from"));
        assert!(of.compare("a.png", &[2, 2], &[f32::NAN; 4]).is_err());
        assert!(of.compare("a.png", &[5], &[1.0; 5]).unwrap_err().message().contains("the shape [5]"));
    }

    #[test]
    fn a_png_file_needs_a_unit() {
        let mut bytes = Vec::new();
        let mut encoder = png::Encoder::new(&mut bytes, 1, 1);
        encoder.set_color(png::ColorType::Grayscale);
        encoder.set_depth(png::BitDepth::Sixteen);
        encoder.write_header().unwrap().write_image_data(&[1, 0]).unwrap();
        let of = distances(Path::new(""));
        assert_eq!(of.parse(&bytes, false).unwrap().values, [128.0]);
        let error = Distances { unit: None, ..of }.parse(&bytes, false).err().unwrap();
        assert!(error.message().contains("set `unit` of the task"), "{error}");
    }
}
