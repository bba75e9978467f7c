//! Operators with norms: `LpNormalization`, `LpPool` and `GlobalLpPool`.

use pdk_sdk::error::{Error, Result};

use super::max_pool::{pooled, window};
use super::operator::{Operator, Rule, given, same};
use super::reduce;
use crate::site::{Site, axis};
use crate::tensor::Tensor;
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[
    Operator::new("LpNormalization", infer_normalized, evaluate_normalized, Rule::Unknown),
    Operator::new("LpPool", |site| Ok(vec![pooled(site, &window(site)?)?]), evaluate_pool, Rule::Unknown),
    Operator::new("GlobalLpPool", infer_global, evaluate_global, Rule::Unknown),
];

/// The exponent of the norm.
fn exponent(site: &Site<'_>) -> Result<f64> {
    match site.int("p", 2) {
        p if p >= 1 => Ok(p as f64),
        p => Err(Error::new(format!("its exponent `p` is {p}, but has to be at least 1"))),
    }
}

/// The power of a number whose sums make the norm.
fn power(x: f64, p: f64) -> f64 {
    if p == 2.0 { x * x } else { libm::pow(x.abs(), p) }
}

/// The norm from a sum of powers.
fn root(sum: f64, p: f64) -> f64 {
    if p == 2.0 { libm::sqrt(sum) } else { libm::pow(sum, 1.0 / p) }
}

/// The axis along which norms become 1, and their exponent.
fn normalized(site: &Site<'_>) -> Result<(usize, f64)> {
    let p = exponent(site)?;
    if p > 2.0 {
        return Err(Error::new(format!("its exponent `p` is {p}, but has to be 1 or 2")));
    }
    Ok((axis(site.int("axis", -1), site.shape(0)?.len())?, p))
}

fn infer_normalized(site: &Site<'_>) -> Result<Vec<Fact>> {
    normalized(site)?;
    same(site)
}

fn evaluate_normalized(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let (x, (axis, p)) = (given(inputs, 0)?, normalized(site)?);
    let mut kept = x.shape.clone();
    kept[axis] = 1;
    let sums = reduce::fold(x, &kept, 0.0, |sum, x| sum + power(x, p))?;
    let mut values = x.values.iter();
    let scaled = Tensor::from_fn(x.element, &x.shape, |at| {
        let (value, norm) = (values.next().copied().unwrap_or_default(), root(sums.broadcast_at(at), p));
        // Zeros stay zeros.
        if norm == 0.0 { 0.0 } else { value / norm }
    });
    Ok(vec![scaled?])
}

fn evaluate_pool(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let (image, p, window) = (given(inputs, 0)?, exponent(site)?, window(site)?);
    let fact = pooled(site, &window)?;
    let mut values = Tensor::filled(fact.element, &fact.shape, 0.0)?;
    let (input, output): (usize, usize) = (window.input.iter().product(), window.output.iter().product());
    let pairs = window.pairs();
    for (plane, source) in values.values.chunks_mut(output.max(1)).zip(image.values.chunks(input.max(1))) {
        pairs.iter().flatten().for_each(|&(to, from)| plane[to] += power(source[from], p));
        plane.iter_mut().for_each(|sum| *sum = root(*sum, p));
    }
    Ok(vec![values])
}

fn infer_global(site: &Site<'_>) -> Result<Vec<Fact>> {
    exponent(site)?;
    Ok(vec![Fact::new(site.fact(0)?.element, reduce::pooled(site)?)])
}

fn evaluate_global(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let p = exponent(site)?;
    let mut sums = reduce::fold(given(inputs, 0)?, &reduce::pooled(site)?, 0.0, |sum, x| sum + power(x, p))?;
    sums.values.iter_mut().for_each(|sum| *sum = root(*sum, p));
    Ok(vec![sums])
}

#[cfg(test)]
mod tests {
    use crate::tensor::Tensor;
    use crate::testing::{Setting, computed, fault};

    fn norms(operator: &str, shape: &[usize], settings: &[(&str, Setting<'_>)]) -> Vec<f64> {
        let found = computed(18, |s| {
            let x = s.weights("x", Tensor::floats(shape, vec![3.0, -4.0, 0.0, 0.0]));
            s.node(operator, &[&x], "y", settings);
        });
        found.unwrap().values
    }

    #[test]
    fn norms_are_taken_along_the_axis_and_over_planes() {
        assert_eq!(norms("LpNormalization", &[2, 2], &[]), [0.6, -0.8, 0.0, 0.0]);
        let sizes = [("p", Setting::Int(1)), ("axis", Setting::Int(0))];
        assert_eq!(norms("LpNormalization", &[2, 2], &sizes), [1.0, -1.0, 0.0, 0.0]);
        assert_eq!(norms("GlobalLpPool", &[1, 2, 2], &[]), [5.0, 0.0]);
        assert_eq!(norms("GlobalLpPool", &[1, 1, 4], &[("p", Setting::Int(1))]), [7.0]);
    }

    #[test]
    fn damaged_models_are_refused() {
        let p = |p| ("p", Setting::Int(p));
        assert!(fault(18, "LpNormalization", &[&[2]], &[p(3)]).contains("has to be 1 or 2"));
        assert!(fault(18, "LpNormalization", &[&[2]], &[p(0)]).contains("at least 1"));
        assert!(fault(18, "LpNormalization", &[&[]], &[]).contains("outside the 0 axes"));
        assert!(fault(18, "GlobalLpPool", &[&[1, 2]], &[]).contains("no spatial axes"));
        assert!(fault(18, "GlobalLpPool", &[&[1, 2, 3]], &[p(-1)]).contains("at least 1"));
        let kernel = |kernel| ("kernel_shape", Setting::Ints(kernel));
        assert!(fault(18, "LpPool", &[&[1, 2]], &[kernel(&[1])]).contains("no spatial axes"));
        assert!(fault(18, "LpPool", &[&[1, 2, 3]], &[]).contains("at least 1"));
        assert!(fault(18, "LpPool", &[&[1, 2, 3]], &[kernel(&[4])]).contains("its window of 4 is larger"));
        assert!(fault(18, "LpPool", &[&[1, 2, 3]], &[kernel(&[-1])]).contains("cannot be negative"));
        assert!(fault(18, "LpPool", &[&[1, 2, 3]], &[kernel(&[i64::MAX])]).contains("1073741824 at most"));
        let pads = ("pads", Setting::Ints(&[1 << 30, 1 << 30]));
        assert!(fault(18, "LpPool", &[&[1, 2, 3]], &[kernel(&[1 << 30]), pads]).contains("is too large"));
        assert!(fault(18, "LpPool", &[&[1, 2, 3]], &[kernel(&[2]), p(0)]).contains("`p` is 0"));
    }
}
