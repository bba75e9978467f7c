//! `BatchNormalization`, `LayerNormalization` and `InstanceNormalization`.

use pdk_sdk::error::{Error, Result};

use super::conv;
use super::inputs::{optional, taken};
use super::operator::{Operator, Parts, Rule, check_broadcast, given, same};
use crate::builder::Builder;
use crate::site::{Site, axis};
use crate::tensor::{Tensor, for_each_position};
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[
    Operator::new("BatchNormalization", infer_batch, evaluate_batch, Rule::First(gradient_batch)),
    Operator::new("LayerNormalization", infer_layer, evaluate_layer, Rule::First(gradient_layer)),
    Operator::new("InstanceNormalization", same, evaluate_instance, Rule::First(gradient_instance)),
];

/// The shape in which a number for each channel is broadcast. The inputs from the second to `last` have such numbers.
pub fn by_channel(site: &Site<'_>, last: usize) -> Result<Vec<usize>> {
    let shape = site.shape(0)?;
    for place in 1..=last {
        if shape.len() < 2 || site.shape(place)? != [shape[1]] {
            return Err(Error::new(format!(
                "its input {} does not have one number for each channel",
                place + 1
            )));
        }
    }
    Ok(shape.iter().enumerate().map(|(axis, &dim)| if axis == 1 { dim } else { 1 }).collect())
}

pub fn epsilon(site: &Site<'_>) -> f64 {
    site.float("epsilon", 1e-5)
}

/// Refuses what a model computes while it learns: before version 14 such a node has more outputs than one.
fn check_inference(site: &Site<'_>) -> Result<()> {
    let outputs = site.node.output.iter().filter(|name| !name.is_empty()).count();
    match site.int("training_mode", 0) != 0 || site.opset() < 14 && outputs > 1 {
        true => Err(Error::new("it is set to training; export the model for inference")),
        false => Ok(()),
    }
}

fn infer_batch(site: &Site<'_>) -> Result<Vec<Fact>> {
    check_inference(site)?;
    same(site)
}

fn evaluate_batch(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    check_inference(site)?;
    by_channel(site, 4)?;
    let (x, epsilon) = (taken(site, inputs, 0)?, epsilon(site));
    let [scale, bias, mean, variance] =
        [taken(site, inputs, 1)?, taken(site, inputs, 2)?, taken(site, inputs, 3)?, taken(site, inputs, 4)?];
    let mut values = x.values.iter();
    let normalized = Tensor::from_fn(x.element, &x.shape, |at| {
        let (channel, x) = (at[1], values.next().copied().unwrap_or_default());
        let deviation = libm::sqrt(variance.values[channel] + epsilon);
        (x - mean.values[channel]) / deviation * scale.values[channel] + bias.values[channel]
    });
    Ok(vec![normalized?])
}

fn gradient_batch(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    check_inference(site)?;
    if site.int("spatial", 1) == 0 {
        return Err(Error::new(
            "it has factors for each pixel, which later versions of this operator do not have",
        ));
    }
    let variance = b.offset(site.input(4)?, epsilon(site))?;
    let deviation = b.unary("Sqrt", &variance)?;
    let slope = b.binary("Div", site.input(1)?, &deviation)?;
    let by_channel = by_channel(site, 4)?;
    let slope_by_channel = b.reshape(&slope, &by_channel)?;
    let mut parts = Vec::new();
    if b.wants(site, 0) {
        parts.push((0, b.mul(g, &slope_by_channel)?));
    }
    if b.wants(site, 2) {
        parts.push((2, conv::of_bias(b, g)?));
    }
    if b.wants(site, 3) {
        let sum = conv::of_bias(b, g)?;
        let product = b.mul(&sum, &slope)?;
        parts.push((3, b.unary("Neg", &product)?));
    }
    if b.wants(site, 1) || b.wants(site, 4) {
        // The sum of the gradient times the values with mean 0.
        let mean = b.reshape(site.input(3)?, &by_channel)?;
        let centred = b.binary("Sub", site.input(0)?, &mean)?;
        let product = b.mul(g, &centred)?;
        let sum = conv::of_bias(b, &product)?;
        if b.wants(site, 1) {
            parts.push((1, b.binary("Div", &sum, &deviation)?));
        }
        if b.wants(site, 4) {
            let product = b.mul(&sum, &slope)?;
            let product = b.binary("Div", &product, &variance)?;
            parts.push((4, b.scale(&product, -0.5)?));
        }
    }
    Ok(parts)
}

/// The first of the axes that are normalised together.
pub fn first_axis(site: &Site<'_>) -> Result<usize> {
    axis(site.int("axis", -1), site.shape(0)?.len())
}

fn infer_layer(site: &Site<'_>) -> Result<Vec<Fact>> {
    let fact = site.fact(0)?;
    let first = first_axis(site)?;
    let shape =
        fact.shape.iter().enumerate().map(|(axis, &dim)| if axis < first { dim } else { 1 }).collect();
    let moments = Fact::new(fact.element, shape);
    Ok(vec![fact.clone(), moments.clone(), moments])
}

/// The values with mean 0 and variance 1 over blocks of this many, and mean and inverse deviation of each block before.
pub fn standardize(x: &Tensor, block: usize, epsilon: f64) -> (Tensor, [Vec<f64>; 2]) {
    let mut result = x.clone();
    let mut moments = [Vec::new(), Vec::new()];
    for block in result.values.chunks_mut(block.max(1)) {
        let mean = block.iter().sum::<f64>() / block.len() as f64;
        let variance = block.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / block.len() as f64;
        let deviation = libm::sqrt(variance + epsilon);
        block.iter_mut().for_each(|x| *x = (*x - mean) / deviation);
        moments[0].push(mean);
        moments[1].push(1.0 / deviation);
    }
    (result, moments)
}

fn evaluate_layer(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let x = given(inputs, 0)?;
    for place in [1, 2].into_iter().filter(|&place| site.optional(place).is_some()) {
        check_broadcast(site, place)?;
    }
    let block = x.shape[first_axis(site)?..].iter().product();
    let (mut result, moments) = standardize(x, block, epsilon(site));
    let (scale, bias) = (given(inputs, 1)?, optional(inputs, 2));
    let mut place = 0;
    for_each_position(&x.shape, |at| {
        let value = &mut result.values[place];
        *value = *value * scale.broadcast_at(at) + bias.map_or(0.0, |bias| bias.broadcast_at(at));
        place += 1;
    });
    let shape = infer_layer(site)?.swap_remove(1).shape;
    let moments = moments.map(|values| Tensor { element: x.element, shape: shape.clone(), values });
    Ok(std::iter::once(result).chain(moments).collect())
}

fn evaluate_instance(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    by_channel(site, 2)?;
    let [x, scale, bias] = [given(inputs, 0)?, given(inputs, 1)?, given(inputs, 2)?];
    let block: usize = x.shape[2..].iter().product();
    let (mut result, _) = standardize(x, block, epsilon(site));
    for (plane, values) in result.values.chunks_mut(block.max(1)).enumerate() {
        let channel = plane % x.shape[1];
        values.iter_mut().for_each(|value| *value = *value * scale.values[channel] + bias.values[channel]);
    }
    Ok(vec![result])
}

/// The values with mean 0 and variance 1 over some axes, and their deviation before.
fn standardized(b: &mut Builder, x: &str, axes: &[usize], epsilon: f64) -> Result<[String; 2]> {
    let mean = b.mean(x, axes)?;
    let centred = b.binary("Sub", x, &mean)?;
    let square = b.mul(&centred, &centred)?;
    let variance = b.mean(&square, axes)?;
    let variance = b.offset(&variance, epsilon)?;
    let deviation = b.unary("Sqrt", &variance)?;
    Ok([b.binary("Div", &centred, &deviation)?, deviation])
}

/// The gradients of an operator that takes values to mean 0 and variance 1 over some axes, multiplies them by a factor and adds a term, in
/// these shapes. With y the standardised values and g the gradient times the factor, that of the values
/// is (g - mean(g) - y mean(g y)) / deviation.
fn gradient_standardized(
    site: &Site<'_>,
    b: &mut Builder,
    axes: &[usize],
    [factor, term]: [&[usize]; 2],
    g: &str,
) -> Result<Parts> {
    let [y, deviation] = standardized(b, site.input(0)?, axes, epsilon(site))?;
    let mut parts = Vec::new();
    if b.wants(site, 0) {
        let scale = b.reshape(site.input(1)?, factor)?;
        let g = b.mul(g, &scale)?;
        parts.push((0, destandardize(b, [&y, &deviation], axes, &g)?));
    }
    if b.wants(site, 1) {
        let product = b.mul(g, &y)?;
        let sum = b.sum_to(&product, factor)?;
        parts.push((1, b.reshape(&sum, site.shape(1)?)?));
    }
    if b.wants(site, 2) {
        let sum = b.sum_to(g, term)?;
        parts.push((2, b.reshape(&sum, site.shape(2)?)?));
    }
    Ok(parts)
}

fn destandardize(b: &mut Builder, [y, deviation]: [&str; 2], axes: &[usize], g: &str) -> Result<String> {
    let g_mean = b.mean(g, axes)?;
    let product = b.mul(g, y)?;
    let product = b.mean(&product, axes)?;
    let along = b.mul(y, &product)?;
    let rest = b.binary("Sub", g, &g_mean)?;
    let rest = b.binary("Sub", &rest, &along)?;
    b.binary("Div", &rest, deviation)
}

fn gradient_layer(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let axes: Vec<_> = (first_axis(site)?..site.shape(0)?.len()).collect();
    let factor = site.shape(1)?;
    let term = if site.optional(2).is_some() { site.shape(2)? } else { factor };
    gradient_standardized(site, b, &axes, [factor, term], g)
}

fn gradient_instance(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let axes: Vec<_> = (2..site.shape(0)?.len()).collect();
    let by_channel = by_channel(site, 2)?;
    gradient_standardized(site, b, &axes, [&by_channel, &by_channel], g)
}

#[cfg(test)]
mod tests {
    use crate::testing::{check, fault};

    #[test]
    fn damaged_models_are_refused() {
        let image: &[usize] = &[1, 2, 3];
        let none = "does not have one number for each channel";
        for operator in ["BatchNormalization", "InstanceNormalization"] {
            for [first, second] in [[1, 2], [2, 1]] {
                let error = fault(13, operator, &[image, &[first], &[second], &[2], &[2]], &[]);
                assert!(error.contains(none), "{error}");
            }
            assert!(fault(13, operator, &[&[2], &[2], &[2], &[2], &[2]], &[]).contains(none));
        }
        let variance = fault(13, "BatchNormalization", &[image, &[2], &[2], &[2], &[1]], &[]);
        assert!(variance.contains("its input 5 does not have"), "{variance}");
        let scale = fault(17, "LayerNormalization", &[&[3], &[2, 1]], &[]);
        assert!(scale.contains("its input 2 of the shape (2, 1) does not go together"), "{scale}");
        assert!(fault(17, "LayerNormalization", &[image, &[3], &[2, 1, 1, 3]], &[]).contains("its input 3"));
    }

    #[test]
    fn gradients_are_right_for_each_set_of_values_that_is_normalised() {
        for case in [
            "batch_normalization",
            "layer_normalization",
            "layer_normalization/axes",
            "layer_normalization/broadcast",
            "instance_normalization",
        ] {
            check(case);
        }
    }
}
