//! `Add`, `Sub`, `Mul`, `Div` and `Pow`, with shapes that are broadcast, and `Sum` of any number of values.

use pdk_sdk::error::{Error, Result};

use super::operator::{Operator, Parts, Rule, given};
use crate::builder::Builder;
use crate::site::{Site, axis};
use crate::tensor::{Element, Tensor, broadcast};
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[
    Operator::new("Add", infer, |site, inputs| of_type(site, inputs, Element::sum), Rule::First(add)),
    Operator::new("Sub", infer, |site, inputs| of_type(site, inputs, Element::difference), Rule::First(sub)),
    Operator::new("Mul", infer, |site, inputs| of_type(site, inputs, Element::product), Rule::First(mul)),
    Operator::new("Div", infer, divide, Rule::First(div)),
    Operator::new("Pow", infer, power, Rule::First(pow)),
    Operator::new("Sum", infer, sum_all, Rule::First(sum)),
];

/// The type of the first, and the shape that all are broadcast to.
pub fn infer(site: &Site<'_>) -> Result<Vec<Fact>> {
    check_alignment(site)?;
    let shapes = (0..site.node.input.len()).map(|place| site.shape(place)).collect::<Result<Vec<_>>>()?;
    Ok(vec![Fact::new(site.fact(0)?.element, broadcast(&shapes)?)])
}

/// Refuses the second operand of an old file if it is not aligned with the last axes of the first: before version 7, operators had an attribute
/// for that, which later versions do not have.
fn check_alignment(site: &Site<'_>) -> Result<()> {
    let Some(first) = site.optional_int("axis").filter(|_| site.int("broadcast", 0) != 0) else {
        return Ok(());
    };
    let (left, right) = (site.shape(0)?, site.shape(1)?);
    let is_one = right.iter().all(|length| *length == 1);
    match is_one || axis(first, left.len())? + right.len() == left.len() {
        true => Ok(()),
        false => Err(Error::new(format!(
            "it aligns its second input with axis {first} of the first one, as operator sets before 7 do; export the model for operator set 7 or later"
        ))),
    }
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

/// Applies a function for elements of a type to each pair of them.
fn of_type(
    site: &Site<'_>,
    inputs: &[Option<&Tensor>],
    f: fn(Element, f64, f64) -> f64,
) -> Result<Vec<Tensor>> {
    let element = given(inputs, 0)?.element;
    binary(site, inputs, |a, b| f(element, a, b))
}

fn divide(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let divisor = given(inputs, 1)?;
    if divisor.element.is_integer() && divisor.values.contains(&0.0) {
        return Err(Error::new("it divides an integer by 0; export the model with another divisor"));
    }
    let element = given(inputs, 0)?.element;
    binary(site, inputs, |a, b| match element.is_integer() {
        true => element.wrapped((a as i128).checked_div(b as i128).unwrap_or_default()),
        false => a / b,
    })
}

fn power(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let element = given(inputs, 0)?.element;
    if !element.is_integer() {
        return binary(site, inputs, libm::pow);
    }
    // A power of an integer wraps as a product does. One with a negative or broken exponent is cut to an integer.
    binary(site, inputs, |base, exponent| match exponent >= 0.0 && exponent.fract() == 0.0 {
        true => element.wrapped(whole_power(base as i128, exponent as u64)),
        false => element.saturated(libm::pow(base, exponent).trunc()),
    })
}

/// The low bits of a power.
fn whole_power(mut base: i128, mut exponent: u64) -> i128 {
    let mut result = 1i128;
    while exponent > 0 {
        if exponent & 1 == 1 {
            result = result.wrapping_mul(base);
        }
        base = base.wrapping_mul(base);
        exponent >>= 1;
    }
    result
}

/// Joins the elements of all inputs at the same place, in order.
pub fn join(site: &Site<'_>, inputs: &[Option<&Tensor>], join: impl Fn(f64, f64) -> f64) -> Result<Tensor> {
    let fact = infer(site)?.swap_remove(0);
    let inputs = (0..site.node.input.len()).map(|place| given(inputs, place)).collect::<Result<Vec<_>>>()?;
    Tensor::from_fn(fact.element, &fact.shape, |at| {
        inputs.iter().map(|input| input.broadcast_at(at)).reduce(&join).unwrap_or_default()
    })
}

fn sum_all(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let element = given(inputs, 0)?.element;
    Ok(vec![join(site, inputs, |a, b| element.sum(a, b))?])
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
        let base = base_of_logarithm(site, b)?;
        let log = b.unary("Log", &base)?;
        let slope = b.mul(site.output(0)?, &log)?;
        parts.push((1, b.mul(g, &slope)?));
    }
    unbroadcast(site, b, parts)
}

/// The base of a power, but 1 where a base of 0 has an exponent of at least 0: its power does not change with the exponent, and the
/// logarithm of 0 would make the product infinite or not a number.
fn base_of_logarithm(site: &Site<'_>, b: &mut Builder) -> Result<String> {
    let base = site.input(0)?;
    let exponent = b.cast(site.input(1)?, b.element(base)?)?;
    let zero = b.number(base, 0.0)?;
    let (above, below) = (b.mask("Greater", base, &zero)?, b.mask("Less", base, &zero)?);
    let other = b.binary("Add", &above, &below)?;
    let is_zero = b.complement(&other)?;
    let falling = b.mask("Less", &exponent, &zero)?;
    let rising = b.complement(&falling)?;
    let flat = b.mul(&is_zero, &rising)?;
    b.binary("Add", base, &flat)
}

#[cfg(test)]
mod tests {
    use crate::gradient::{Target, gradients};
    use crate::graph::Graph;
    use crate::tensor::{Element, Tensor};
    use crate::testing::{Setting, Sketch, check, computed};

    #[test]
    fn the_power_of_zero_does_not_change_with_an_exponent_of_at_least_zero() {
        let mut s = Sketch::new(13);
        s.input("x", &[4]);
        let exponents = s.weights("e", Tensor::floats(&[4], vec![2.0, 0.0, 3.0, -1.0]));
        s.node("Pow", &["x", &exponents], "powers", &[]);
        s.node("ReduceSum", &["powers"], "y", &[]);
        let graph = Graph::new(s.model(&["y"])).unwrap();
        let built = gradients(&graph, Target { value: "y", index: 0 }, &["e"], &[]).unwrap();
        let x = Tensor::floats(&[4], vec![0.0, 0.0, 2.0, 0.0]);
        let derived = Graph::new(built.model).unwrap();
        let gradient = derived.evaluate(&[("x", &x)], &[&built.outputs[0]]).unwrap().swap_remove(0).values;
        assert_eq!(gradient[..2], [0.0, 0.0]);
        assert!((gradient[2] - 8.0 * libm::log(2.0)).abs() < 1e-6, "{gradient:?}");
        assert_eq!(gradient[3], f64::NEG_INFINITY);
    }

    #[test]
    fn operands_that_old_files_align_along_an_axis_are_refused() {
        let sum = |axis: Option<i64>, shape: &[usize]| {
            let mut s = Sketch::new(6);
            s.input("x", &[1, 4, 4, 4]);
            let other = s.drawn(shape, -1.0, 1.0);
            let settings = [("broadcast", Setting::Int(1)), ("axis", Setting::Int(axis.unwrap_or_default()))];
            s.node("Add", &["x", &other], "y", &settings[..1 + usize::from(axis.is_some())]);
            Graph::new(s.model(&["y"])).unwrap().fact("y").cloned()
        };
        let error = sum(Some(1), &[4]).unwrap_err().to_string();
        assert!(error.contains("aligns its second input with axis 1"), "{error}");
        for (axis, shape) in
            [(None, &[4][..]), (Some(3), &[4]), (Some(2), &[4, 4]), (Some(-1), &[4]), (Some(1), &[])]
        {
            assert_eq!(sum(axis, shape).unwrap().shape, [1, 4, 4, 4], "{axis:?} {shape:?}");
        }
    }

    #[test]
    fn integers_wrap_and_division_cuts() {
        let (byte, signed, int) = (Element::UINT8, Element::INT8, Element::INT32);
        let joined = |operator: &str, element: Element, a: &[f64], b: &[f64]| {
            computed(13, |s| {
                let [a, b] = [("a", a), ("b", b)].map(|(name, values)| {
                    s.weights(name, Tensor { element, shape: vec![values.len()], values: values.to_vec() })
                });
                s.node(operator, &[&a, &b], "y", &[]);
            })
        };
        for (operator, element, a, b, expected) in [
            ("Add", byte, [200.0, 1.0], [100.0, 2.0], [44.0, 3.0]),
            ("Sub", byte, [1.0, 5.0], [2.0, 5.0], [255.0, 0.0]),
            ("Sub", signed, [-128.0, 5.0], [1.0, 5.0], [127.0, 0.0]),
            ("Mul", signed, [64.0, -3.0], [2.0, 5.0], [-128.0, -15.0]),
            ("Mul", int, [2147483647.0, 65536.0], [2147483647.0, 65537.0], [1.0, 65536.0]),
            ("Div", int, [-7.0, 7.0], [2.0, -2.0], [-3.0, -3.0]),
            ("Div", signed, [-128.0, 9.0], [-1.0, 3.0], [-128.0, 3.0]),
            ("Pow", int, [3.0, 2.0], [19.0, 33.0], [1162261467.0, 0.0]),
            ("Pow", int, [2.0, 1.0], [-1.0, -5.0], [0.0, 1.0]),
        ] {
            assert_eq!(
                joined(operator, element, &a, &b).unwrap().values,
                expected,
                "{operator} of {element}"
            );
        }
        let error = joined("Div", int, &[1.0], &[0.0]).unwrap_err().to_string();
        assert!(error.contains("it divides an integer by 0"), "{error}");
    }

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
