//! `GridSample`: an image read at the points of a grid, which lie between its pixels.

use pdk_sdk::error::{Error, Result};

use super::inputs::taken;
use super::operator::{Operator, Rule};
use super::positions::strides;
use super::resize::cubic_weight;
use crate::site::Site;
use crate::tensor::{Tensor, elements, shape_text};
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[Operator::new("GridSample", infer, evaluate, Rule::Unknown)];

/// The coefficient of cubic interpolation.
const COEFFICIENT: f64 = -0.75;

/// How a value between pixels follows from those around it.
#[derive(Clone, Copy)]
enum Mode {
    Nearest,
    Linear,
    Cubic,
}

/// What lies outside the image.
#[derive(Clone, Copy)]
enum Padding {
    Zeros,
    Border,
    Reflection,
}

struct Setup {
    mode: Mode,
    padding: Padding,
    /// Whether the ends of the grid are the centres of the outermost pixels.
    corners: bool,
}

fn setup(site: &Site<'_>) -> Result<Setup> {
    let unknown = |what: &str, text: &str| Error::new(format!("its `{what}` `{text}` is not known here"));
    let mode = match site.text("mode", "linear") {
        "nearest" => Mode::Nearest,
        "linear" | "bilinear" => Mode::Linear,
        "cubic" | "bicubic" => Mode::Cubic,
        other => return Err(unknown("mode", other)),
    };
    let padding = match site.text("padding_mode", "zeros") {
        "zeros" => Padding::Zeros,
        "border" => Padding::Border,
        "reflection" => Padding::Reflection,
        other => return Err(unknown("padding_mode", other)),
    };
    Ok(Setup { mode, padding, corners: site.int("align_corners", 0) != 0 })
}

fn infer(site: &Site<'_>) -> Result<Vec<Fact>> {
    setup(site)?;
    let (image, grid) = (site.fact(0)?, site.shape(1)?);
    let rank = image.shape.len();
    // A cubic of many axes would read 4 pixels along each.
    let fits = (3..=6).contains(&rank)
        && grid.len() == rank
        && grid[0] == image.shape[0]
        && grid[rank - 1] == rank - 2
        && !image.shape[2..].contains(&0);
    if !fits {
        return Err(Error::new(format!(
            "its grid {} does not fit its input {}",
            shape_text(grid),
            shape_text(&image.shape)
        )));
    }
    let shape = [&image.shape[..2], &grid[1..rank - 1]].concat();
    Ok(vec![Fact::new(image.element, shape)])
}

impl Setup {
    /// The pixels that a point of the grid reads along an axis of this length, with their weights.
    fn taps(&self, point: f64, length: usize) -> Vec<(usize, f64)> {
        let whole = length as f64;
        let at = match self.corners {
            true => (point + 1.0) / 2.0 * (whole - 1.0),
            false => ((point + 1.0) * whole - 1.0) / 2.0,
        };
        let below = at.floor();
        let taps = match self.mode {
            Mode::Nearest => vec![(at.round_ties_even(), 1.0)],
            Mode::Linear => vec![(below, 1.0 - (at - below)), (below + 1.0, at - below)],
            Mode::Cubic => (-1..3)
                .map(|k| (below + f64::from(k), cubic_weight(COEFFICIENT, at - below - f64::from(k))))
                .collect(),
        };
        taps.into_iter().filter_map(|(at, weight)| Some((self.pixel(at, whole)?, weight))).collect()
    }

    /// The pixel that is read at a whole place, which may be outside; nothing if zero is read.
    fn pixel(&self, at: f64, length: f64) -> Option<usize> {
        let inside = at >= 0.0 && at < length;
        let at = match self.padding {
            Padding::Zeros if !inside => return None,
            Padding::Reflection if !inside && self.corners => reflected(at, 0.0, length - 1.0),
            Padding::Reflection if !inside => reflected(at, -0.5, length - 0.5),
            _ => at,
        };
        // What is not a number becomes 0.
        Some(at.clamp(0.0, length - 1.0) as usize)
    }
}

/// A place mirrored at two ends until it lies between them.
fn reflected(at: f64, low: f64, high: f64) -> f64 {
    let range = high - low;
    if range <= 0.0 {
        return low;
    }
    let beyond = if at < low { low - at } else { at - high };
    let (times, rest) = ((beyond / range).floor(), beyond % range);
    let from_low = (at < low) == (times % 2.0 == 0.0);
    if from_low { low + rest } else { high - rest }
}

fn evaluate(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let (setup, fact) = (setup(site)?, infer(site)?.swap_remove(0));
    let (image, grid) = (taken(site, inputs, 0)?, taken(site, inputs, 1)?);
    let (spatial, channels) = (&image.shape[2..], image.shape[1]);
    let plane: usize = spatial.iter().product();
    let points: usize = fact.shape[2..].iter().product();
    let strides = strides(spatial);
    let mut values = vec![0.0; elements(&fact.shape)?];
    for (number, point) in grid.values.chunks(spatial.len()).enumerate() {
        let (batch, place) = (number / points, number % points);
        // The first number of a point belongs to the last axis.
        let mut taps = vec![(0, 1.0)];
        for ((axis, &length), &number) in spatial.iter().enumerate().zip(point.iter().rev()) {
            let along = setup.taps(number, length);
            let joined = taps
                .iter()
                .flat_map(|&(start, weight)| along.iter().map(move |&(at, part)| (start, at, weight * part)));
            taps = joined.map(|(start, at, weight)| (start + at * strides[axis], weight)).collect();
        }
        for channel in 0..channels {
            let pixels = &image.values[(batch * channels + channel) * plane..][..plane];
            values[(batch * channels + channel) * points + place] =
                taps.iter().map(|&(at, weight)| pixels[at] * weight).sum();
        }
    }
    Ok(vec![Tensor { element: fact.element, shape: fact.shape, values }])
}

#[cfg(test)]
mod tests {
    use crate::tensor::Tensor;
    use crate::testing::Setting::{Int, Text};
    use crate::testing::computed;

    #[test]
    fn grids_and_modes_that_do_not_fit_are_errors() {
        let sampled = |image: &[usize], grid: &[usize], mode: &str, padding: &str| {
            computed(20, |s| {
                let (image, grid) = (s.drawn(image, -1.0, 1.0), s.drawn(grid, -2.0, 2.0));
                let settings = [("mode", Text(mode)), ("padding_mode", Text(padding))];
                s.node("GridSample", &[&image, &grid], "y", &settings);
            })
        };
        assert_eq!(sampled(&[1, 2, 3, 3], &[1, 4, 5, 2], "cubic", "border").unwrap().shape, [1, 2, 4, 5]);
        assert_eq!(sampled(&[1, 2, 3, 3], &[1, 0, 5, 2], "linear", "zeros").unwrap().shape, [1, 2, 0, 5]);
        for (image, grid) in [
            (&[1, 2, 3, 3][..], &[2, 4, 5, 2][..]),
            (&[1, 2, 3, 3], &[1, 4, 5, 3]),
            (&[1, 2, 3, 3], &[1, 4, 2]),
            (&[1, 2, 0, 3], &[1, 4, 5, 2]),
            (&[1, 2], &[1, 0]),
            (&[], &[]),
        ] {
            assert!(sampled(image, grid, "linear", "zeros").is_err(), "{image:?} {grid:?}");
        }
        assert!(sampled(&[1, 2, 3, 3], &[1, 4, 5, 2], "sharp", "zeros").is_err());
        assert!(sampled(&[1, 2, 3, 3], &[1, 4, 5, 2], "cubic", "sky").is_err());
    }

    #[test]
    fn points_far_outside_read_the_padding() {
        for (padding, corners) in [("zeros", 0), ("border", 0), ("reflection", 0), ("reflection", 1)] {
            for mode in ["nearest", "linear", "cubic"] {
                for length in [1, 3] {
                    let result = computed(20, |s| {
                        let image = s.weights("image", Tensor::floats(&[1, 1, length], vec![1.0; length]));
                        let far = vec![1e6, -1e6, f64::MAX, f64::INFINITY, f64::NAN];
                        let grid = s.weights("grid", Tensor::floats(&[1, 5, 1], far));
                        let settings = [
                            ("mode", Text(mode)),
                            ("padding_mode", Text(padding)),
                            ("align_corners", Int(corners)),
                        ];
                        s.node("GridSample", &[&image, &grid], "y", &settings);
                    });
                    let expected = if padding == "zeros" { 0.0 } else { 1.0 };
                    if mode == "nearest" && (corners, length) != (1, 1) {
                        assert_eq!(result.unwrap().values[..2], [expected; 2], "{padding} {mode}");
                    } else {
                        assert_eq!(result.unwrap().shape, [1, 1, 5]);
                    }
                }
            }
        }
    }
}
