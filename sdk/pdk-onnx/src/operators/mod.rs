//! What is known about each operator: the shape of what it computes, its value, and its gradient.
//!
//! An operator or a family of them has a file, with its rules and their tests.

mod arithmetic;
mod average_pool;
mod choice;
mod concat;
mod constants;
pub(crate) mod conv;
pub(crate) mod conv_transpose;
mod functions;
mod gather;
mod gelu;
mod gemm;
pub(crate) mod layout;
mod matmul;
pub(crate) mod max_pool;
mod normalization;
pub(crate) mod pad;
mod reduce;
pub(crate) mod resize;
pub(crate) mod slice;
mod softmax;
mod steps;

use pdk_sdk::error::{Error, Result};

use crate::builder::Builder;
use crate::graph::Fact;
use crate::proto::NodeProto;
use crate::site::Site;
use crate::tensor::Tensor;

/// Gradients by the place of the input that they belong to.
pub(crate) type Parts = Vec<(usize, String)>;

/// From a node to type and shape of each of its outputs.
pub(crate) type Infer = fn(&Site<'_>) -> Result<Vec<Fact>>;

/// From a node and what goes in to what comes out.
pub(crate) type Evaluate = fn(&Site<'_>, &[Option<&Tensor>]) -> Result<Vec<Tensor>>;

/// What is known about an operator.
pub(crate) struct Operator {
    pub name: &'static str,
    /// Type and shape of what it computes.
    pub infer: Infer,
    /// What it computes from these inputs.
    pub evaluate: Evaluate,
    pub gradient: Rule,
    /// Whether it computes from the shape of its input alone.
    pub needs_only_shapes: bool,
}

/// How gradients pass an operator: from those of what it computes to those of what goes in.
#[derive(Clone, Copy)]
pub(crate) enum Rule {
    /// What it computes is constant, or constant in steps.
    Zero,
    /// From the gradient of its first output; it has none with respect to the others.
    First(fn(&Site<'_>, &mut Builder, &str) -> Result<Parts>),
    /// From the gradient of each output.
    Each(fn(&Site<'_>, &mut Builder, &[Option<String>]) -> Result<Parts>),
}

impl Operator {
    const fn new(name: &'static str, infer: Infer, evaluate: Evaluate, gradient: Rule) -> Self {
        Self { name, infer, evaluate, gradient, needs_only_shapes: false }
    }
}

static FAMILIES: [&[Operator]; 21] = [
    arithmetic::OPERATORS,
    average_pool::OPERATORS,
    choice::OPERATORS,
    concat::OPERATORS,
    constants::OPERATORS,
    conv::OPERATORS,
    conv_transpose::OPERATORS,
    functions::OPERATORS,
    gather::OPERATORS,
    gelu::OPERATORS,
    gemm::OPERATORS,
    layout::OPERATORS,
    matmul::OPERATORS,
    max_pool::OPERATORS,
    normalization::OPERATORS,
    pad::OPERATORS,
    reduce::OPERATORS,
    resize::OPERATORS,
    slice::OPERATORS,
    softmax::OPERATORS,
    steps::OPERATORS,
];

/// What is known about a node's operator; nothing where that is not one of these.
pub(crate) fn find(node: &NodeProto) -> Option<&'static Operator> {
    let own = node.domain.is_empty() || node.domain == "ai.onnx";
    FAMILIES.iter().copied().flatten().find(|operator| own && operator.name == node.op_type)
}

/// The tensor at a place.
fn given<'a>(inputs: &[Option<&'a Tensor>], place: usize) -> Result<&'a Tensor> {
    inputs
        .get(place)
        .copied()
        .flatten()
        .ok_or_else(|| Error::new(format!("its input {} is missing", place + 1)))
}

/// The facts of an operator that leaves type and shape as they are.
fn same(site: &Site<'_>) -> Result<Vec<Fact>> {
    Ok(vec![site.fact(0)?.clone()])
}

/// The input in the shape that comes out.
fn reshaped(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    let input = given(inputs, 0)?;
    Ok(vec![Tensor { shape: site.output_shape()?.to_vec(), ..input.clone() }])
}

/// The gradient of an operator that changes the shape alone.
fn reshape_back(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    Ok(vec![(0, b.reshape(g, site.shape(0)?)?)])
}
