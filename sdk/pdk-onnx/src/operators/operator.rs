//! What is known about an operator, and what several of them share.

use pdk_sdk::error::{Error, Result};

use crate::builder::Builder;
use crate::shapes::{Evaluate, Infer, Shapes};
use crate::site::Site;
use crate::tensor::{Tensor, broadcast, shape_text};
use crate::values::Fact;

/// Gradients by the place of the input that they belong to.
pub(crate) type Parts = Vec<(usize, String)>;

/// What is known about an operator.
pub(crate) struct Operator {
    pub name: &'static str,
    pub shapes: Shapes,
    pub gradient: Rule,
}

/// How gradients pass an operator: from those of what it computes to those of what goes in.
#[derive(Clone, Copy)]
pub(crate) enum Rule {
    /// It has none here: what depends on it is computed, but not derived.
    Unknown,
    /// What it computes is constant, or constant in steps.
    Zero,
    /// From the gradient of its first output; it has none with respect to the others.
    First(fn(&Site<'_>, &mut Builder, &str) -> Result<Parts>),
    /// From the gradient of each output.
    Each(fn(&Site<'_>, &mut Builder, &[Option<String>]) -> Result<Parts>),
}

impl Operator {
    pub const fn new(name: &'static str, infer: Infer, evaluate: Evaluate, gradient: Rule) -> Self {
        Self { name, shapes: Shapes { infer, evaluate, needs_only_shapes: false }, gradient }
    }

    /// The same, for an operator that computes from the shape of its input alone.
    pub const fn needing_shapes_alone(mut self) -> Self {
        self.shapes.needs_only_shapes = true;
        self
    }
}

/// The tensor at a place.
pub(super) fn given<'a>(inputs: &[Option<&'a Tensor>], place: usize) -> Result<&'a Tensor> {
    inputs
        .get(place)
        .copied()
        .flatten()
        .ok_or_else(|| Error::new(format!("its input {} is missing", place + 1)))
}

/// Checks that an input is broadcast to the shape of the first.
pub(super) fn check_broadcast(site: &Site<'_>, place: usize) -> Result<()> {
    let (shape, other) = (site.shape(0)?, site.shape(place)?);
    match broadcast(&[shape, other])? == shape {
        true => Ok(()),
        false => Err(Error::new(format!(
            "its input {} of the shape {} does not go together with its input of the shape {}",
            place + 1,
            shape_text(other),
            shape_text(shape)
        ))),
    }
}

/// The facts of an operator that leaves type and shape as they are.
pub(super) fn same(site: &Site<'_>) -> Result<Vec<Fact>> {
    Ok(vec![site.fact(0)?.clone()])
}

/// The input in the shape that comes out.
pub(super) fn reshaped(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let input = given(inputs, 0)?;
    Ok(vec![Tensor { shape: site.output_shape()?.to_vec(), ..input.clone() }])
}

/// The gradient of an operator that changes the shape alone.
pub(super) fn reshape_back(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    Ok(vec![(0, b.reshape(g, site.shape(0)?)?)])
}
