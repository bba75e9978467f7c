//! Operators whose value is constant in steps, so that their gradient is zero: comparisons, logic and rounding.

use pdk_sdk::error::Result;

use super::arithmetic;
use super::functions::each;
use super::operator::{Operator, Rule, same};
use crate::site::Site;
use crate::tensor::{Element, Tensor};
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[
    Operator::new("Equal", infer, |site, inputs| holds(site, inputs, |a, b| a == b), Rule::Zero),
    Operator::new("Greater", infer, |site, inputs| holds(site, inputs, |a, b| a > b), Rule::Zero),
    Operator::new("GreaterOrEqual", infer, |site, inputs| holds(site, inputs, |a, b| a >= b), Rule::Zero),
    Operator::new("Less", infer, |site, inputs| holds(site, inputs, |a, b| a < b), Rule::Zero),
    Operator::new("LessOrEqual", infer, |site, inputs| holds(site, inputs, |a, b| a <= b), Rule::Zero),
    Operator::new("And", infer, |site, inputs| holds(site, inputs, |a, b| a != 0.0 && b != 0.0), Rule::Zero),
    Operator::new("Or", infer, |site, inputs| holds(site, inputs, |a, b| a != 0.0 || b != 0.0), Rule::Zero),
    Operator::new(
        "Xor",
        infer,
        |site, inputs| holds(site, inputs, |a, b| (a != 0.0) != (b != 0.0)),
        Rule::Zero,
    ),
    Operator::new("IsNaN", infer_one, |_, x| holds_for(x, f64::is_nan), Rule::Zero),
    Operator::new("IsInf", infer_one, is_infinite, Rule::Zero),
    Operator::new("Not", same, |_, x| each(x, |x| f64::from(u8::from(x == 0.0))), Rule::Zero),
    Operator::new("Floor", same, |_, x| each(x, f64::floor), Rule::Zero),
    Operator::new("Ceil", same, |_, x| each(x, f64::ceil), Rule::Zero),
    Operator::new("Round", same, |_, x| each(x, f64::round_ties_even), Rule::Zero),
    Operator::new("Sign", same, |_, x| each(x, |x| if x == 0.0 { 0.0 } else { x.signum() }), Rule::Zero),
];

fn infer(site: &Site<'_>) -> Result<Vec<Fact>> {
    let fact = arithmetic::infer(site)?.swap_remove(0);
    Ok(vec![Fact::new(Element::BOOL, fact.shape)])
}

fn holds(site: &Site<'_>, inputs: &[Option<&Tensor>], f: fn(f64, f64) -> bool) -> Result<Vec<Tensor>> {
    let values = arithmetic::binary(site, inputs, |a, b| f64::from(u8::from(f(a, b))))?;
    Ok(values.into_iter().map(|tensor| Tensor { element: Element::BOOL, ..tensor }).collect())
}

fn infer_one(site: &Site<'_>) -> Result<Vec<Fact>> {
    Ok(vec![Fact::new(Element::BOOL, site.shape(0)?.to_vec())])
}

fn holds_for(inputs: &[Option<&Tensor>], f: impl Fn(f64) -> bool) -> Result<Vec<Tensor>> {
    let values = each(inputs, |x| f64::from(u8::from(f(x))))?;
    Ok(values.into_iter().map(|tensor| Tensor { element: Element::BOOL, ..tensor }).collect())
}

fn is_infinite(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let (above, below) = (site.int("detect_positive", 1) != 0, site.int("detect_negative", 1) != 0);
    holds_for(inputs, |x| above && x == f64::INFINITY || below && x == f64::NEG_INFINITY)
}
