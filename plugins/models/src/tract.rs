//! Runs networks with tract, which is part of this plugin.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;

use pdk_sdk::error::Place;
use pdk_sdk::prelude::*;
use tract_onnx::prelude::*;
use tract_onnx::tract_core::model::TypedSimpleState;
use tract_onnx::tract_hir::infer::InferenceFact;

use crate::locate;
use crate::model_file::{ModelFile, Source};
use crate::session::Session;

/// A network that tract runs.
pub struct Tract {
    state: TypedSimpleState,
    image: Arc<Tensor>,
    /// The tensor for the speed, and whether it comes before the image; where the model takes one.
    speed: Option<(Arc<Tensor>, bool)>,
}

/// Bytes of a tensor between the operators of a model: far above those of any driver.
const LARGEST_TENSOR: usize = 1 << 30;

/// The name with the version, which is pinned in the workspace.
pub fn name() -> &'static str {
    "tract 0.23.9"
}

impl Tract {
    /// Prepares a model for frames one at a time.
    ///
    /// # Errors
    /// Where the model has operators that tract does not know or contradicts itself.
    pub fn new(model: &ModelFile) -> Result<Self> {
        let onnx = tract_onnx::onnx();
        let nodes = model.proto.graph.iter().flat_map(|graph| &graph.node);
        let mut unknown: Vec<_> = nodes
            .map(|node| node.op_type.as_str())
            .filter(|op| !onnx.op_register.0.contains_key(*op))
            .collect();
        unknown.sort_unstable();
        unknown.dedup();
        if !unknown.is_empty() {
            let unknown = unknown.join(", ");
            return Err(Error::new(format!(
                "it cannot run the model's operators {unknown}; {}",
                locate::instead_of_tract()
            )));
        }
        // tract panics on some models that contradict themselves.
        let state = catch_unwind(AssertUnwindSafe(|| prepare(model)))
            .map_err(|_| {
                Error::new(format!("it cannot make sense of the model; {}", locate::instead_of_tract()))
            })?
            .map_err(|error| {
                Error::new(format!("it cannot prepare the model ({error:#}); {}", locate::instead_of_tract()))
            })?;
        let zero =
            |shape: &[usize]| Tensor::zero::<f32>(shape).map(Arc::new).map_err(|e| Error::new(e.to_string()));
        let speed = match &model.speed {
            Some(speed) => Some((zero(&speed.shape)?, speed.first)),
            None => None,
        };
        Ok(Self { state, image: zero(&model.input.shape())?, speed })
    }
}

fn prepare(model: &ModelFile) -> TractResult<TypedSimpleState> {
    // What the file says about intermediate shapes names the batch, which is 1 here.
    let onnx = tract_onnx::onnx().with_ignore_value_info(true);
    // Weights may lie in files beside the model's.
    let folder = match &model.source {
        Source::File(path) => path.parent().and_then(|folder| folder.to_str()),
        Source::BuiltIn(_) => None,
    };
    let parsed = onnx.parse(&model.proto, folder)?;
    if !parsed.unresolved_inputs.is_empty() {
        return Err(TractError::msg(format!("nothing computes {}", parsed.unresolved_inputs.join(", "))));
    }
    let mut graph = parsed.model;
    let fact = |shape: &[usize]| InferenceFact::dt_shape(f32::datum_type(), shape);
    let image = usize::from(model.speed.as_ref().is_some_and(|speed| speed.first));
    graph.set_input_fact(image, fact(&model.input.shape()))?;
    if let Some(speed) = &model.speed {
        graph.set_input_fact(1 - image, fact(&speed.shape))?;
    }
    let graph = graph.into_optimized()?;
    check_tensors(&graph)?;
    graph.into_runnable()?.spawn()
}

/// A small file can describe tensors of any size, which are made when a frame is computed.
fn check_tensors(graph: &TypedModel) -> TractResult<()> {
    for node in &graph.nodes {
        for fact in node.outputs.iter().map(|output| &output.fact) {
            let Some(shape) = fact.shape.as_concrete() else { continue };
            let elements = shape.iter().try_fold(1usize, |product, dim| product.checked_mul(*dim));
            let bytes = elements.and_then(|elements| elements.checked_mul(fact.datum_type.size_of()));
            if bytes.is_none_or(|bytes| bytes > LARGEST_TENSOR) {
                return Err(TractError::msg(format!(
                    "its operator {} makes a tensor of the shape {shape:?}, and one may have {} MiB",
                    node.name,
                    LARGEST_TENSOR >> 20
                )));
            }
        }
    }
    Ok(())
}

fn write(tensor: &mut Arc<Tensor>, values: &[f32]) -> Result<()> {
    // After a run no one else holds the tensor, so that it is written where it lies.
    let mut view = Arc::make_mut(tensor).try_as_plain_ram_mut().place(name())?;
    view.as_slice_mut::<f32>().place(name())?.copy_from_slice(values);
    Ok(())
}

impl Session for Tract {
    fn run(&mut self, image: &[f32], speed: f32, outputs: &mut [Vec<f32>]) -> Result<()> {
        write(&mut self.image, image)?;
        let image = self.image.clone().into_tvalue();
        let inputs = match &mut self.speed {
            None => tvec!(image),
            Some((tensor, first)) => {
                write(tensor, &[speed])?;
                let speed = tensor.clone().into_tvalue();
                if *first { tvec!(speed, image) } else { tvec!(image, speed) }
            }
        };
        let results = self.state.run(inputs).place(name())?;
        for (values, result) in outputs.iter_mut().zip(results) {
            values.clear();
            values.extend_from_slice(
                result.try_as_plain_ram().and_then(|view| view.as_slice::<f32>()).place(name())?,
            );
        }
        Ok(())
    }

    fn backend(&self) -> String {
        name().to_owned()
    }
}

#[cfg(test)]
mod tests {
    #[test]
    fn the_version_is_the_one_that_is_built_in() {
        let version = super::name().strip_prefix("tract ").unwrap();
        let workspace = include_str!("../../../Cargo.toml");
        assert!(workspace.contains(&format!("tract-onnx = {{ version = \"={version}\"")));
    }
}
