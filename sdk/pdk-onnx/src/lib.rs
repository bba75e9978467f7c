#![doc = include_str!("../README.md")]
//!
//! [`model`] reads files, [`graph`] knows the type and shape of each of its [`values`], [`gradient`] walks the graph backwards,
//! [`operators`] holds a file for each operator or family with its rules, and [`evaluate`] computes values plainly in 64-bit
//! floats, as the reference. [`inference`] runs graphs in 32-bit floats. [`field`] tells where on the image a cell of a layer looks.

mod attributes;
mod bodies;
mod builder;
mod bytes;
mod element;
mod evaluate;
pub mod field;
pub mod gradient;
pub mod graph;
pub mod inference;
pub mod layers;
pub mod model;
mod narrow;
pub mod objective;
mod operators;
mod order;
pub mod proto;
mod shapes;
mod site;
pub mod tensor;
pub mod testing;
pub mod values;
mod weights;
mod window;

/// How the names of ONNX files end.
pub const ENDING: &str = "onnx";

pub use gradient::{Gradients, Target, gradients, gradients_of_sum};
pub use graph::Graph;
pub use objective::Objective;
pub use tensor::{Element, Tensor};
pub use values::Fact;
