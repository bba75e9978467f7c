//! Rectifiers with a slope or a bend of their own: `PRelu`, `Selu`, `Celu`, `ThresholdedRelu` and `Shrink`.

use pdk_sdk::error::{Error, Result};

use super::arithmetic::{binary, unbroadcast};
use super::functions::{each, times};
use super::operator::{Operator, Parts, Rule, check_broadcast, same};
use crate::builder::Builder;
use crate::order::{cut, further};
use crate::site::Site;
use crate::tensor::Tensor;
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[
    Operator::new("PRelu", infer_prelu, evaluate_prelu, Rule::First(prelu)),
    Operator::new("Selu", same, evaluate_selu, Rule::First(selu)),
    Operator::new("Celu", same, evaluate_celu, Rule::First(celu)),
    Operator::new("ThresholdedRelu", same, evaluate_thresholded, Rule::First(thresholded)),
    Operator::new("Shrink", same, evaluate_shrink, Rule::First(shrink)),
];

fn infer_prelu(site: &Site<'_>) -> Result<Vec<Fact>> {
    let (shape, slopes) = (site.shape(0)?, site.shape(1)?);
    // Later versions align the slopes with the last axis.
    if site.opset() < 7 && shape.len() > 2 && slopes.len() == 1 && slopes != [1] {
        return Err(Error::new(
            "it has a slope for each channel, as operator sets before 7 do; export the model for operator set 7 or later",
        ));
    }
    check_broadcast(site, 1)?;
    same(site)
}

fn evaluate_prelu(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    infer_prelu(site)?;
    binary(site, inputs, |x, slope| if x < 0.0 { slope * x } else { x })
}

fn prelu(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let x = site.input(0)?;
    let above = b.above(x, 0.0)?;
    let below = b.complement(&above)?;
    let g_below = b.mul(g, &below)?;
    let mut parts = Vec::new();
    if b.wants(site, 0) {
        let (over, under) = (b.mul(g, &above)?, b.mul(&g_below, site.input(1)?)?);
        parts.push((0, b.binary("Add", &over, &under)?));
    }
    if b.wants(site, 1) {
        parts.push((1, b.mul(&g_below, x)?));
    }
    unbroadcast(site, b, parts)
}

/// A slope of `slope` above 0, and below it one that is `factor` times what comes out and `term`: so nothing overflows above 0.
fn bent(site: &Site<'_>, b: &mut Builder, g: &str, slope: f64, [factor, term]: [f64; 2]) -> Result<Parts> {
    let above = b.above(site.input(0)?, 0.0)?;
    let below = b.complement(&above)?;
    let curve = b.scale(site.output(0)?, factor)?;
    let curve = b.offset(&curve, term)?;
    let curve = b.mul(&below, &curve)?;
    let above = b.scale(&above, slope)?;
    let slope = b.binary("Add", &above, &curve)?;
    times(b, g, &slope)
}

/// The factor of the exponential function, and that of all.
pub fn of_selu(site: &Site<'_>) -> (f64, f64) {
    (site.float("alpha", 1.673_263_2), site.float("gamma", 1.050_701))
}

fn evaluate_selu(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let (alpha, gamma) = of_selu(site);
    each(inputs, |x| gamma * if x > 0.0 { x } else { alpha * libm::expm1(x) })
}

fn selu(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let (alpha, gamma) = of_selu(site);
    bent(site, b, g, gamma, [1.0, gamma * alpha])
}

/// The bend of a node.
pub fn alpha_of_celu(site: &Site<'_>) -> Result<f64> {
    match site.float("alpha", 1.0) {
        0.0 => Err(Error::new("its alpha is 0; export it with another one")),
        alpha => Ok(alpha),
    }
}

fn evaluate_celu(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let alpha = alpha_of_celu(site)?;
    each(inputs, |x| cut(x) + further(0.0, alpha * libm::expm1(x / alpha), -1.0))
}

fn celu(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    bent(site, b, g, 1.0, [1.0 / alpha_of_celu(site)?, 1.0])
}

fn evaluate_thresholded(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let alpha = site.float("alpha", 1.0);
    each(inputs, |x| if x > alpha { x } else { 0.0 })
}

fn thresholded(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let slope = b.above(site.input(0)?, site.float("alpha", 1.0))?;
    times(b, g, &slope)
}

/// The distance from 0 up to which nothing comes out, and by how much the rest comes closer to 0.
fn of_shrink(site: &Site<'_>) -> (f64, f64) {
    (site.float("lambd", 0.5), site.float("bias", 0.0))
}

fn evaluate_shrink(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let (lambda, bias) = of_shrink(site);
    each(inputs, |x| {
        if x < -lambda {
            x + bias
        } else if x > lambda {
            x - bias
        } else {
            0.0
        }
    })
}

fn shrink(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let (lambda, _) = of_shrink(site);
    let x = site.input(0)?;
    let lower = b.number(x, -lambda)?;
    let (above, below) = (b.above(x, lambda)?, b.mask("Less", x, &lower)?);
    let slope = b.binary("Add", &above, &below)?;
    times(b, g, &slope)
}

#[cfg(test)]
mod tests {
    use crate::testing::{Setting, check, fault};

    #[test]
    fn gradients_are_right_on_each_piece_of_each_function() {
        for case in ["prelu", "prelu/channels", "prelu/slope", "selu", "celu", "thresholded_relu", "shrink"] {
            check(case);
        }
    }

    #[test]
    fn damaged_models_are_refused() {
        let slopes = fault(13, "PRelu", &[&[1, 2], &[3, 1, 2]], &[]);
        assert!(slopes.contains("its input 2 of the shape (3, 1, 2) does not go together"), "{slopes}");
        assert!(fault(13, "PRelu", &[&[1, 2]], &[]).contains("its input 2 is missing"));
        assert!(fault(6, "PRelu", &[&[1, 3, 2, 3], &[3]], &[]).contains("a slope for each channel"));
        assert!(fault(13, "Celu", &[&[2]], &[("alpha", Setting::Float(0.0))]).contains("its alpha is 0"));
        for operator in ["Selu", "ThresholdedRelu", "Shrink"] {
            assert!(fault(13, operator, &[], &[]).contains("its input 1 is missing"));
        }
    }
}
