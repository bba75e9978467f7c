//! ONNX graphs: what they hold, the shapes of their values, and exact gradients.
//!
//! A driving model usually comes as an ONNX file, without the framework that trained it. This crate takes such a file and
//! builds the gradient of one of its outputs with respect to any of its values, as nodes of a plain ONNX graph, which runs
//! wherever the model runs:
//!
//! ```no_run
//! use pdk_onnx::{Graph, Target, gradients, model};
//!
//! # fn main() -> pdk_sdk::error::Result<()> {
//! let graph = Graph::new(model::read("pilot.onnx".as_ref())?)?;
//! let steering = Target { value: "steering", index: 0 };
//! let gradients = gradients(&graph, steering, &["conv2d_5"], &["conv2d_5"])?;
//! # Ok(())
//! # }
//! ```
//!
//! [`model`] reads files, [`graph`] knows the type and shape of each value, [`gradient`] walks the graph backwards,
//! [`operators`] holds a file for each operator or family with its rules, and [`evaluate`] computes values plainly in 64-bit
//! floats, as the reference. [`field`] tells where on the image a cell of a layer looks.
//!
//! Nothing here runs a network fast; that is left to whoever takes the graph.

mod builder;

mod evaluate;
pub mod field;
pub mod gradient;
pub mod graph;
pub mod layers;
pub mod model;
mod operators;
pub mod proto;
mod site;
pub mod tensor;
#[cfg(any(test, feature = "testing"))]
pub mod testing;
mod window;

pub use gradient::{Gradients, Target, gradients, gradients_of_sum};
pub use graph::{Fact, Graph};
pub use tensor::{Element, Tensor};
