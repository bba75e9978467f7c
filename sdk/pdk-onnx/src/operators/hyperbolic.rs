//! Functions of angles and hyperbolic functions, and their inverses.

use pdk_sdk::error::Result;

use super::functions::{each, times};
use super::operator::{Operator, Parts, Rule, same};
use crate::builder::Builder;
use crate::site::Site;

pub const OPERATORS: &[Operator] = &[
    Operator::new("Tan", same, |_, x| each(x, libm::tan), Rule::First(tan)),
    Operator::new(
        "Asin",
        same,
        |_, x| each(x, libm::asin),
        Rule::First(|site, b, g| inverse(site, b, g, -1.0, 1.0, 1.0)),
    ),
    Operator::new(
        "Acos",
        same,
        |_, x| each(x, libm::acos),
        Rule::First(|site, b, g| inverse(site, b, g, -1.0, 1.0, -1.0)),
    ),
    Operator::new(
        "Atan",
        same,
        |_, x| each(x, libm::atan),
        Rule::First(|site, b, g| quotient(site, b, g, 1.0)),
    ),
    Operator::new(
        "Sinh",
        same,
        |_, x| each(x, libm::sinh),
        Rule::First(|site, b, g| other(site, b, g, "Cosh")),
    ),
    Operator::new(
        "Cosh",
        same,
        |_, x| each(x, libm::cosh),
        Rule::First(|site, b, g| other(site, b, g, "Sinh")),
    ),
    Operator::new(
        "Asinh",
        same,
        |_, x| each(x, libm::asinh),
        Rule::First(|site, b, g| inverse(site, b, g, 1.0, 1.0, 1.0)),
    ),
    Operator::new(
        "Acosh",
        same,
        |_, x| each(x, libm::acosh),
        Rule::First(|site, b, g| inverse(site, b, g, 1.0, -1.0, 1.0)),
    ),
    Operator::new(
        "Atanh",
        same,
        |_, x| each(x, libm::atanh),
        Rule::First(|site, b, g| quotient(site, b, g, -1.0)),
    ),
];

/// `g * (1 + tan(x)^2)`.
fn tan(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let y = site.output(0)?;
    let square = b.mul(y, y)?;
    let slope = b.offset(&square, 1.0)?;
    times(b, g, &slope)
}

/// `g * operator(x)`.
fn other(site: &Site<'_>, b: &mut Builder, g: &str, operator: &str) -> Result<Parts> {
    let slope = b.unary(operator, site.input(0)?)?;
    times(b, g, &slope)
}

/// `g / (1 + sign * x^2)`.
fn quotient(site: &Site<'_>, b: &mut Builder, g: &str, sign: f64) -> Result<Parts> {
    let divisor = polynomial(site, b, sign, 1.0)?;
    Ok(vec![(0, b.binary("Div", g, &divisor)?)])
}

/// `factor * g / sqrt(square * x^2 + term)`.
fn inverse(site: &Site<'_>, b: &mut Builder, g: &str, square: f64, term: f64, factor: f64) -> Result<Parts> {
    let radicand = polynomial(site, b, square, term)?;
    let divisor = b.unary("Sqrt", &radicand)?;
    let g = b.scale(g, factor)?;
    Ok(vec![(0, b.binary("Div", &g, &divisor)?)])
}

/// `square * x^2 + term`.
fn polynomial(site: &Site<'_>, b: &mut Builder, square: f64, term: f64) -> Result<String> {
    let x = site.input(0)?;
    let squared = b.mul(x, x)?;
    let scaled = b.scale(&squared, square)?;
    b.offset(&scaled, term)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::graph::Graph;
    use crate::tensor::Tensor;
    use crate::testing::{Sketch, fault};

    #[test]
    fn numbers_outside_the_domain_give_no_number() {
        for operator in ["Asin", "Acos", "Acosh", "Atanh"] {
            let mut sketch = Sketch::new(9);
            sketch.input("x", &[1]);
            sketch.node(operator, &["x"], "y", &[]);
            let graph = Graph::new(sketch.model(&["y"])).unwrap();
            let y = graph.evaluate(&[("x", &Tensor::floats(&[1], vec![-2.0]))], &["y"]).unwrap();
            assert!(y[0].values[0].is_nan(), "{operator}");
        }
    }

    #[test]
    fn damaged_models_are_refused() {
        for operator in OPERATORS {
            assert!(fault(9, operator.name, &[], &[]).contains("its input 1 is missing"));
        }
    }
}
