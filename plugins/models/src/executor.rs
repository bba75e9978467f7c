//! Runs networks with the executor of `pdk-onnx`, which is part of this plugin.

use std::collections::HashSet;

use pdk_onnx::inference::Program;
use pdk_onnx::proto::{DimensionProto, ModelProto};
use pdk_onnx::{Graph, model};
use pdk_sdk::prelude::*;

use crate::locate;
use crate::session::{self, Network, Session, Taken};

/// The full name: it changes when a result does, and is the same on every processor.
pub const ENGINE: &str = "pdk 1";

/// A network that the executor runs.
pub struct Executor {
    program: Program,
    inputs: Vec<Taken>,
    /// The values of each input as its type holds them.
    values: Vec<Vec<f32>>,
}

impl Executor {
    /// Prepares a network.
    ///
    /// # Errors
    /// If the network has operators that are not known, or contradicts itself.
    pub fn new(network: &Network<'_>) -> Result<Self> {
        let mut proto = match &network.graph {
            session::Graph::File(path) => model::read(path)?,
            session::Graph::Memory(bytes) => model::decode(bytes)?,
        };
        set_shapes(&mut proto, &network.inputs);
        let program = Graph::new(proto).and_then(Program::new).map_err(|error| {
            Error::new(format!("it cannot prepare the model ({error}); {}", locate::alternative()))
        })?;
        let values = network.inputs.iter().map(|taken| Vec::with_capacity(taken.shape.iter().product()));
        Ok(Self { program, values: values.collect(), inputs: network.inputs.clone() })
    }
}

/// Gives each input the shape that it is taken with, which the file may leave open.
fn set_shapes(proto: &mut ModelProto, inputs: &[Taken]) {
    let Some(graph) = &mut proto.graph else { return };
    // Old files list their weights among the inputs.
    let weights: HashSet<&str> = graph.initializer.iter().map(|tensor| tensor.name.as_str()).collect();
    let given = graph.input.iter_mut().filter(|input| !weights.contains(input.name.as_str()));
    for (input, taken) in given.zip(inputs) {
        if let Some(tensor) = input.r#type.as_mut().and_then(|value| value.tensor_type.as_mut()) {
            let dim = |&length: &usize| DimensionProto { dim_value: Some(length as i64), dim_param: None };
            tensor.shape.get_or_insert_default().dim = taken.shape.iter().map(dim).collect();
        }
    }
}

impl Session for Executor {
    fn run(&mut self, inputs: &[Vec<f32>], outputs: &mut [Vec<f32>]) -> Result<()> {
        let computed = match self.inputs.iter().any(|taken| taken.is_whole()) {
            false => self.program.run(inputs, outputs),
            true => {
                for ((into, taken), values) in self.values.iter_mut().zip(&self.inputs).zip(inputs) {
                    into.clear();
                    into.extend(
                        values
                            .iter()
                            .map(|value| if taken.is_whole() { taken.whole(*value) } else { *value }),
                    );
                }
                self.program.run(&self.values, outputs)
            }
        };
        computed.map_err(|error| {
            Error::new(format!("it cannot compute the model ({error}); {}", locate::alternative())).at(ENGINE)
        })
    }

    fn engine(&self) -> String {
        ENGINE.to_owned()
    }
}

#[cfg(test)]
mod tests {
    use std::path::Path;

    /// What reading, preparing and running a file of the fuzzing corpus says.
    fn tried(name: &str) -> Result<(), String> {
        let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/fuzz/corpus/onnx"));
        crate::try_model(&folder.join(name).with_extension("onnx")).map_err(|error| error.to_string())
    }

    #[test]
    fn models_that_contradict_themselves_or_ask_for_much_are_errors() {
        for (name, part) in [
            ("strides_beyond_memory", "is too large"),
            ("large_pads", "one may have 64 million elements"),
            ("large_window", "its window of 4000000 elements at"),
            ("resize_of_nothing", "it resizes an axis of 0 to 8"),
            ("long_resize", "it resizes an axis of 32768 to 32767, which is too much here"),
            ("output_too_many", "its output `z` is not as the file declares it"),
            ("long_weights", "do not go together"),
            ("vector_in_gemm", "do not go together"),
        ] {
            let said = tried(name).unwrap_err();
            assert!(said.contains(part), "{name}: {said}");
        }
        // A transposed convolution whose strides have far more phases than it has outputs, and a pool that says where its greatest are.
        for name in ["many_phases", "pool_with_places"] {
            assert_eq!(tried(name), Ok(()), "{name}");
        }
    }

    #[test]
    fn a_network_that_cannot_be_computed_is_an_error_with_a_remedy() {
        // It gathers behind the end.
        let error = tried("gather_out_of_range").unwrap_err();
        assert!(error.contains("outside the") && error.contains("PDK_ONNXRUNTIME"), "{error}");
    }
}
