//! `QuantizeLinear`, `DequantizeLinear` and `DynamicQuantizeLinear`: floats as small integers, and back.

use pdk_sdk::error::{Error, Result};

use super::inputs::optional;
use super::operator::{Operator, Rule, given};
use crate::order::{greater, lesser};
use crate::site::{Site, axis};
use crate::tensor::{Element, Tensor, shape_text};
use crate::values::Fact;

pub const OPERATORS: &[Operator] = &[
    Operator::new("QuantizeLinear", infer_quantize, evaluate_quantize, Rule::Zero),
    Operator::new("DequantizeLinear", infer_dequantize, evaluate_dequantize, Rule::Unknown),
    Operator::new("DynamicQuantizeLinear", infer_dynamic, evaluate_dynamic, Rule::Unknown),
];

/// Which factor belongs to an element.
pub enum Factors {
    /// The same factor for all elements.
    One,
    /// A factor for each place along an axis.
    Along(usize),
    /// A factor for each block of this many elements along an axis.
    Blocks { axis: usize, length: usize, shape: Vec<usize> },
}

impl Factors {
    /// How factors of a shape belong to the elements of an input.
    pub fn of(site: &Site<'_>, input: &[usize], factors: &[usize]) -> Result<Self> {
        let wrong = |expected: &str| {
            Error::new(format!(
                "its factors have the shape {}, but its input {} needs {expected}",
                shape_text(factors),
                shape_text(input)
            ))
        };
        let block = usize::try_from(site.int("block_size", 0))
            .map_err(|_| Error::new("its `block_size` is negative; use 0 for no blocks"))?;
        let along = || axis(site.int("axis", 1), input.len());
        if block > 0 {
            let axis = along()?;
            let mut shape = input.to_vec();
            shape[axis] = shape[axis].div_ceil(block);
            return match factors == shape {
                true => Ok(Self::Blocks { axis, length: block, shape }),
                false => Err(wrong("one for each block")),
            };
        }
        match factors {
            [] | [1] => Ok(Self::One),
            &[length] => {
                let axis = along()?;
                if input[axis] == length { Ok(Self::Along(axis)) } else { Err(wrong("one for each place")) }
            }
            _ => Err(wrong("one number or a list")),
        }
    }

    /// The place of the factor of the element at a position.
    fn place(&self, position: &[usize]) -> usize {
        match self {
            Self::One => 0,
            Self::Along(axis) => position[*axis],
            Self::Blocks { axis, length, shape } => {
                position.iter().zip(shape).enumerate().fold(0, |index, (each, (&at, &dim))| {
                    index * dim + if each == *axis { at / length } else { at }
                })
            }
        }
    }
}

/// Checks that the zero points have the shape of the factors.
fn check_zero_points(factors: &[usize], zeros: Option<&[usize]>) -> Result<()> {
    let is_one = |shape: &[usize]| matches!(shape, [] | [1]);
    match zeros {
        Some(zeros) if zeros != factors && !(is_one(zeros) && is_one(factors)) => Err(Error::new(format!(
            "its zero points have the shape {}, but its factors {}",
            shape_text(zeros),
            shape_text(factors)
        ))),
        _ => Ok(()),
    }
}

/// Checks the shapes of an input, its factors and its zero points.
fn check(site: &Site<'_>) -> Result<()> {
    let factors = site.shape(1)?;
    Factors::of(site, site.shape(0)?, factors)?;
    check_zero_points(factors, site.optional(2).map(|_| site.shape(2)).transpose()?)
}

/// The type that an attribute names; nothing if it names none.
fn named_type(site: &Site<'_>) -> Result<Option<Element>> {
    match site.int("output_dtype", 0) {
        0 => Ok(None),
        number => i32::try_from(number)
            .map(|number| Some(Element(number)))
            .map_err(|_| Error::new(format!("its `output_dtype` {number} is not a type"))),
    }
}

fn infer_quantize(site: &Site<'_>) -> Result<Vec<Fact>> {
    check(site)?;
    let element = match site.optional(2) {
        Some(_) => site.fact(2)?.element,
        None => named_type(site)?.unwrap_or(Element::UINT8),
    };
    if !element.is_integer() && !element.is_float8() {
        return Err(Error::new(format!(
            "it quantizes to {element}, which is not a small type; export the model with UINT8 or INT8"
        )));
    }
    Ok(vec![Fact::new(element, site.shape(0)?.to_vec())])
}

/// A quotient as runtimes compute it. The result is rounded to an integer, so that the precision decides at a tie.
pub fn quotient(element: Element, a: f64, b: f64) -> f64 {
    if element == Element::DOUBLE { a / b } else { f64::from(a as f32 / b as f32) }
}

fn evaluate_quantize(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let element = infer_quantize(site)?.swap_remove(0).element;
    let (x, scales, zeros) = (given(inputs, 0)?, given(inputs, 1)?, optional(inputs, 2));
    let factors = Factors::of(site, &x.shape, &scales.shape)?;
    check_zero_points(&scales.shape, zeros.map(|zeros| zeros.shape.as_slice()))?;
    let saturate = site.int("saturate", 1) != 0;
    let (element_of_x, mut values) = (x.element, x.values.iter());
    let quantized = Tensor::from_fn(element, &x.shape, |at| {
        let (place, x) = (factors.place(at), values.next().copied().unwrap_or_default());
        let scaled = quotient(element_of_x, x, scales.values[place]);
        let zero = zeros.map_or(0.0, |zeros| zeros.values[place]);
        match element.is_integer() {
            true => element.saturated(scaled.round_ties_even() + zero),
            false => Element::FLOAT.converted(element, scaled + zero, saturate),
        }
    });
    Ok(vec![quantized?])
}

fn infer_dequantize(site: &Site<'_>) -> Result<Vec<Fact>> {
    check(site)?;
    let element = named_type(site)?.unwrap_or(site.fact(1)?.element);
    Ok(vec![Fact::new(element, site.shape(0)?.to_vec())])
}

fn evaluate_dequantize(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let element = infer_dequantize(site)?.swap_remove(0).element;
    let (x, scales, zeros) = (given(inputs, 0)?, given(inputs, 1)?, optional(inputs, 2));
    let factors = Factors::of(site, &x.shape, &scales.shape)?;
    check_zero_points(&scales.shape, zeros.map(|zeros| zeros.shape.as_slice()))?;
    let mut values = x.values.iter();
    let floats = Tensor::from_fn(element, &x.shape, |at| {
        let (place, x) = (factors.place(at), values.next().copied().unwrap_or_default());
        (x - zeros.map_or(0.0, |zeros| zeros.values[place])) * scales.values[place]
    });
    Ok(vec![floats?])
}

fn infer_dynamic(site: &Site<'_>) -> Result<Vec<Fact>> {
    let fact = site.fact(0)?;
    Ok(vec![
        Fact::new(Element::UINT8, fact.shape.clone()),
        Fact::new(fact.element, Vec::new()),
        Fact::new(Element::UINT8, Vec::new()),
    ])
}

fn evaluate_dynamic(_: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let x = given(inputs, 0)?;
    // The range always contains 0, which has to be exact.
    let least = x.values.iter().copied().fold(0.0, lesser);
    let greatest = x.values.iter().copied().fold(0.0, greater);
    let scale = quotient(x.element, greatest - least, 255.0);
    let zero = Element::UINT8.saturated(quotient(x.element, -least, scale).round_ties_even());
    let quantized = |&x_value: &f64| {
        Element::UINT8.saturated(quotient(x.element, x_value, scale).round_ties_even() + zero)
    };
    let number = |element, value| Tensor { element, shape: Vec::new(), values: vec![value] };
    let values = x.values.iter().map(quantized).collect();
    Ok(vec![
        Tensor { element: Element::UINT8, shape: x.shape.clone(), values },
        number(x.element, scale),
        number(Element::UINT8, zero),
    ])
}

#[cfg(test)]
mod tests {
    use crate::graph::Graph;
    use crate::tensor::{Element, Tensor};
    use crate::testing::Setting::Int;
    use crate::testing::{Setting, Sketch};

    fn graph(operator: &str, scale: &[usize], zero: &[usize], settings: &[(&str, Setting<'_>)]) -> Graph {
        let mut sketch = Sketch::new(21);
        sketch.input("x", &[2, 3]);
        let scale = sketch.weights("scale", Tensor::filled(Element::FLOAT, scale, 0.5).unwrap());
        let zero = sketch.weights("zero", Tensor::filled(Element::UINT8, zero, 128.0).unwrap());
        sketch.node(operator, &["x", &scale, &zero], "y", settings);
        Graph::new(sketch.model(&["y"])).unwrap()
    }

    #[test]
    fn values_are_rounded_to_even_and_saturate() {
        let x = Tensor::floats(&[2, 3], vec![0.25, 0.75, -1000.0, 1000.0, f64::NAN, f64::INFINITY]);
        let found = graph("QuantizeLinear", &[], &[1], &[]).evaluate(&[("x", &x)], &["y"]).unwrap();
        assert_eq!(found[0].element, Element::UINT8);
        assert_eq!(found[0].values, [128.0, 130.0, 0.0, 255.0, 0.0, 255.0]);
    }

    #[test]
    fn factors_belong_to_places_along_an_axis_or_to_blocks() {
        for (shape, settings) in [
            (&[3][..], &[][..]),
            (&[2], &[("axis", Int(0))]),
            (&[2], &[("axis", Int(-2))]),
            (&[2, 2], &[("block_size", Int(2))]),
            (&[1, 3], &[("axis", Int(0)), ("block_size", Int(5))]),
        ] {
            for operator in ["QuantizeLinear", "DequantizeLinear"] {
                let graph = graph(operator, shape, shape, settings);
                assert_eq!(graph.fact("y").unwrap().shape, [2, 3], "{operator} {shape:?}");
                let x = Tensor::floats(&[2, 3], vec![1.0; 6]);
                assert!(graph.evaluate(&[("x", &x)], &["y"]).is_ok(), "{operator} {shape:?}");
            }
        }
    }

    #[test]
    fn factors_that_do_not_fit_are_refused() {
        for (scale, zero, settings, expected) in [
            (&[4][..], &[4][..], &[][..], "its factors have the shape (4)"),
            (&[3], &[2], &[], "its zero points have the shape (2)"),
            (&[3], &[3], &[("axis", Int(2))], "its axis 2 is outside"),
            (&[2, 3], &[2, 3], &[], "needs one number or a list"),
            (&[2, 3], &[2, 3], &[("block_size", Int(2))], "needs one for each block"),
            (&[2, 3], &[2, 3], &[("block_size", Int(-1))], "its `block_size` is negative"),
        ] {
            let graph = graph("QuantizeLinear", scale, zero, settings);
            let error = graph.fact("y").unwrap_err().to_string();
            assert!(error.contains(expected), "{error}");
        }
        let mut sketch = Sketch::new(21);
        sketch.input("x", &[2, 3]);
        let scale = sketch.drawn(&[], 1.0, 2.0);
        sketch.node("QuantizeLinear", &["x", &scale], "y", &[("output_dtype", Int(11))]);
        sketch.node("QuantizeLinear", &["x"], "z", &[]);
        let graph = Graph::new(sketch.model(&["y", "z"])).unwrap();
        assert!(graph.fact("y").unwrap_err().to_string().contains("it quantizes to DOUBLE"));
        assert!(graph.fact("z").unwrap_err().to_string().contains("its input 2 is missing"));
    }
}
