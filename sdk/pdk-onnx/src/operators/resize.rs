//! `Resize` and its predecessor `Upsample`: along each axis a matrix, whose transpose takes the gradient back.

use pdk_sdk::error::{Error, Result};

use super::operator::{Operator, Parts, Rule, given};
use crate::builder::Builder;
use crate::order::lesser;
use crate::site::{Site, axes};
use crate::tensor::{Element, Tensor, elements};
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[
    Operator::new("Resize", infer, evaluate, Rule::First(gradient)),
    Operator::new("Upsample", infer, evaluate, Rule::First(gradient)),
];

/// By how much each axis is scaled, and how long it becomes.
pub fn scales(site: &Site<'_>) -> Result<Vec<(f64, usize)>> {
    let shape = site.shape(0)?;
    let old = site.node.op_type == "Upsample" || site.opset() < 11;
    let scales = match (old, site.opset() < 9 && site.node.op_type == "Upsample") {
        (_, true) => {
            site.floats("scales").map(|scales| scales.iter().map(|&scale| f64::from(scale)).collect())
        }
        (true, false) => site.constant(1)?.map(|scales| scales.values.clone()),
        (false, false) => site
            .constant(2)?
            .map(|scales| scales.values.clone())
            .filter(|scales: &Vec<f64>| !scales.is_empty()),
    };
    let sizes = if old { None } else { site.constant(3)?.map(|sizes| sizes.to_ints()) };
    let resized = match site.ints("axes") {
        Some(list) => axes(list, shape.len())?,
        None => (0..shape.len()).collect(),
    };
    let mut all: Vec<_> = shape.iter().map(|&length| (1.0, length)).collect();
    let count = scales.as_ref().map(Vec::len).or(sizes.as_ref().map(Vec::len));
    if count != Some(resized.len()) {
        return Err(Error::new(format!(
            "it does not say to which size each of {} axes is brought",
            resized.len()
        )));
    }
    for (place, &axis) in resized.iter().enumerate() {
        let length = shape[axis] as f64;
        let (scale, size) = match (&scales, &sizes) {
            // Of 10 elements by 0.7, the product of 32-bit floats is 7, and that of the same numbers as 64-bit floats is less.
            (Some(scales), _) => (scales[place], Element::FLOAT.rounded(length * scales[place]).floor()),
            (None, Some(sizes)) => (sizes[place] as f64 / length, sizes[place] as f64),
            (None, None) => (1.0, length),
        };
        if !(length > 0.0 && scale > 0.0 && (1.0..=1e9).contains(&size)) {
            return Err(Error::new(format!("it resizes an axis of {length} to {size}")));
        }
        all[axis] = (scale, size as usize);
    }
    Ok(all)
}

fn infer(site: &Site<'_>) -> Result<Vec<Fact>> {
    Ok(vec![Fact::new(site.fact(0)?.element, scales(site)?.into_iter().map(|(_, size)| size).collect())])
}

/// Where the middle of an element of the result lies among the elements of the input. Each result of a calculation is rounded by `round`.
pub fn origin(
    site: &Site<'_>,
    at: usize,
    scale: f64,
    length: usize,
    size: usize,
    round: fn(f64) -> f64,
) -> Result<f64> {
    let old = site.node.op_type == "Upsample" || site.opset() < 11;
    let (x, n, m, scale) = (at as f64, length as f64, size as f64, round(scale));
    let middle = round(round(x + 0.5) / scale);
    match site.text("coordinate_transformation_mode", if old { "asymmetric" } else { "half_pixel" }) {
        "half_pixel" => Ok(round(middle - 0.5)),
        "half_pixel_symmetric" => {
            let offset = round(n / 2.0 * round(1.0 - round(m / round(scale * n))));
            Ok(round(round(offset + middle) - 0.5))
        }
        "pytorch_half_pixel" => Ok(if size > 1 { round(middle - 0.5) } else { 0.0 }),
        "align_corners" => Ok(if size > 1 { round(round(x * (n - 1.0)) / (m - 1.0)) } else { 0.0 }),
        "asymmetric" => Ok(round(x / scale)),
        "tf_half_pixel_for_nn" => Ok(middle),
        other => Err(Error::new(format!("its `coordinate_transformation_mode` `{other}` is not known here"))),
    }
}

/// The most elements of the matrix of an axis.
const LARGEST: usize = 1 << 24;

/// The matrix of an axis: a row for each element of the result.
fn matrix(site: &Site<'_>, scale: f64, length: usize, size: usize) -> Result<Vec<Vec<f64>>> {
    if site.int("antialias", 0) != 0 {
        return Err(Error::new("it is set to `antialias`, which is not known here"));
    }
    if site.text("keep_aspect_ratio_policy", "stretch") != "stretch" {
        return Err(Error::new("its `keep_aspect_ratio_policy` is not known here"));
    }
    if elements(&[size, length])? > LARGEST {
        return Err(Error::new(format!("it resizes an axis of {length} to {size}, which is too much here")));
    }
    let old = site.node.op_type == "Upsample" || site.opset() < 11;
    let last = length as f64 - 1.0;
    let mode = site.text("mode", "nearest");
    // Which element is nearest is decided with 32-bit floats, as in ONNX Runtime: 3 / 0.6 is 5 there, while 0.6 as a 32-bit float is more
    // than 0.6, and with 64 bits the quotient is less than 5.
    let round =
        if mode == "nearest" { |value| Element::FLOAT.rounded(value) } else { std::convert::identity };
    let row = |at: usize| {
        let x = origin(site, at, scale, length, size, round)?;
        let mut row = vec![0.0; length];
        match mode {
            "nearest" => {
                let place = match site.text("nearest_mode", if old { "floor" } else { "round_prefer_floor" })
                {
                    "floor" => x.floor(),
                    "ceil" => x.ceil(),
                    "round_prefer_ceil" => (x + 0.5).floor(),
                    _ => (x - 0.5).ceil(),
                };
                row[place.clamp(0.0, last) as usize] = 1.0;
            }
            "linear" | "bilinear" => {
                let x = x.clamp(0.0, last);
                let (low, share) = (x.floor(), x - x.floor());
                row[low as usize] += 1.0 - share;
                row[lesser(low + 1.0, last) as usize] += share;
            }
            "cubic" => cubic(site, x, &mut row),
            other => return Err(Error::new(format!("its mode `{other}` is not known here"))),
        }
        Ok(row)
    };
    (0..size).map(row).collect()
}

/// The weight of an element at a distance in cubic interpolation with a coefficient.
pub fn cubic_weight(a: f64, distance: f64) -> f64 {
    match distance.abs() {
        d if d <= 1.0 => ((a + 2.0) * d - (a + 3.0)) * d * d + 1.0,
        d if d < 2.0 => ((a * d - 5.0 * a) * d + 8.0 * a) * d - 4.0 * a,
        _ => 0.0,
    }
}

/// The weights of cubic interpolation at `x`.
fn cubic(site: &Site<'_>, x: f64, row: &mut [f64]) {
    let a = site.float("cubic_coeff_a", -0.75);
    let weight = |distance: f64| cubic_weight(a, distance);
    let excluded = site.int("exclude_outside", 0) != 0;
    let (mut sum, last) = (0.0, row.len() as f64 - 1.0);
    for tap in -1..=2 {
        let place = x.floor() + f64::from(tap);
        if !excluded || (0.0..=last).contains(&place) {
            row[place.clamp(0.0, last) as usize] += weight(x - place);
            sum += weight(x - place);
        }
    }
    if excluded {
        row.iter_mut().for_each(|value| *value /= sum);
    }
}

/// The axes that change, each with its matrix.
pub fn matrices(site: &Site<'_>) -> Result<Vec<(usize, Vec<Vec<f64>>)>> {
    let axes = scales(site)?.into_iter().zip(site.shape(0)?).enumerate();
    let changed = axes.filter(|(_, ((scale, size), length))| size != *length || *scale != 1.0);
    changed.map(|(axis, ((scale, size), &length))| Ok((axis, matrix(site, scale, length, size)?))).collect()
}

fn evaluate(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let mut image = given(inputs, 0)?.clone();
    for (axis, matrix) in matrices(site)? {
        let mut shape = image.shape.clone();
        shape[axis] = matrix.len();
        let mut source = Vec::new();
        image = Tensor::from_fn(image.element, &shape, |at| {
            source.clear();
            source.extend_from_slice(at);
            let weights = matrix[at[axis]].iter().enumerate().filter(|(_, weight)| **weight != 0.0);
            let terms = weights.map(|(place, weight)| {
                source[axis] = place;
                weight * image.broadcast_at(&source)
            });
            terms.sum()
        })?;
    }
    if image.element.is_integer() {
        // Integers are cut. As 32-bit floats, weights whose sum is nearly 1 leave whole numbers whole.
        let cut = |value: f64| image.element.saturated(Element::FLOAT.rounded(value).trunc());
        image.values.iter_mut().for_each(|value| *value = cut(*value));
    }
    Ok(vec![image])
}

fn gradient(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let mut g = g.to_owned();
    for (axis, matrix) in matrices(site)? {
        let transposed: Vec<Vec<f64>> =
            (0..matrix[0].len()).map(|column| matrix.iter().map(|row| row[column]).collect()).collect();
        g = b.along(&g, axis, &transposed)?;
    }
    Ok(vec![(0, g)])
}

#[cfg(test)]
mod tests {
    use crate::graph::Graph;
    use crate::tensor::{Element, Tensor};
    use crate::testing::{Setting, Sketch, check, computed};

    #[test]
    fn scales_belong_to_the_axes_in_the_order_that_names_them() {
        let mut s = Sketch::new(18);
        s.input("x", &[1, 1, 2, 4]);
        let scales =
            s.weights("scales", Tensor { element: Element::FLOAT, shape: vec![2], values: vec![2.0, 3.0] });
        s.node("Resize", &["x", "", &scales], "y", &[("axes", Setting::Ints(&[3, 2]))]);
        let graph = Graph::new(s.model(&["y"])).unwrap();
        assert_eq!(graph.fact("y").unwrap().shape, [1, 1, 6, 8]);
    }

    /// A row of numbers from 0, scaled by a factor.
    fn scaled(length: usize, factor: f32, settings: &[(&str, Setting<'_>)]) -> Vec<f64> {
        let row = Tensor::floats(&[length], (0..length).map(|value| value as f64).collect());
        let scales = Tensor::floats(&[1], vec![f64::from(factor)]);
        computed(17, |s| {
            let (row, scales) = (s.weights("row", row.clone()), s.weights("scales", scales.clone()));
            s.node("Resize", &[&row, "", &scales], "y", settings);
        })
        .unwrap()
        .values
    }

    #[test]
    fn sizes_and_the_nearest_element_are_those_of_32_bit_floats() {
        let asymmetric = ("coordinate_transformation_mode", Setting::Text("asymmetric"));
        let floor = ("nearest_mode", Setting::Text("floor"));
        // 3 / 0.6 is 5.
        assert_eq!(scaled(10, 0.6, &[asymmetric, floor]), [0.0, 1.0, 3.0, 5.0, 6.0, 8.0]);
        // 10 times 0.7 is 7.
        assert_eq!(scaled(10, 0.7, &[]).len(), 7);
    }

    #[test]
    fn gradients_are_right_for_every_kind_of_interpolation() {
        for case in [
            "resize",
            "resize/linear",
            "resize/cubic",
            "resize/sizes",
            "resize/corners",
            "resize/ten",
            "upsample",
            "upsample/seven",
        ] {
            check(case);
        }
    }
}
