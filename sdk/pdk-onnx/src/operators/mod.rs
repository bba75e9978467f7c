//! What is known about each operator: the shape of what it computes, its value, and its gradient.
//!
//! An operator or a family of them has a file, with its rules and their tests.

mod activations;
mod arithmetic;
pub(crate) mod average_pool;
mod cast;
mod choice;
mod concat;
mod constants;
pub(crate) mod conv;
pub(crate) mod conv_transpose;
mod extremes;
pub(crate) mod functions;
mod gather;
mod gelu;
mod gemm;
mod group_normalization;
mod hyperbolic;
mod integers;
pub(crate) mod layout;
mod lp;
mod lrn;
pub(crate) mod matmul;
pub(crate) mod max_pool;
pub(crate) mod normalization;
mod operator;
pub(crate) mod pad;
mod rectifiers;
mod reduce;
mod reduce_norms;
pub(crate) mod resize;
pub(crate) mod slice;
mod softmax;
mod steps;

use pdk_sdk::error::{Error, Result};

use crate::graph::{Graph, describe};
use crate::proto::{ModelProto, NodeProto};
pub(crate) use operator::{Operator, Rule};

static FAMILIES: &[&[Operator]] = &[
    activations::OPERATORS,
    arithmetic::OPERATORS,
    average_pool::OPERATORS,
    cast::OPERATORS,
    choice::OPERATORS,
    concat::OPERATORS,
    constants::OPERATORS,
    conv::OPERATORS,
    conv_transpose::OPERATORS,
    extremes::OPERATORS,
    functions::OPERATORS,
    gather::OPERATORS,
    gelu::OPERATORS,
    gemm::OPERATORS,
    group_normalization::OPERATORS,
    hyperbolic::OPERATORS,
    integers::OPERATORS,
    layout::OPERATORS,
    lp::OPERATORS,
    lrn::OPERATORS,
    matmul::OPERATORS,
    max_pool::OPERATORS,
    normalization::OPERATORS,
    pad::OPERATORS,
    rectifiers::OPERATORS,
    reduce::OPERATORS,
    reduce_norms::OPERATORS,
    resize::OPERATORS,
    slice::OPERATORS,
    softmax::OPERATORS,
    steps::OPERATORS,
];

/// What is known about a node's operator; nothing if that is not one of these.
pub(crate) fn find(node: &NodeProto) -> Option<&'static Operator> {
    let own = node.domain.is_empty() || node.domain == "ai.onnx";
    FAMILIES.iter().copied().flatten().find(|operator| own && operator.name == node.op_type)
}

/// The same, for a node that has to be computed.
///
/// # Errors
/// If its operator is not known here.
pub(crate) fn known(node: &NodeProto) -> Result<&'static Operator> {
    find(node).ok_or_else(|| Error::new(format!("{} cannot be computed here", describe(node))))
}

// Here and not in `graph`, which does not know the operators: their gradients add nodes to graphs.
impl Graph {
    /// Reads the graph of a model. A batch that is left open is one.
    ///
    /// # Errors
    /// If the graph contradicts itself, or an input leaves more than its batch open.
    pub fn new(model: ModelProto) -> Result<Self> {
        Self::with(model, |node| find(node).map(|operator| &operator.shapes))
    }
}
