//! Components that run a neural network.
//!
//! A model is an ONNX file. [`model_file`] reads what the file declares and refuses what is no driving model, the same
//! way whichever backend runs it later. [`backend`] chooses who runs it: [`tract`], which is part of this plugin, or
//! [`onnxruntime`], a shared library that [`locate`] finds on the machine. [`pixels`] turns frames into the numbers that
//! the model expects, [`selection`] says which of its outputs steer, and [`driver`] puts it all together. [`trained`] holds the
//! networks that are part of the plugin.

mod backend;
mod driver;
mod locate;
mod model_file;
mod onnxruntime;
mod pixels;
mod selection;
mod session;
mod tract;
mod trained;

#[cfg(test)]
mod fixture;
#[cfg(test)]
mod gradient_tests;

pdk_sdk::export! { drivers: [driver::Onnx, trained::Dave2, trained::Dave2Augmented] }
