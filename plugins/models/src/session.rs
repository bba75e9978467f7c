//! A network that is ready to run, on any engine.

use std::path::Path;

use pdk_sdk::error::Result;
use tract_onnx::pb::ModelProto;

/// A network as an engine takes it.
pub struct Network<'a> {
    /// The graph.
    pub graph: Graph<'a>,
    /// The shape of each input of 32-bit floats.
    pub inputs: Vec<Vec<usize>>,
}

/// Where a network's graph is.
pub enum Graph<'a> {
    /// In a file, which has been read.
    File {
        /// The file.
        path: &'a Path,
        /// Its content.
        proto: &'a ModelProto,
    },
    /// In memory, as the content of a file that stands for itself.
    Memory(&'a [u8]),
}

/// A network that is ready to run. It uses one thread, so that its results do not depend on how many there are.
pub trait Session: Send {
    /// Runs the network on the values of each of its inputs, and puts the values of each output into its vector, in the
    /// order of the graph's inputs and outputs.
    fn run(&mut self, inputs: &[Vec<f32>], outputs: &mut [Vec<f32>]) -> Result<()>;

    /// The full name of the engine that runs it.
    fn engine(&self) -> String;

    /// What the record keeps of the engine: its full name, and what its code is if that is not part of pdk.
    fn info(&self) -> Vec<(String, String)> {
        vec![("engine".to_owned(), self.engine())]
    }
}
