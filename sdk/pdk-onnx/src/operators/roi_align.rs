//! `RoiAlign`: regions of an image, each brought to one size.

use pdk_sdk::error::{Error, Result};

use super::inputs::taken;
use super::operator::{Operator, Rule};
use crate::order::{further, greater};
use crate::site::Site;
use crate::tensor::{Element, Tensor, elements};
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[Operator::new("RoiAlign", infer, evaluate, Rule::Unknown)];

/// The most places along each axis at which a bin of a region is read.
const MOST: f64 = 4096.0;

/// The height and width of what comes out.
fn size(site: &Site<'_>) -> Result<[usize; 2]> {
    let length = |name: &str| {
        let length = site.int(name, 1);
        usize::try_from(length).map_err(|_| Error::new(format!("its `{name}` {length} is not a length")))
    };
    Ok([length("output_height")?, length("output_width")?])
}

/// Whether a bin is the greatest value in it, and not the mean.
fn is_greatest(site: &Site<'_>) -> Result<bool> {
    match site.text("mode", "avg") {
        "avg" => Ok(false),
        "max" => Ok(true),
        other => Err(Error::new(format!("its `mode` `{other}` is not known here"))),
    }
}

/// Whether coordinates are those of the corners of pixels, so that they are shifted by half a pixel.
fn is_shifted(site: &Site<'_>) -> Result<bool> {
    let before = if site.opset() < 16 { "output_half_pixel" } else { "half_pixel" };
    match site.text("coordinate_transformation_mode", before) {
        "half_pixel" => Ok(true),
        "output_half_pixel" => Ok(false),
        other => Err(Error::new(format!("its `coordinate_transformation_mode` `{other}` is not known here"))),
    }
}

fn infer(site: &Site<'_>) -> Result<Vec<Fact>> {
    let [height, width] = size(site)?;
    is_greatest(site)?;
    is_shifted(site)?;
    let (fact, regions) = (site.fact(0)?, site.shape(1)?);
    let (&[_, channels, _, _], &[count, 4]) = (&*fact.shape, regions) else {
        return Err(Error::new("it needs an image of 4 axes and regions of 4 numbers"));
    };
    if site.shape(2)? != [count] {
        return Err(Error::new("it does not have the number of an image for each region"));
    }
    Ok(vec![Fact::new(fact.element, vec![count, channels, height, width])])
}

/// The places along an axis at which each bin of a region is read.
struct Bins {
    from: f64,
    /// The length of a bin.
    bin: f64,
    /// The number of places in a bin.
    count: usize,
}

impl Bins {
    fn new(site: &Site<'_>, ends: [f64; 2], bins: usize) -> Result<Self> {
        let (scale, is_shifted) = (site.float("spatial_scale", 1.0), is_shifted(site)?);
        let shift = if is_shifted { 0.5 } else { 0.0 };
        let [from, to] = ends.map(|end| end * scale - shift);
        let length = if is_shifted { to - from } else { greater(1.0, to - from) };
        let bin = length / bins as f64;
        let count = match site.int("sampling_ratio", 0) {
            ratio if ratio > 0 => ratio as f64,
            // With 32-bit floats, as in ONNX Runtime: a scale of 0.8 is a little more than 0.8, which would be a place more.
            _ => {
                let single = |value| Element::FLOAT.rounded(value);
                let [from, to] = ends.map(|end| single(single(end * scale) - shift));
                let length = if is_shifted { single(to - from) } else { greater(1.0, single(to - from)) };
                greater(0.0, single(length / bins as f64).ceil())
            }
        };
        match count <= MOST {
            true => Ok(Self { from, bin, count: count as usize }),
            false => {
                Err(Error::new(format!("one of its regions has more than {MOST} places to read in a bin")))
            }
        }
    }

    fn at(&self, bin: usize, place: usize) -> f64 {
        self.from + bin as f64 * self.bin + (place as f64 + 0.5) * self.bin / self.count as f64
    }
}

/// The two pixels around a place along an axis, each with its weight; nothing if it is outside.
fn around(at: f64, length: usize) -> Option<[(usize, f64); 2]> {
    if !(at >= -1.0 && at <= length as f64) || length == 0 {
        return None;
    }
    let at = greater(0.0, at);
    let low = at as usize;
    if low + 1 >= length {
        return Some([(length - 1, 1.0), (length - 1, 0.0)]);
    }
    let part = at - low as f64;
    Some([(low, 1.0 - part), (low + 1, part)])
}

fn evaluate(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let (fact, is_greatest) = (infer(site)?.swap_remove(0), is_greatest(site)?);
    let (image, regions, numbers) =
        (taken(site, inputs, 0)?, taken(site, inputs, 1)?, taken(site, inputs, 2)?);
    let (batch, channels, [rows, columns]) =
        (image.shape[0], image.shape[1], [image.shape[2], image.shape[3]]);
    let [height, width] = [fact.shape[2], fact.shape[3]];
    let mut values = Vec::with_capacity(elements(&fact.shape)?);
    for (corners, number) in regions.values.chunks_exact(4).zip(numbers.to_ints()) {
        let image_of = usize::try_from(number).ok().filter(|&number| number < batch);
        let image_of = image_of
            .ok_or_else(|| Error::new(format!("a region belongs to the image {number} of {batch}")))?;
        let down = Bins::new(site, [corners[1], corners[3]], height)?;
        let right = Bins::new(site, [corners[0], corners[2]], width)?;
        elements(&[channels, height, width, down.count, right.count])?;
        for channel in 0..channels {
            let plane = &image.values[(image_of * channels + channel) * rows * columns..][..rows * columns];
            for bin in 0..height * width {
                let (mut sum, mut greatest) = (0.0, None);
                for place in 0..down.count * right.count {
                    let y = around(down.at(bin / width, place / right.count), rows);
                    let x = around(right.at(bin % width, place % right.count), columns);
                    let mut parts = [0.0; 4];
                    if let (Some(y), Some(x)) = (y, x) {
                        let part = |row: usize, column: usize| {
                            y[row].1 * x[column].1 * plane[y[row].0 * columns + x[column].0]
                        };
                        parts = [part(0, 0), part(0, 1), part(1, 0), part(1, 1)];
                    }
                    sum += parts.iter().sum::<f64>();
                    // The greatest of the weighted pixels, as in the operator's definition, and not of their sums.
                    let most = parts.into_iter().fold(parts[0], |a, b| further(a, b, 1.0));
                    greatest = Some(greatest.map_or(most, |greatest| further(greatest, most, 1.0)));
                }
                values.push(match is_greatest {
                    true => greatest.unwrap_or(0.0),
                    false => sum / (down.count * right.count).max(1) as f64,
                });
            }
        }
    }
    Ok(vec![Tensor { element: fact.element, shape: fact.shape, values }])
}

#[cfg(test)]
mod tests {
    use crate::tensor::Tensor;
    use crate::testing::Setting::{Float, Int};
    use crate::testing::computed;

    fn aligned(corners: &[f64], image_of: &[i64], settings: [i64; 3]) -> pdk_sdk::error::Result<Tensor> {
        computed(16, |s| {
            let image = s.drawn(&[1, 2, 5, 6], -1.0, 1.0);
            let regions = s.weights("regions", Tensor::floats(&[1, corners.len()], corners.to_vec()));
            let numbers = s.ints(image_of);
            let names = ["output_height", "output_width", "sampling_ratio"];
            let settings: Vec<_> = names.into_iter().zip(settings.map(Int)).collect();
            s.node("RoiAlign", &[&image, &regions, &numbers], "y", &settings);
        })
    }

    #[test]
    fn a_bin_has_the_places_of_32_bit_floats() {
        let averaged = |ratio: i64| {
            computed(16, |s| {
                let image = s.drawn(&[1, 2, 5, 6], -1.0, 1.0);
                let regions = s.weights("regions", Tensor::floats(&[1, 4], vec![0.0, 0.0, 5.0, 5.0]));
                let numbers = s.ints(&[0]);
                let scale = ("spatial_scale", Float(0.8));
                let bins = ["output_height", "output_width"].map(|name| (name, Int(2)));
                let settings = [scale, bins[0], bins[1], ("sampling_ratio", Int(ratio))];
                s.node("RoiAlign", &[&image, &regions, &numbers], "y", &settings);
            })
            .unwrap()
            .values
        };
        // 5 times 0.8 is 4 and 2 places a bin.
        assert!(averaged(0) == averaged(2) && averaged(0) != averaged(3));
    }

    #[test]
    fn regions_that_do_not_fit_are_errors() {
        assert_eq!(aligned(&[0.0, 0.0, 4.0, 4.0], &[0], [2, 3, 0]).unwrap().shape, [1, 2, 2, 3]);
        assert_eq!(aligned(&[0.0, 0.0, 4.0, 4.0], &[0], [0, 3, 2]).unwrap().shape, [1, 2, 0, 3]);
        assert!(aligned(&[f64::NAN, 9.0, -4.0, 1e3], &[0], [2, 3, 2]).is_ok());
        assert!(aligned(&[4.0, 4.0, 0.0, 0.0], &[0], [2, 3, 0]).is_ok());
        assert!(aligned(&[0.0, 0.0, 1e30, 4.0], &[0], [2, 3, 0]).is_err());
        assert!(aligned(&[0.0, 0.0, 4.0, 4.0], &[0], [2, 3, i64::MAX]).is_err());
        assert!(aligned(&[0.0, 0.0, 4.0, 4.0], &[1], [2, 3, 0]).is_err());
        assert!(aligned(&[0.0, 0.0, 4.0, 4.0], &[-1], [2, 3, 0]).is_err());
        assert!(aligned(&[0.0, 0.0, 4.0, 4.0], &[0, 0], [2, 3, 0]).is_err());
        assert!(aligned(&[0.0, 0.0, 4.0], &[0], [2, 3, 0]).is_err());
        assert!(aligned(&[0.0, 0.0, 4.0, 4.0], &[0], [-2, 3, 0]).is_err());
        assert!(aligned(&[0.0, 0.0, 4.0, 4.0], &[0], [i64::MAX, 3, 0]).is_err());
    }
}
