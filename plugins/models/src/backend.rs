//! Who runs a network.

use pdk_sdk::prelude::*;

use crate::locate::{self, Search};
use crate::model_file::ModelFile;
use crate::onnxruntime::{self, OnnxRuntime};
use crate::tract::Tract;

/// A network that is ready to run. It uses one thread, so that its results do not depend on how many there are.
pub trait Session: Send {
    /// Runs the network on the values of one image, and on the speed in metres per second where it takes one, and puts the
    /// values of each output into its vector, in the order of the model's outputs.
    fn run(&mut self, image: &[f32], speed: f32, outputs: &mut [Vec<f32>]) -> Result<()>;

    /// Who runs it, with the version.
    fn backend(&self) -> String;
}

/// The names that the parameter `backend` takes.
pub const NAMES: [&str; 3] = ["auto", "tract", "onnxruntime"];

/// Makes a session with the backend of this name.
///
/// # Errors
/// Where the backend is not there or cannot run the model.
pub fn open(model: &ModelFile, name: &str) -> Result<Box<dyn Session>> {
    let library = match name {
        "tract" => None,
        "onnxruntime" => Some(Search::from_environment().require()?),
        _ => Search::from_environment().find()?.map(|found| found.path),
    };
    match library {
        None => Ok(Box::new(Tract::new(model).map_err(|e| e.at(crate::tract::name()))?)),
        Some(path) => {
            let runtime = onnxruntime::load(&path)?;
            let session = OnnxRuntime::new(model, runtime.clone());
            Ok(Box::new(session.map_err(|e| e.at(runtime.name()))?))
        }
    }
}

/// What to do where tract cannot run a model.
pub fn remedy() -> String {
    format!("ONNX Runtime may be able to: {}", locate::REMEDY)
}
