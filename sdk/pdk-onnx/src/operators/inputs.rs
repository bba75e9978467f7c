//! What goes into an operator: tensors that have to have their shape, be constant, or hold one number.

use std::fmt::Display;
use std::sync::Arc;

use pdk_sdk::error::{Error, Result};

use super::operator::given;
use crate::site::Site;
use crate::tensor::{Tensor, elements, shape_text};

/// The tensor at a place; nothing if it is left out.
pub fn optional<'a>(inputs: &[Option<&'a Tensor>], place: usize) -> Option<&'a Tensor> {
    inputs.get(place).copied().flatten()
}

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
            "the size of what it computes depends on values: its input `{name}` has to be a constant, \
             but is computed"
        ))),
    }
}

/// The one number that a tensor holds.
pub fn single(tensor: &Tensor, what: impl Display) -> Result<f64> {
    match tensor.values.as_slice() {
        &[value] => Ok(value),
        values => Err(Error::new(format!("its {what} has to be one number, but holds {}", values.len()))),
    }
}
