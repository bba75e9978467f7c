//! Boxes and polygons as YOLO has them: a text file for each picture, with a line for each object: its class, and shares of the picture's
//! width and height.

use pdk_metrics::detection::Labelled;
use pdk_sdk::error::{Error, Place, Result};

/// Numbers of a box: the class, its middle, its width and height.
const BOX: usize = 5;
/// The largest number of a class, and the most corners of a polygon.
const LARGEST_CLASS: f64 = 65_535.0;
const MOST_NUMBERS: usize = 1 << 16;

/// An object, in shares of the picture's width and height.
#[derive(Debug, Clone, PartialEq)]
pub struct Object {
    /// The class.
    pub class: usize,
    /// The box: its left and upper edge, its width and its height.
    bounds: [f64; 4],
    /// The share of the picture's area that it covers.
    area: f64,
}

/// Reads the text of a file.
///
/// # Errors
/// If a line is neither a box nor a polygon.
pub fn parse(text: &str) -> Result<Vec<Object>> {
    let lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    lines.map(|(place, line)| object(line).place(format_args!("line {}", place + 1))).collect()
}

fn object(line: &str) -> Result<Object> {
    let numbers: Vec<f64> = line
        .split_whitespace()
        .take(MOST_NUMBERS)
        .map(|word| word.parse().ok().filter(|number: &f64| number.is_finite()))
        .collect::<Option<_>>()
        .ok_or_else(|| Error::new("it contains something other than numbers"))?;
    let [class, rest @ ..] = numbers.as_slice() else { return Err(Error::new("it has no numbers")) };
    if class.fract() != 0.0 || !(0.0..=LARGEST_CLASS).contains(class) {
        return Err(Error::new(format!(
            "its class is {class}, but has to be a whole number from 0 to {LARGEST_CLASS}"
        )));
    }
    // Rounding and cut-off objects may lie a little outside.
    if let Some(outside) = rest.iter().find(|share| !(-0.5..=1.5).contains(*share)) {
        return Err(Error::new(format!(
            "{outside} is not a share of the picture's size, which goes from 0 to 1"
        )));
    }
    let class = *class as usize;
    match rest {
        [x, y, width, height] => {
            let bounds = [x - width / 2.0, y - height / 2.0, *width, *height];
            Ok(Object { class, bounds, area: width * height })
        }
        corners if corners.len() >= 6 && corners.len() % 2 == 0 => {
            let ends = |axis: usize| {
                let places = corners.iter().skip(axis).step_by(2);
                places.fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), place| {
                    (low.min(*place), high.max(*place))
                })
            };
            let ((left, right), (top, bottom)) = (ends(0), ends(1));
            let pairs: Vec<(f64, f64)> = corners.chunks_exact(2).map(|pair| (pair[0], pair[1])).collect();
            let next = pairs.iter().cycle().skip(1);
            let twice: f64 = pairs.iter().zip(next).map(|(a, b)| a.0 * b.1 - a.1 * b.0).sum();
            let bounds = [left, top, right - left, bottom - top];
            Ok(Object { class, bounds, area: (twice / 2.0).abs() })
        }
        _ => Err(Error::new(format!(
            "it has {} numbers, which is neither a box ({BOX}) nor a polygon (7, 9, ...)",
            numbers.len()
        ))),
    }
}

impl Object {
    /// The object in pixels of a picture of this width and height.
    pub fn in_pixels(&self, [width, height]: [f64; 2]) -> Labelled {
        let [x, y, across, down] = self.bounds;
        Labelled {
            bounds: [x * width, y * height, across * width, down * height],
            class: self.class,
            crowd: false,
            area: self.area * width * height,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn boxes_and_polygons_are_read_and_others_are_refused() {
        let objects = parse("2 0.5 0.5 0.25 0.5\n\n0 0.25 0.25 0.75 0.25 0.25 0.75\n").unwrap();
        let found: Vec<Labelled> = objects.iter().map(|object| object.in_pixels([80.0, 40.0])).collect();
        assert_eq!((found[0].bounds, found[0].class, found[0].area), ([30.0, 10.0, 20.0, 20.0], 2, 400.0));
        assert_eq!((found[1].bounds, found[1].area), ([20.0, 10.0, 40.0, 20.0], 400.0));
        assert!(parse("").unwrap().is_empty());
        for (text, part) in [
            ("0 0.5 0.5 0.1 0.1\n1 2 3 4 5", "line 2: 2 is not a share"),
            ("0.5 0.1 0.1 0.1 0.1", "its class is 0.5"),
            ("0 0.1 0.1 0.1", "neither a box (5) nor a polygon"),
            ("cat 0.1 0.1 0.1 0.1", "something other than numbers"),
        ] {
            let error = parse(text).unwrap_err();
            assert!(error.message().contains(part), "{error}");
        }
    }
}
