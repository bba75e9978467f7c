//! A network that is ready to run, on any engine.

use std::path::Path;

use pdk_network::Element;
use pdk_network::plan::Input;
use pdk_sdk::error::Result;

/// A network as an engine takes it.
pub struct Network<'a> {
    /// The graph.
    pub graph: Graph<'a>,
    /// Shape and type of each input.
    pub inputs: Vec<Taken>,
}

/// What an engine takes as an input. Numbers are 32-bit floats on this side, and become these there.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Taken {
    /// The shape.
    pub shape: Vec<usize>,
    /// The type of the numbers.
    pub element: Element,
}

impl From<&Input> for Taken {
    fn from(input: &Input) -> Self {
        Self { shape: input.shape.clone(), element: input.element }
    }
}

impl Taken {
    /// Whether the numbers are bytes.
    pub fn is_whole(&self) -> bool {
        matches!(self.element, Element::Uint8 | Element::Int8)
    }

    /// A number as a byte holds it: rounded to the nearest, halves to even, within the range of the type.
    pub fn whole(&self, value: f32) -> f32 {
        let (least, greatest) = if self.element == Element::Int8 { (-128.0, 127.0) } else { (0.0, 255.0) };
        value.round_ties_even().clamp(least, greatest)
    }
}

/// Where a network's graph is.
pub enum Graph<'a> {
    /// In a file.
    File(&'a Path),
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
