//! Positions in tensors, and integers of a limited width: what operators that move single elements have in common.

use std::sync::Arc;

use pdk_sdk::error::{Error, Result};

use super::operator::given;
use crate::site::Site;
use crate::tensor::{Element, Tensor, elements, shape_text};

/// The tensor at a place, which has to have the shape that the graph knows.
pub fn taken<'a>(site: &Site<'_>, inputs: &[Option<&'a Tensor>], place: usize) -> Result<&'a Tensor> {
    let (tensor, shape) = (given(inputs, place)?, site.shape(place)?);
    // A tensor without elements may have huge lengths beside the zero, and their products would overflow.
    elements(&shape.iter().copied().filter(|&length| length > 0).collect::<Vec<_>>())?;
    if tensor.shape == shape && tensor.values.len() == shape.iter().product::<usize>() {
        return Ok(tensor);
    }
    Err(Error::new(format!(
        "its input {} has the shape {}, but {} is declared",
        place + 1,
        shape_text(&tensor.shape),
        shape_text(shape)
    )))
}

/// The elements of an input that decide the size of what comes out; nothing if it is left out.
pub fn deciding(site: &Site<'_>, place: usize) -> Result<Option<Arc<Tensor>>> {
    let Some(name) = site.optional(place) else { return Ok(None) };
    match site.values.constant(name)? {
        Some(tensor) => Ok(Some(tensor)),
        None => Err(Error::new(format!(
            "the size of what it computes depends on values: its input `{name}` has to be a constant, but is computed; run \
             this network with the engine onnxruntime"
        ))),
    }
}

/// The one number that an input holds.
pub fn single(tensor: &Tensor, place: usize) -> Result<f64> {
    match tensor.values.as_slice() {
        [value] => Ok(*value),
        _ => Err(Error::new(format!("its input {} has to be one number", place + 1))),
    }
}

/// The distance between neighbours along each axis. It has no meaning if there are no elements.
pub fn strides(shape: &[usize]) -> Vec<usize> {
    let mut strides = vec![1usize; shape.len()];
    for axis in (1..shape.len()).rev() {
        strides[axis - 1] = strides[axis].wrapping_mul(shape[axis]);
    }
    strides
}

/// The place of an element among all.
pub fn index(strides: &[usize], at: &[usize]) -> usize {
    strides.iter().zip(at).map(|(stride, at)| stride * at).sum()
}

/// An index as counted from the start.
pub fn counted(index: f64, length: usize) -> Result<usize> {
    let number = index as i64;
    let counted = if number < 0 { number.saturating_add(length as i64) } else { number };
    usize::try_from(counted)
        .ok()
        .filter(|&place| place < length)
        .ok_or_else(|| Error::new(format!("its index {index} is outside the {length} elements")))
}

/// Lengths that are not negative.
pub fn lengths(list: &[i64], what: &str) -> Result<Vec<usize>> {
    let lengths = list.iter().map(|&length| usize::try_from(length)).collect::<Result<Vec<_>, _>>();
    lengths.map_err(|_| Error::new(format!("its {what} {list:?} cannot be negative")))
}

/// The sum of two elements of a type. Integers wrap.
pub fn sum(element: Element, a: f64, b: f64) -> f64 {
    if element.is_float() { a + b } else { wrapped(element, (a as i128).wrapping_add(b as i128)) }
}

/// The product of two elements of a type. Integers wrap.
pub fn product(element: Element, a: f64, b: f64) -> f64 {
    if element.is_float() { a * b } else { wrapped(element, (a as i128).wrapping_mul(b as i128)) }
}

/// The greater of two elements if `sign` is 1, the lesser one if it is -1. What is not a number stays so.
pub fn extreme(a: f64, b: f64, sign: f64) -> f64 {
    if a.is_nan() || (b - a) * sign <= 0.0 || a == b { a } else { b }
}

/// What an integer type keeps of a whole number.
fn wrapped(element: Element, value: i128) -> f64 {
    match element.0 {
        2 => f64::from(value as u8),
        3 => f64::from(value as i8),
        4 => f64::from(value as u16),
        5 => f64::from(value as i16),
        6 => f64::from(value as i32),
        9 => f64::from(u8::from(value != 0)),
        12 => f64::from(value as u32),
        13 => value as u64 as f64,
        _ => value as i64 as f64,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn integers_wrap_and_floats_do_not() {
        assert_eq!(sum(Element(2), 250.0, 10.0), 4.0);
        assert_eq!(sum(Element(3), 100.0, 100.0), -56.0);
        assert_eq!(product(Element::INT32, 65536.0, 65537.0), 65536.0);
        assert_eq!(sum(Element::BOOL, 1.0, 1.0), 1.0);
        assert_eq!(sum(Element::FLOAT, 250.0, 10.5), 260.5);
        assert!(extreme(f64::NAN, 1.0, 1.0).is_nan() && extreme(1.0, f64::NAN, 1.0).is_nan());
    }

    #[test]
    fn an_index_outside_is_an_error() {
        assert_eq!(counted(-1.0, 3).unwrap(), 2);
        for index in [3.0, -4.0, f64::MAX, f64::MIN] {
            assert!(counted(index, 3).is_err());
        }
        assert!(counted(0.0, 0).is_err());
    }
}
