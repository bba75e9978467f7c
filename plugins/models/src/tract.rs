//! Runs networks with tract, which is part of this plugin.

use std::borrow::Cow;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Arc, OnceLock};

use pdk_network::Element;
use pdk_sdk::error::Place;
use pdk_sdk::prelude::*;
use tract_onnx::pb;
use tract_onnx::prelude::*;
use tract_onnx::tract_core::knobs::set_str;
use tract_onnx::tract_core::model::TypedSimpleState;
use tract_onnx::tract_hir::infer::InferenceFact;

use crate::locate;
use crate::processor;
use crate::session::{Graph, Network, Session, Taken};

/// A network that tract runs.
pub struct Tract {
    state: TypedSimpleState,
    /// Each input with a tensor for it.
    inputs: Vec<(Taken, Arc<Tensor>)>,
}

/// Bytes of a tensor between the operators of a model: far above those of any driver.
const LARGEST_TENSOR: usize = 1 << 30;

/// The name with the version, which is pinned in the workspace.
pub fn name() -> &'static str {
    "tract 0.23.9"
}

/// Its full name on this machine.
pub fn engine() -> String {
    format!("{}/{}", name(), Class::of_this_machine().name())
}

/// The kernels that are used. tract picks them by the processor, and their sums differ in the last digits, so it is held to those of
/// few classes that many processors share.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Class {
    /// With AVX2 and FMA: nearly every x86-64 processor since 2013.
    X86V3,
    /// What every processor of the architecture has.
    Baseline,
}

impl Class {
    fn of_this_machine() -> Self {
        match processor::is_v3() {
            true => Self::X86V3,
            false => Self::Baseline,
        }
    }

    fn name(self) -> String {
        match self {
            Self::X86V3 => "x86-64-v3".to_owned(),
            Self::Baseline => std::env::consts::ARCH.replace('_', "-"),
        }
    }

    /// The settings of tract that follow from the processor: its own knobs, which it otherwise takes from the environment or finds out.
    fn settings(self) -> Vec<(&'static str, &'static str)> {
        let instructions = match (self, std::env::consts::ARCH) {
            (Self::X86V3, _) => "-avx512f,-avx512vnni,-avx512fp16,-avxvnni,-amx-int8,-amx-bf16",
            (Self::Baseline, "x86_64") => {
                "-avx,-avx2,-fma,-f16c,-avx512f,-avx512vnni,-avx512fp16,-avxvnni,-amx-int8,-amx-bf16"
            }
            (Self::Baseline, "aarch64") => "-fp16,-dotprod,-sve2,-sme,-sme2,-apple-amx",
            (Self::Baseline, _) => "",
        };
        let mut settings = vec![
            ("TRACT_CPU_ISA", instructions),
            ("TRACT_AMX_BF16", "false"),
            ("TRACT_AVGPOOL_SEPARABLE", "false"),
            // Which kernels a convolution takes.
            ("TRACT_DISABLE_DIRECT_SPATIAL", "false"),
            ("TRACT_ENABLE_BLOCKED_CONV", "false"),
            ("TRACT_DISABLE_BLOCKED_CONV", "true"),
            ("TRACT_DISABLE_DEPTHWISE_DECONV", "false"),
        ];
        if std::env::consts::ARCH == "aarch64" {
            settings.extend([
                ("TRACT_CPU_AARCH64_KIND", "generic"),
                ("TRACT_DOTPROD_DISABLE", "true"),
                ("TRACT_SVE_DISABLE", "true"),
                ("TRACT_SME_DISABLE", "true"),
            ]);
        }
        settings
    }
}

/// Holds tract to the kernels of this machine's class, before it looks at the processor for the first time.
fn pin() -> Result<()> {
    static PINNED: OnceLock<Option<&str>> = OnceLock::new();
    let unknown = PINNED.get_or_init(|| {
        let settings = Class::of_this_machine().settings();
        settings.into_iter().find(|(name, value)| !set_str(name, value)).map(|(name, _)| name)
    });
    match unknown {
        None => Ok(()),
        Some(name) => Err(Error::new(format!("it has no setting {name}, which is a defect in pdk"))),
    }
}

impl Tract {
    /// Prepares a network.
    ///
    /// # Errors
    /// If the network has operators that tract does not know or contradicts itself.
    pub fn new(network: &Network<'_>) -> Result<Self> {
        pin()?;
        let onnx = tract_onnx::onnx();
        let proto = match &network.graph {
            Graph::File { proto, .. } => Cow::Borrowed(*proto),
            Graph::Memory(bytes) => {
                let read = onnx.proto_model_for_read(&mut &**bytes);
                Cow::Owned(read.map_err(|error| Error::new(format!("it cannot read the graph ({error:#})")))?)
            }
        };
        let nodes = proto.graph.iter().flat_map(|graph| &graph.node);
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
        let state = catch_unwind(AssertUnwindSafe(|| prepare(network, &proto)))
            .map_err(|_| {
                Error::new(format!("it cannot make sense of the model; {}", locate::instead_of_tract()))
            })?
            .map_err(|error| {
                let reason = first_line(&format!("{error:#}"));
                Error::new(format!("it cannot prepare the model ({reason}); {}", locate::instead_of_tract()))
            })?;
        let zero = |taken: &Taken| {
            let tensor = Tensor::zero_dt(datum_type(taken.element), &taken.shape).place(name())?;
            Ok((taken.clone(), Arc::new(tensor)))
        };
        Ok(Self { state, inputs: network.inputs.iter().map(zero).collect::<Result<_>>()? })
    }
}

/// The first line of a reason. After it, tract prints what it was about to put into the graph, which fills screens.
fn first_line(reason: &str) -> String {
    let line = reason.lines().next().unwrap_or_default();
    line.trim_end_matches([' ', '.', ':']).to_owned()
}

fn prepare(network: &Network<'_>, proto: &pb::ModelProto) -> TractResult<TypedSimpleState> {
    // What the file says about intermediate shapes names the batch, which is 1 here.
    let onnx = tract_onnx::onnx().with_ignore_value_info(true);
    // Weights may lie in files beside the model's.
    let folder = match &network.graph {
        Graph::File { path, .. } => path.parent().and_then(|folder| folder.to_str()),
        Graph::Memory(_) => None,
    };
    let parsed = onnx.parse(proto, folder)?;
    if !parsed.unresolved_inputs.is_empty() {
        return Err(TractError::msg(format!("nothing computes {}", parsed.unresolved_inputs.join(", "))));
    }
    let mut graph = parsed.model;
    for (place, Taken { shape, element }) in network.inputs.iter().enumerate() {
        graph.set_input_fact(place, InferenceFact::dt_shape(datum_type(*element), shape))?;
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

/// The type under tract's name.
fn datum_type(element: Element) -> DatumType {
    match element {
        Element::Float16 => DatumType::F16,
        Element::Uint8 => DatumType::U8,
        Element::Int8 => DatumType::I8,
        Element::Float32 | Element::Other(_) => DatumType::F32,
    }
}

fn write(taken: &Taken, tensor: &mut Arc<Tensor>, values: &[f32]) -> Result<()> {
    if tensor.datum_type() != DatumType::F32 {
        let is_whole = tensor.datum_type() != DatumType::F16;
        let rounded: Vec<f32> =
            values.iter().map(|value| if is_whole { taken.whole(*value) } else { *value }).collect();
        let floats = Tensor::from_shape(&taken.shape, &rounded).place(name())?;
        *tensor = Arc::new(floats.cast_to_dt(tensor.datum_type()).place(name())?.into_owned());
        return Ok(());
    }
    // After a run no one else holds the tensor, so that it is written where it lies.
    let mut view = Arc::make_mut(tensor).try_as_plain_ram_mut().place(name())?;
    view.as_slice_mut::<f32>().place(name())?.copy_from_slice(values);
    Ok(())
}

impl Session for Tract {
    fn run(&mut self, inputs: &[Vec<f32>], outputs: &mut [Vec<f32>]) -> Result<()> {
        for ((taken, tensor), values) in self.inputs.iter_mut().zip(inputs) {
            write(taken, tensor, values)?;
        }
        let inputs = self.inputs.iter().map(|(_, tensor)| tensor.clone().into_tvalue()).collect();
        // tract panics where it computes some models, such as those whose pads are negative.
        let results = catch_unwind(AssertUnwindSafe(|| self.state.run(inputs)))
            .map_err(|_| {
                Error::new(format!("{} cannot compute the model; {}", name(), locate::instead_of_tract()))
            })?
            .place(name())?;
        for (values, result) in outputs.iter_mut().zip(results) {
            let floats = result.cast_to::<f32>().place(name())?;
            values.clear();
            values.extend_from_slice(
                floats.try_as_plain_ram().and_then(|view| view.as_slice::<f32>()).place(name())?,
            );
        }
        Ok(())
    }

    fn engine(&self) -> String {
        engine()
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

    #[test]
    fn of_what_tract_prints_the_first_line_is_the_reason() {
        let printed = "Applying patch a: Trying to substitute a 1,3,F32 by 1,4,F32 as output #0 of b.\nGraph { nodes: [Node {\n} ] }";
        assert_eq!(
            super::first_line(printed),
            "Applying patch a: Trying to substitute a 1,3,F32 by 1,4,F32 as output #0 of b"
        );
        assert_eq!(super::first_line("nothing computes x"), "nothing computes x");
    }

    #[test]
    fn tract_is_held_to_its_class_whatever_the_processor_has() {
        use tract_onnx::tract_core::tract_linalg::isa::{Isa, native};
        super::pin().unwrap();
        let has = native();
        for beyond in [Isa::X86_64Avx512f, Isa::X86_64Avx512Vnni, Isa::X86_64AvxVnni, Isa::X86_64AmxInt8] {
            assert!(!has.has(beyond), "{has:?}");
        }
        let v3 = crate::processor::is_v3();
        assert_eq!(has.has(Isa::X86_64Fma), v3);
        assert_eq!(super::engine().ends_with("/x86-64-v3"), v3);
    }

    #[test]
    fn a_network_that_cannot_be_computed_is_an_error_with_a_remedy() {
        // It gathers behind the end, and tract panics when it comes to that.
        let file =
            concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/fuzz/corpus/onnx/gather_out_of_range.onnx");
        let error = crate::try_model(std::path::Path::new(file)).unwrap_err().to_string();
        assert!(error.contains("cannot compute the model") && error.contains("PDK_ONNXRUNTIME"), "{error}");
    }
}
