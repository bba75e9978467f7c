//! Functions of one number: `Sqrt`, `Neg`, `Abs`, `Exp`, `Log`, `Tanh`, `Sigmoid`, `Erf`, `Reciprocal`, `Sin`, `Cos`, and the
//! rectifiers `Relu`, `LeakyRelu`, `Elu`, `HardSigmoid`, `HardSwish`, `Softplus` and `Clip`.

use std::f64::consts::PI;

use pdk_sdk::error::Result;

use super::operator::{Operator, Parts, Rule, given, same};
use crate::builder::Builder;
use crate::order::{self, cut};
use crate::site::Site;
use crate::tensor::Tensor;

pub const OPERATORS: &[Operator] = &[
    Operator::new("Sqrt", same, |_, x| each(x, libm::sqrt), Rule::First(sqrt)),
    Operator::new(
        "Neg",
        same,
        |_, x| each_wrapped(x, |x| -x),
        Rule::First(|_, b, g| Ok(vec![(0, b.unary("Neg", g)?)])),
    ),
    Operator::new("Abs", same, |_, x| each_wrapped(x, f64::abs), Rule::First(abs)),
    Operator::new("Exp", same, |_, x| each(x, libm::exp), Rule::First(exp)),
    Operator::new("Log", same, |_, x| each(x, libm::log), Rule::First(log)),
    Operator::new("Tanh", same, |_, x| each(x, libm::tanh), Rule::First(tanh)),
    Operator::new("Sigmoid", same, |_, x| each(x, sigmoid), Rule::First(sigmoid_gradient)),
    Operator::new("Erf", same, |_, x| each(x, libm::erf), Rule::First(erf)),
    Operator::new("Reciprocal", same, |_, x| each(x, |x| 1.0 / x), Rule::First(reciprocal)),
    Operator::new("Sin", same, |_, x| each(x, libm::sin), Rule::First(sin)),
    Operator::new("Cos", same, |_, x| each(x, libm::cos), Rule::First(cos)),
    Operator::new("Relu", same, |_, x| each(x, cut), Rule::First(relu)),
    Operator::new("LeakyRelu", same, leaky_relu_value, Rule::First(leaky_relu)),
    Operator::new("Elu", same, elu_value, Rule::First(elu)),
    Operator::new("HardSigmoid", same, hard_sigmoid_value, Rule::First(hard_sigmoid)),
    Operator::new(
        "HardSwish",
        same,
        |_, x| each(x, |x| x * (x / 6.0 + 0.5).clamp(0.0, 1.0)),
        Rule::First(hard_swish),
    ),
    Operator::new("Softplus", same, |_, x| each(x, softplus), Rule::First(softplus_gradient)),
    Operator::new("Clip", same, clip_value, Rule::First(clip)),
];

/// Applies a function to each element.
pub fn each(inputs: &[Option<&Tensor>], f: impl Fn(f64) -> f64) -> Result<Vec<Tensor>> {
    let input = given(inputs, 0)?;
    Ok(vec![Tensor { values: input.values.iter().map(|&x| f(x)).collect(), ..input.clone() }])
}

/// Applies a function to each element. Integers wrap: the least one has no opposite.
fn each_wrapped(inputs: &[Option<&Tensor>], f: impl Fn(f64) -> f64) -> Result<Vec<Tensor>> {
    let element = given(inputs, 0)?.element;
    each(inputs, |x| if element.is_integer() { element.wrapped(f(x) as i128) } else { f(x) })
}

/// The gradient times the slope of the function.
pub fn times(b: &mut Builder, g: &str, slope: &str) -> Result<Parts> {
    Ok(vec![(0, b.mul(g, slope)?)])
}

fn sqrt(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let half = b.scale(g, 0.5)?;
    Ok(vec![(0, b.binary("Div", &half, site.output(0)?)?)])
}

/// 1 above 0 and -1 below it.
pub fn sign(b: &mut Builder, x: &str) -> Result<String> {
    let zero = b.number(x, 0.0)?;
    let (above, below) = (b.mask("Greater", x, &zero)?, b.mask("Less", x, &zero)?);
    b.binary("Sub", &above, &below)
}

fn abs(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let sign = sign(b, site.input(0)?)?;
    times(b, g, &sign)
}

fn exp(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    times(b, g, site.output(0)?)
}

fn log(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    Ok(vec![(0, b.binary("Div", g, site.input(0)?)?)])
}

fn tanh(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let y = site.output(0)?;
    let square = b.mul(y, y)?;
    let slope = b.complement(&square)?;
    times(b, g, &slope)
}

/// The logistic function.
pub fn sigmoid(x: f64) -> f64 {
    1.0 / (1.0 + libm::exp(-x))
}

/// The logarithm of 1 + e^x.
pub fn softplus(x: f64) -> f64 {
    libm::log1p(libm::exp(-x.abs())) + cut(x)
}

fn sigmoid_gradient(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let y = site.output(0)?;
    let rest = b.complement(y)?;
    let slope = b.mul(y, &rest)?;
    times(b, g, &slope)
}

fn erf(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let x = site.input(0)?;
    let square = b.mul(x, x)?;
    let falling = b.unary("Neg", &square)?;
    let bell = b.unary("Exp", &falling)?;
    let slope = b.scale(&bell, 2.0 / PI.sqrt())?;
    times(b, g, &slope)
}

fn reciprocal(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let y = site.output(0)?;
    let square = b.mul(y, y)?;
    let slope = b.unary("Neg", &square)?;
    times(b, g, &slope)
}

fn sin(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let slope = b.unary("Cos", site.input(0)?)?;
    times(b, g, &slope)
}

fn cos(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let sin = b.unary("Sin", site.input(0)?)?;
    let slope = b.unary("Neg", &sin)?;
    times(b, g, &slope)
}

fn relu(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let slope = b.above(site.input(0)?, 0.0)?;
    times(b, g, &slope)
}

fn leaky_relu_value(site: &Site<'_>, x: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let alpha = site.float("alpha", 0.01);
    each(x, |x| if x < 0.0 { alpha * x } else { x })
}

fn leaky_relu(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let alpha = site.float("alpha", 0.01);
    let above = b.above(site.input(0)?, 0.0)?;
    let more = b.scale(&above, 1.0 - alpha)?;
    let slope = b.offset(&more, alpha)?;
    times(b, g, &slope)
}

fn elu_value(site: &Site<'_>, x: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let alpha = site.float("alpha", 1.0);
    each(x, |x| if x < 0.0 { alpha * libm::expm1(x) } else { x })
}

fn elu(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    // Below zero the slope is alpha e^x, which is y + alpha: so nothing overflows above zero.
    let above = b.above(site.input(0)?, 0.0)?;
    let below = b.complement(&above)?;
    let curve = b.offset(site.output(0)?, site.float("alpha", 1.0))?;
    let curve = b.mul(&below, &curve)?;
    let slope = b.binary("Add", &above, &curve)?;
    times(b, g, &slope)
}

fn hard_sigmoid_value(site: &Site<'_>, x: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let (alpha, beta) = (site.float("alpha", 0.2), site.float("beta", 0.5));
    each(x, |x| (alpha * x + beta).clamp(0.0, 1.0))
}

fn hard_sigmoid(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let y = site.output(0)?;
    let (above, one) = (b.above(y, 0.0)?, b.number(y, 1.0)?);
    let below = b.mask("Less", y, &one)?;
    let within = b.mul(&above, &below)?;
    let slope = b.scale(&within, site.float("alpha", 0.2))?;
    times(b, g, &slope)
}

fn hard_swish(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    // From -3 to 3 the slope is x / 3 + 1 / 2, below it is 0, above it is 1.
    let x = site.input(0)?;
    let (from, above, three) = (b.above(x, -3.0)?, b.above(x, 3.0)?, b.number(x, 3.0)?);
    let below = b.mask("Less", x, &three)?;
    let within = b.mul(&from, &below)?;
    let line = b.scale(x, 1.0 / 3.0)?;
    let line = b.offset(&line, 0.5)?;
    let middle = b.mul(&within, &line)?;
    let slope = b.binary("Add", &middle, &above)?;
    times(b, g, &slope)
}

fn softplus_gradient(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let slope = b.unary("Sigmoid", site.input(0)?)?;
    times(b, g, &slope)
}

/// The least and greatest value, if they are given.
pub fn bounds(site: &Site<'_>) -> Result<[Option<f64>; 2]> {
    Ok([site.number_at(1, "min")?, site.number_at(2, "max")?])
}

fn clip_value(site: &Site<'_>, x: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let [low, high] = bounds(site)?;
    let (low, high) = (low.unwrap_or(f64::NEG_INFINITY), high.unwrap_or(f64::INFINITY));
    each(x, |x| order::clip(x, low, high))
}

fn clip(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let x = site.input(0)?;
    let mut gradient = g.to_owned();
    // At a bound itself the slope is 1.
    for (bound, operator) in bounds(site)?.into_iter().zip(["Less", "Greater"]) {
        if let Some(bound) = bound {
            let bound = b.number(x, bound)?;
            let outside = b.mask(operator, x, &bound)?;
            let inside = b.complement(&outside)?;
            gradient = b.mul(&gradient, &inside)?;
        }
    }
    Ok(vec![(0, gradient)])
}

#[cfg(test)]
mod tests {
    use crate::testing::check;

    #[test]
    fn gradients_are_right_on_each_piece_of_each_function() {
        for case in [
            "sqrt",
            "neg",
            "abs",
            "exp",
            "log",
            "tanh",
            "sigmoid",
            "erf",
            "reciprocal",
            "sin",
            "cos",
            "relu",
            "leaky_relu",
            "elu",
            "hard_sigmoid",
            "hard_swish",
            "softplus",
            "clip",
            "clip/low",
            "clip/high",
            "clip/none",
        ] {
            check(case);
        }
    }
}
