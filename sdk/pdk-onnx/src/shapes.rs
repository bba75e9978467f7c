//! What a graph has to know of an operator: the type and shape of what it computes, and its value.

use pdk_sdk::error::Result;

use crate::site::Site;
use crate::tensor::Tensor;
use crate::values::Fact;

/// From a node to type and shape of each of its outputs.
pub(crate) type Infer = fn(&Site<'_>) -> Result<Vec<Fact>>;

/// From a node and what goes in to what comes out.
pub(crate) type Evaluate = fn(&Site<'_>, &[Option<&Tensor>]) -> Result<Vec<Tensor>>;

/// What a graph has to know of an operator.
pub(crate) struct Shapes {
    /// Type and shape of what it computes.
    pub infer: Infer,
    /// What it computes from these inputs.
    pub evaluate: Evaluate,
    /// Whether it computes from the shape of its input alone.
    pub needs_only_shapes: bool,
}
