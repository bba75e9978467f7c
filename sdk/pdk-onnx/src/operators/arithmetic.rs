//! `Add`, `Sub`, `Mul`, `Div` and `Pow`, with shapes that are broadcast, and `Sum` of any number of values.

use pdk_sdk::error::Result;

use super::operator::{Operator, Parts, Rule, given};
use crate::builder::Builder;
use crate::site::Site;
use crate::tensor::{Tensor, broadcast};
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[
    Operator::new("Add", infer, |site, inputs| binary(site, inputs, |a, b| a + b), Rule::First(add)),
    Operator::new("Sub", infer, |site, inputs| binary(site, inputs, |a, b| a - b), Rule::First(sub)),
    Operator::new("Mul", infer, |site, inputs| binary(site, inputs, |a, b| a * b), Rule::First(mul)),
    Operator::new("Div", infer, divide, Rule::First(div)),
    Operator::new("Pow", infer, |site, inputs| binary(site, inputs, libm::pow), Rule::First(pow)),
    Operator::new("Sum", infer, sum_all, Rule::First(sum)),
];

/// The type of the first, and the shape that all are broadcast to.
pub fn infer(site: &Site<'_>) -> Result<Vec<Fact>> {
    let shapes = (0..site.node.input.len()).map(|place| site.shape(place)).collect::<Result<Vec<_>>>()?;
    Ok(vec![Fact::new(site.fact(0)?.element, broadcast(&shapes)?)])
}

/// Applies a function to each pair of elements.
pub fn binary(
    site: &Site<'_>,
    inputs: &[Option<&Tensor>],
    f: impl Fn(f64, f64) -> f64,
) -> Result<Vec<Tensor>> {
    let (a, b) = (given(inputs, 0)?, given(inputs, 1)?);
    let fact = infer(site)?.swap_remove(0);
    Ok(vec![Tensor::from_fn(fact.element, &fact.shape, |at| f(a.broadcast_at(at), b.broadcast_at(at)))?])
}

fn divide(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    match given(inputs, 0)?.element.is_float() {
        true => binary(site, inputs, |a, b| a / b),
        false => binary(site, inputs, |a, b| (a / b).trunc()),
    }
}

fn sum_all(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let fact = infer(site)?.swap_remove(0);
    let sum = |at: &[usize]| inputs.iter().flatten().map(|input| input.broadcast_at(at)).sum();
    Ok(vec![Tensor::from_fn(fact.element, &fact.shape, sum)?])
}

/// The gradients, each as large as what comes out, summed to the shape of what went in.
pub fn unbroadcast(site: &Site<'_>, b: &mut Builder, gradients: Parts) -> Result<Parts> {
    let summed = gradients.into_iter().map(|(place, g)| Ok((place, b.sum_to(&g, site.shape(place)?)?)));
    summed.collect()
}

fn add(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    sum(site, b, g)
}

fn sum(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let wanted = (0..site.node.input.len()).filter(|&place| b.wants(site, place));
    let parts = wanted.map(|place| (place, g.to_owned())).collect();
    unbroadcast(site, b, parts)
}

fn sub(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let mut parts = Vec::new();
    if b.wants(site, 0) {
        parts.push((0, g.to_owned()));
    }
    if b.wants(site, 1) {
        parts.push((1, b.unary("Neg", g)?));
    }
    unbroadcast(site, b, parts)
}

fn mul(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let mut parts = Vec::new();
    for place in 0..2 {
        if b.wants(site, place) {
            parts.push((place, b.mul(g, site.input(1 - place)?)?));
        }
    }
    unbroadcast(site, b, parts)
}

fn div(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let quotient = b.binary("Div", g, site.input(1)?)?;
    let mut parts = Vec::new();
    if b.wants(site, 0) {
        parts.push((0, quotient.clone()));
    }
    if b.wants(site, 1) {
        let product = b.mul(&quotient, site.output(0)?)?;
        parts.push((1, b.unary("Neg", &product)?));
    }
    unbroadcast(site, b, parts)
}

fn pow(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let mut parts = Vec::new();
    let base = site.input(0)?;
    let element = b.element(base)?;
    if b.wants(site, 0) {
        let (exponent, less) = match site.values.constant(site.input(1)?)? {
            // If the exponent is 0 the gradient is 0, also at 0, whose power -1 is infinite.
            Some(exponent) => {
                let less = exponent.values.iter().map(|&e| if e == 0.0 { 0.0 } else { e - 1.0 }).collect();
                let less = Tensor { element, values: less, ..(*exponent).clone() };
                (b.constant(&Tensor { element, ..(*exponent).clone() })?, b.constant(&less)?)
            }
            None => {
                let exponent = b.cast(site.input(1)?, element)?;
                let less = b.offset(&exponent, -1.0)?;
                (exponent, less)
            }
        };
        let power = b.binary("Pow", base, &less)?;
        let slope = b.mul(&exponent, &power)?;
        parts.push((0, b.mul(g, &slope)?));
    }
    if b.wants(site, 1) {
        let log = b.unary("Log", base)?;
        let slope = b.mul(site.output(0)?, &log)?;
        parts.push((1, b.mul(g, &slope)?));
    }
    unbroadcast(site, b, parts)
}

#[cfg(test)]
mod tests {
    use crate::testing::check;

    #[test]
    fn gradients_are_right_on_both_sides_and_through_broadcasts() {
        for operator in ["add", "sub", "mul", "div", "pow"] {
            for side in ["", "/right", "/both", "/scalar", "/scalar_right"] {
                check(&format!("{operator}{side}"));
            }
        }
        check("sum");
    }
}
