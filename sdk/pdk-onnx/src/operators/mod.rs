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
mod integer_products;
pub(crate) mod layout;
mod matmul;
pub(crate) mod max_pool;
mod normalization;
mod operator;
pub(crate) mod pad;
mod quantize;
mod recurrent;
mod recurrent_cells;
mod reduce;
pub(crate) mod resize;
pub(crate) mod slice;
mod softmax;
mod steps;

use pdk_sdk::error::Result;

use crate::graph::Graph;
use crate::proto::{ModelProto, NodeProto};
pub(crate) use operator::{Operator, Rule};

static FAMILIES: [&[Operator]; 24] = [
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
    integer_products::OPERATORS,
    layout::OPERATORS,
    matmul::OPERATORS,
    max_pool::OPERATORS,
    normalization::OPERATORS,
    pad::OPERATORS,
    quantize::OPERATORS,
    recurrent::OPERATORS,
    reduce::OPERATORS,
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
