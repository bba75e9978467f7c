//! `Softmax`, `LogSoftmax` and `Hardmax`.

use pdk_sdk::error::Result;

use super::operator::{Operator, Parts, Rule, given, same};
use crate::builder::Builder;
use crate::order::greater;
use crate::site::{Site, axis};
use crate::tensor::Tensor;

pub const OPERATORS: &[Operator] = &[
    Operator::new("Softmax", same, |site, inputs| evaluate(site, inputs, libm::exp), Rule::First(softmax)),
    Operator::new(
        "LogSoftmax",
        same,
        |site, inputs| evaluate(site, inputs, |log| log),
        Rule::First(log_softmax),
    ),
    Operator::new("Hardmax", same, hardmax, Rule::Zero),
];

/// The axes that sum to one: one axis, or before version 13 all from one on.
fn axes(site: &Site<'_>) -> Result<Vec<usize>> {
    let rank = site.shape(0)?.len();
    match site.opset() {
        ..13 => Ok((axis(site.int("axis", 1), rank)?..rank).collect()),
        _ => Ok(vec![axis(site.int("axis", -1), rank)?]),
    }
}

/// The number of elements that sum to one, and how far they are apart.
pub fn group(site: &Site<'_>) -> Result<(usize, usize)> {
    let (axes, shape) = (axes(site)?, site.shape(0)?);
    let length = axes.iter().map(|&axis| shape[axis]).product();
    Ok((length, axes.last().map_or(1, |&last| shape[last + 1..].iter().product())))
}

fn evaluate(site: &Site<'_>, inputs: &[Option<&Tensor>], finish: fn(f64) -> f64) -> Result<Vec<Tensor>> {
    each_group(site, inputs, |group| {
        let greatest = group.iter().copied().fold(f64::NEG_INFINITY, greater);
        let sum: f64 = group.iter().map(|value| libm::exp(value - greatest)).sum();
        let log = libm::log(sum);
        // In this order, since the greatest may be so large that nothing of the logarithm is left in a sum with it.
        group.iter_mut().for_each(|value| *value = finish((*value - greatest) - log));
    })
}

/// Replaces the elements that belong together, group by group.
fn each_group(
    site: &Site<'_>,
    inputs: &[Option<&Tensor>],
    replace: impl Fn(&mut [f64]),
) -> Result<Vec<Tensor>> {
    let mut result = given(inputs, 0)?.clone();
    let (length, inner) = group(site)?;
    let mut group = vec![0.0; length];
    for block in result.values.chunks_mut((length * inner).max(1)) {
        for column in 0..inner {
            let places = || (0..length).map(|row| row * inner + column);
            group.iter_mut().zip(places()).for_each(|(value, place)| *value = block[place]);
            replace(&mut group);
            group.iter().zip(places()).for_each(|(value, place)| block[place] = *value);
        }
    }
    Ok(vec![result])
}

/// 1 at the first of the greatest elements, else 0.
fn hardmax(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    each_group(site, inputs, |group| {
        let greatest = group.iter().copied().fold(f64::NEG_INFINITY, greater);
        let first = group.iter().position(|value| *value == greatest);
        group.iter_mut().enumerate().for_each(|(at, value)| *value = f64::from(u8::from(first == Some(at))));
    })
}

fn softmax(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let y = site.output(0)?;
    let product = b.mul(g, y)?;
    let sum = b.sum(&product, &axes(site)?)?;
    let rest = b.binary("Sub", g, &sum)?;
    Ok(vec![(0, b.mul(y, &rest)?)])
}

fn log_softmax(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let share = b.unary("Exp", site.output(0)?)?;
    let sum = b.sum(g, &axes(site)?)?;
    let taken = b.mul(&share, &sum)?;
    Ok(vec![(0, b.binary("Sub", g, &taken)?)])
}

#[cfg(test)]
mod tests {
    use crate::graph::Graph;
    use crate::tensor::Tensor;
    use crate::testing::{Sketch, check};

    #[test]
    fn shares_sum_to_one_however_large_the_values_are() {
        let mut s = Sketch::new(17);
        s.input("x", &[1, 4]);
        s.node("Softmax", &["x"], "y", &[]);
        let graph = Graph::new(s.model(&["y"])).unwrap();
        let x = Tensor::floats(&[1, 4], vec![1e20, 1e20, -1e20, 1e20]);
        let shares = graph.evaluate(&[("x", &x)], &["y"]).unwrap().swap_remove(0);
        let expected = [1.0 / 3.0, 1.0 / 3.0, 0.0, 1.0 / 3.0];
        assert!(shares.values.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12), "{shares:?}");
    }

    #[test]
    fn gradients_are_right_along_each_axis_and_in_old_versions() {
        for case in ["softmax", "softmax/axis", "softmax/old", "log_softmax"] {
            check(case);
        }
    }
}
