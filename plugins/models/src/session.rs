//! A network that is ready to run, whoever runs it.

use pdk_sdk::error::Result;

/// A network that is ready to run. It uses one thread, so that its results do not depend on how many there are.
pub trait Session: Send {
    /// Runs the network on the values of one image, and on the speed in metres per second where it takes one, and puts the
    /// values of each output into its vector, in the order of the model's outputs.
    fn run(&mut self, image: &[f32], speed: f32, outputs: &mut [Vec<f32>]) -> Result<()>;

    /// Who runs it, with the version.
    fn backend(&self) -> String;
}
