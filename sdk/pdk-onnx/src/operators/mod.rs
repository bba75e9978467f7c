//! What is known about each operator: the shape of what it computes, its value, and its gradient.
//!
//! An operator or a family of them has a file, with its rules and their tests.

mod activations;
mod affine_grid;
mod arithmetic;
pub(crate) mod average_pool;
mod cast;
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
mod extremes;
pub(crate) mod functions;
mod gather;
mod gather_elements;
pub(crate) mod gelu;
mod gemm;
mod grid_sample;
pub(crate) mod group_normalization;
mod hyperbolic;
mod inputs;
mod integer_products;
mod integers;
pub(crate) mod layout;
mod lp;
pub(crate) mod lrn;
pub(crate) mod matmul;
pub(crate) mod max_pool;
mod max_unpool;
pub(crate) mod normalization;
mod one_hot;
mod operator;
pub(crate) mod pad;
mod positions;
pub(crate) mod quantize;
pub(crate) mod rectifiers;
mod recurrent;
mod recurrent_cells;
pub(crate) mod reduce;
mod reduce_norms;
pub(crate) mod resize;
mod roi_align;
mod scatter;
mod selection;
mod sequence;
pub(crate) mod slice;
pub(crate) mod softmax;
mod steps;
mod suppression;
mod tile;
mod triangle;

use pdk_sdk::error::{Error, Result};

use crate::graph::{Graph, describe};
use crate::proto::{ModelProto, NodeProto};
pub(crate) use operator::{Operator, Rule};

static FAMILIES: &[&[Operator]] = &[
    activations::OPERATORS,
    affine_grid::OPERATORS,
    arithmetic::OPERATORS,
    average_pool::OPERATORS,
    cast::OPERATORS,
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
    extremes::OPERATORS,
    functions::OPERATORS,
    gather::OPERATORS,
    gather_elements::OPERATORS,
    gelu::OPERATORS,
    gemm::OPERATORS,
    grid_sample::OPERATORS,
    group_normalization::OPERATORS,
    hyperbolic::OPERATORS,
    integer_products::OPERATORS,
    integers::OPERATORS,
    layout::OPERATORS,
    lp::OPERATORS,
    lrn::OPERATORS,
    matmul::OPERATORS,
    max_pool::OPERATORS,
    max_unpool::OPERATORS,
    normalization::OPERATORS,
    one_hot::OPERATORS,
    pad::OPERATORS,
    quantize::OPERATORS,
    rectifiers::OPERATORS,
    recurrent::OPERATORS,
    reduce::OPERATORS,
    reduce_norms::OPERATORS,
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
