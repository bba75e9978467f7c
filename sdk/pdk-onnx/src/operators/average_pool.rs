//! `AveragePool` and `GlobalAveragePool`: their gradient is spread evenly under the window.

use pdk_sdk::error::{Error, Result};

use super::max_pool::{pooled, window};
use super::operator::{Operator, Parts, Rule, given};
use crate::builder::Builder;
use crate::site::Site;
use crate::tensor::Tensor;
use crate::values::Fact;
use crate::window::Window;

pub const OPERATORS: &[Operator] = &[
    Operator::new("AveragePool", infer, evaluate, Rule::First(gradient)),
    Operator::new("GlobalAveragePool", infer_global, evaluate_global, Rule::First(gradient_global)),
];

fn infer(site: &Site<'_>) -> Result<Vec<Fact>> {
    Ok(vec![pooled(site, &window(site)?)?])
}

/// By how much the sum at each place is divided.
pub fn divisors(site: &Site<'_>, window: &Window) -> Vec<f64> {
    if site.int("count_include_pad", 0) == 0 {
        let mut counts = vec![0.0; window.output.iter().product()];
        window.pairs().iter().flatten().for_each(|&(to, _)| counts[to] += 1.0);
        return counts;
    }
    // Zeros that are declared count; what a window covers beyond them, where sizes are rounded up, does not.
    let around = |axis: usize| window.before[axis] + window.input[axis] + window.after[axis];
    let padded = Window {
        input: (0..window.kernel.len()).map(around).collect(),
        before: vec![0; window.kernel.len()],
        ..window.clone()
    };
    let mut counts = vec![0.0; window.output.iter().product()];
    padded.pairs().iter().flatten().for_each(|&(to, _)| counts[to] += 1.0);
    counts
}

fn evaluate(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let window = window(site)?;
    let image = given(inputs, 0)?;
    let fact = pooled(site, &window)?;
    let mut values = Tensor::filled(fact.element, &fact.shape, 0.0)?;
    let (input, output): (usize, usize) = (window.input.iter().product(), window.output.iter().product());
    let (pairs, divisors) = (window.pairs(), divisors(site, &window));
    for (plane, source) in values.values.chunks_mut(output.max(1)).zip(image.values.chunks(input.max(1))) {
        pairs.iter().flatten().for_each(|&(to, from)| plane[to] += source[from]);
        plane.iter_mut().zip(&divisors).for_each(|(sum, divisor)| *sum /= divisor);
    }
    Ok(vec![values])
}

fn gradient(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let window = window(site)?;
    let fact = pooled(site, &window)?;
    let channels = fact.shape[1];
    let mut shape = vec![1, 1];
    shape.extend(&window.output);
    let shares = divisors(site, &window).into_iter().map(|divisor| 1.0 / divisor).collect();
    let shares = b.constant(&Tensor { element: fact.element, shape, values: shares })?;
    let g = b.mul(g, &shares)?;
    let mut shape = vec![channels, 1];
    shape.extend(&window.kernel);
    let ones = Tensor::filled(fact.element, &shape, 1.0)?;
    let ones = b.constant(&ones)?;
    Ok(vec![(0, b.conv_transpose(&g, &ones, &window, channels)?)])
}

/// The number of elements of a plane.
fn plane(shape: &[usize]) -> Result<usize> {
    match shape.get(2..) {
        Some(axes) if !axes.is_empty() => Ok(axes.iter().product()),
        _ => Err(Error::new("its input has no spatial axes")),
    }
}

fn infer_global(site: &Site<'_>) -> Result<Vec<Fact>> {
    let fact = site.fact(0)?;
    plane(&fact.shape)?;
    let shape = fact.shape.iter().enumerate().map(|(axis, &dim)| if axis < 2 { dim } else { 1 }).collect();
    Ok(vec![Fact::new(fact.element, shape)])
}

fn evaluate_global(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let image = given(inputs, 0)?;
    let count = plane(&image.shape)?;
    let means =
        image.values.chunks(count.max(1)).map(|plane| plane.iter().sum::<f64>() / count as f64).collect();
    Ok(vec![Tensor { element: image.element, shape: site.output_shape()?.to_vec(), values: means }])
}

fn gradient_global(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let shape = site.shape(0)?;
    let share = b.scale(g, 1.0 / plane(shape)? as f64)?;
    Ok(vec![(0, b.spread(&share, shape)?)])
}

#[cfg(test)]
mod tests {
    use crate::testing::check;

    #[test]
    fn gradients_are_right_for_every_kind_of_window() {
        for case in [
            "average_pool",
            "average_pool/overlap",
            "average_pool/pads",
            "average_pool/counted",
            "average_pool/ceil",
            "global_average_pool",
        ] {
            check(case);
        }
    }
}
