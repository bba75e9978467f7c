#![doc = include_str!("../README.md")]
//!
//! [`field`] lists the fields of a description, from which its reading, the parameters of components and the reference follow.
//! [`given`] collects their values with the place that each comes from, [`preset`] has the descriptions that have a name, and
//! [`described`] is their meaning, with [`gets`] for further inputs and [`rule`] for outputs. [`declared`] is what an ONNX file says about its inputs and outputs. A [`plan`] joins the two:
//! what each input gets, the [`image`] first, and the [`reason`]; [`outputs`] does the same for what comes out, and [`waypoints`] lets a network that plans steer. [`eye`] makes the image's tensor of frames, by way
//! of [`region`], [`resize`], [`color`] and [`numbers`], and [`inputs`] holds the values of all inputs from frame to frame.
//! `back` takes a gradient back from the tensor to the frame. [`template`] writes a description to complete, and [`seen`] turns a tensor back into a picture.

mod back;
pub mod color;
pub mod declared;
pub mod described;
pub mod eye;
pub mod field;
pub mod gets;
pub mod given;
pub mod image;
pub mod inputs;
pub mod numbers;
pub mod outputs;
pub mod plan;
pub mod preset;
mod reading;
pub mod reason;
pub mod region;
pub mod resize;
pub mod rule;
pub mod seen;
pub mod suggest;
pub mod template;
pub mod waypoints;

pub use declared::{Declared, Element, Port};
pub use described::Described;
pub use eye::Eye;
pub use given::Given;
pub use inputs::Inputs;
pub use outputs::Outputs;
pub use plan::Plan;
