//! Who runs a network.

use pdk_sdk::prelude::*;

use crate::locate::Search;
use crate::onnxruntime::{self, OnnxRuntime};
use crate::session::{Network, Session};
use crate::tract::Tract;

/// The names that the parameter `backend` takes.
pub const NAMES: [&str; 3] = ["auto", "tract", "onnxruntime"];

/// Makes a session with the backend of this name.
///
/// # Errors
/// Where the backend is not there or cannot run the model.
pub fn open(network: &Network<'_>, name: &str) -> Result<Box<dyn Session>> {
    let library = match name {
        "tract" => None,
        "onnxruntime" => Some(Search::from_environment().require()?),
        _ => Search::from_environment().find()?.map(|found| found.path),
    };
    match library {
        None => Ok(Box::new(Tract::new(network).map_err(|e| e.at(crate::tract::name()))?)),
        Some(path) => {
            let runtime = onnxruntime::load(&path)?;
            let session = OnnxRuntime::new(network, runtime.clone());
            Ok(Box::new(session.map_err(|e| e.at(runtime.name()))?))
        }
    }
}
