//! What is known about each operator: the shape of what it computes, its value, and its gradient.
//!
//! An operator or a family of them has a file, with its rules and their tests.

mod affine_grid;
mod arithmetic;
mod average_pool;
mod center_crop_pad;
mod choice;
mod col2im;
mod compress;
mod concat;
mod constants;
pub(crate) mod conv;
pub(crate) mod conv_transpose;
mod depth;
mod einsum;
mod functions;
mod gather;
mod gather_elements;
mod gelu;
mod gemm;
mod grid_sample;
pub(crate) mod layout;
mod matmul;
pub(crate) mod max_pool;
mod max_unpool;
mod normalization;
mod one_hot;
mod operator;
pub(crate) mod pad;
mod positions;
mod reduce;
pub(crate) mod resize;
mod roi_align;
mod scatter;
mod selection;
mod sequence;
pub(crate) mod slice;
mod softmax;
mod steps;
mod suppression;
mod tile;
mod triangle;

use pdk_sdk::error::Result;

use crate::graph::Graph;
use crate::proto::{ModelProto, NodeProto};
pub(crate) use operator::{Operator, Rule};

static FAMILIES: [&[Operator]; 38] = [
    affine_grid::OPERATORS,
    arithmetic::OPERATORS,
    average_pool::OPERATORS,
    center_crop_pad::OPERATORS,
    choice::OPERATORS,
    col2im::OPERATORS,
    compress::OPERATORS,
    concat::OPERATORS,
    constants::OPERATORS,
    conv::OPERATORS,
    conv_transpose::OPERATORS,
    depth::OPERATORS,
    einsum::OPERATORS,
    functions::OPERATORS,
    gather::OPERATORS,
    gather_elements::OPERATORS,
    gelu::OPERATORS,
    gemm::OPERATORS,
    grid_sample::OPERATORS,
    layout::OPERATORS,
    matmul::OPERATORS,
    max_pool::OPERATORS,
    max_unpool::OPERATORS,
    normalization::OPERATORS,
    one_hot::OPERATORS,
    pad::OPERATORS,
    reduce::OPERATORS,
    resize::OPERATORS,
    roi_align::OPERATORS,
    scatter::OPERATORS,
    selection::OPERATORS,
    sequence::OPERATORS,
    slice::OPERATORS,
    softmax::OPERATORS,
    steps::OPERATORS,
    suppression::OPERATORS,
    tile::OPERATORS,
    triangle::OPERATORS,
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
