//! The node tests of the ONNX project: what an operator has to compute, from those who define it. They come with its Python package
//! (`onnx/backend/test/data/node`; tried with version 1.18), and `PDK_ONNX_NODE_TESTS` names that folder. Programs have to compute the same.

use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};

use pdk_sdk::error::{Error, Place, Result};
use prost::Message;

use super::slope;
use crate::gradient::{Target, gradients};
use crate::graph::Graph;
use crate::inference::Program;
use crate::model;
use crate::operators;
use crate::proto::TensorProto;
use crate::tensor::{Element, Tensor};

/// Names the folder.
const VARIABLE: &str = "PDK_ONNX_NODE_TESTS";

/// The official cases compare with these differences.
const RELATIVE: f64 = 1e-3;
const ABSOLUTE: f64 = 1e-7;

/// Cases that ONNX Runtime computes otherwise than they are written, and so does this crate: where sizes are rounded up, what a window
/// covers beyond the declared zeros does not count; corners are aligned by the rounded size; a result that does not fit 8 bits saturates, as the
/// operator's text says, but the cases have its low bits.
const AS_THE_RUNTIMES: &[&str] = &[
    "test_averagepool_3d_dilations_large_count_include_pad_is_1_ceil_mode_is_True",
    "test_qlinearmatmul_2D_int8_float16",
    "test_qlinearmatmul_2D_int8_float32",
    "test_qlinearmatmul_3D_int8_float16",
    "test_qlinearmatmul_3D_int8_float32",
    "test_resize_downsample_scales_cubic_align_corners",
    "test_resize_downsample_scales_linear_align_corners",
];

/// What came of the cases of an operator.
#[derive(Default)]
struct Tally {
    passed: usize,
    /// How many of these a program computes as well.
    programmed: usize,
    refused: Vec<String>,
    derived: usize,
}

fn tensor(path: &Path) -> Result<Tensor> {
    let bytes = std::fs::read(path).place(path.display())?;
    Tensor::from_proto(&TensorProto::decode(bytes.as_slice()).place(path.display())?)
}

fn tensors(folder: &Path, what: &str) -> Result<Vec<Tensor>> {
    let files = (0..).map(|number| folder.join(format!("{what}_{number}.pb")));
    files.take_while(|file| file.is_file()).map(|file| tensor(&file)).collect()
}

/// Whether two numbers are equal; `element` is the type that the case expects. The files hold brain floats whose last bits were cut, but
/// this crate rounds them to the nearest: a difference of one step.
fn close(found: f64, expected: f64, element: Element) -> bool {
    let relative = if element == Element::BFLOAT16 { 1.0 / 128.0 } else { RELATIVE };
    found == expected
        || found.is_nan() && expected.is_nan()
        || (found - expected).abs() <= ABSOLUTE + relative * expected.abs()
}

/// The graph of a case, what goes in by name, and what has to come out.
type Case = (Graph, Vec<(String, Tensor)>, Vec<Tensor>);

/// Reads a case, in which only the first `variable` inputs are inputs of the graph: sizes and axes have to be constants.
fn case(folder: &Path, variable: usize) -> Result<Case> {
    let mut model = model::read(&folder.join("model.onnx"))?;
    let data = folder.join("test_data_set_0");
    let mut inputs = tensors(&data, "input")?;
    let mut outputs = tensors(&data, "output")?;
    let Some(graph) = &mut model.graph else { return Err(Error::new("it has no graph")) };
    if graph.input.len() != inputs.len() {
        return Err(Error::new("it has inputs that are not tensors"));
    }
    // The files hold brain floats as their bits.
    for (info, tensor) in graph.input.iter().zip(&mut inputs).chain(graph.output.iter().zip(&mut outputs)) {
        if info.tensor_type().is_some_and(|info| info.elem_type == Element::BFLOAT16.0)
            && tensor.element.0 == 4
        {
            tensor.element = Element::BFLOAT16;
            tensor
                .values
                .iter_mut()
                .for_each(|value| *value = f64::from(f32::from_bits((*value as u32) << 16)));
        }
    }
    let variable = variable.min(inputs.len());
    let names = graph.input.drain(variable..).map(|input| input.name);
    graph
        .initializer
        .extend(names.zip(inputs.drain(variable..)).map(|(name, tensor)| tensor.to_proto(&name)));
    let graph = Graph::new(model)?;
    let names: Vec<String> = graph.inputs().map(str::to_owned).collect();
    Ok((graph, names.into_iter().zip(inputs).collect(), outputs))
}

/// Whether the graph computes what it has to. An error is something that is not known here.
fn passes((graph, inputs, expected): &Case) -> Result<std::result::Result<(), String>> {
    let given: Vec<(&str, &Tensor)> = inputs.iter().map(|(name, tensor)| (name.as_str(), tensor)).collect();
    let outputs: Vec<&str> = graph.outputs().iter().map(String::as_str).collect();
    for (place, (found, expected)) in graph.evaluate(&given, &outputs)?.iter().zip(expected).enumerate() {
        if found.shape != expected.shape {
            return Ok(Err(format!(
                "output {place} has the shape {:?}, not {:?}",
                found.shape, expected.shape
            )));
        }
        let wrong =
            found.values.iter().zip(&expected.values).position(|(a, b)| !close(*a, *b, expected.element));
        if let Some(at) = wrong {
            return Ok(Err(format!(
                "output {place} is {} at {at}, not {}",
                found.values[at], expected.values[at]
            )));
        }
    }
    Ok(Ok(()))
}

/// Whether a program computes what it has to; it cannot be tried if an input holds an integer that no 32-bit float is.
fn programmed((graph, inputs, expected): &Case) -> std::result::Result<bool, String> {
    let given = |tensor: &Tensor| -> Option<Vec<f32>> {
        let single = |&value: &f64| {
            let single = value as f32;
            (tensor.element.is_float() || f64::from(single) == value).then_some(single)
        };
        tensor.values.iter().map(single).collect()
    };
    let Some(given) = inputs.iter().map(|(_, tensor)| given(tensor)).collect::<Option<Vec<_>>>() else {
        return Ok(false);
    };
    let mut outputs = vec![Vec::new(); graph.outputs().len()];
    Program::new(graph.clone())
        .and_then(|mut program| program.run(&given, &mut outputs))
        .map_err(|error| format!("its program: {error}"))?;
    for (place, (found, expected)) in outputs.iter().zip(expected).enumerate() {
        let expected_values = expected.values.iter().map(|&value| f64::from(value as f32));
        if found.len() != expected.values.len() {
            return Err(format!(
                "its program has {} numbers in output {place}, not {}",
                found.len(),
                expected.values.len()
            ));
        }
        for (at, (&found, value)) in found.iter().zip(expected_values).enumerate() {
            if !close(f64::from(found), value, expected.element) {
                return Err(format!("output {place} of its program is {found} at {at}, not {value}"));
            }
        }
    }
    Ok(true)
}

/// The number of inputs whose gradient is that of central differences at a number of the first output, at one place or more.
fn derived((graph, inputs, expected): &Case) -> std::result::Result<usize, String> {
    const STEP: f64 = 1e-5;
    let Some(count) = expected.first().map(|first| first.values.len()).filter(|count| *count > 0) else {
        return Ok(0);
    };
    let target = Target { value: &graph.outputs()[0], index: count / 2 };
    let given: Vec<(&str, &Tensor)> = inputs.iter().map(|(name, tensor)| (name.as_str(), tensor)).collect();
    let mut derived = 0;
    for (name, input) in &given {
        if !input.element.is_float() {
            continue;
        }
        let Ok(built) = gradients(graph, target, &[name], &[]) else { continue };
        let exact = Graph::new(built.model)
            .and_then(|graph| graph.evaluate(&given, &[&built.outputs[0]]))
            .map_err(|error| format!("its gradient cannot be computed: {error}"))?
            .swap_remove(0);
        let mut compared = false;
        let step = (input.values.len() / 40).max(1);
        for at in (0..input.values.len()).step_by(step) {
            let value = |moved: &Tensor| {
                let given: Vec<_> = given
                    .iter()
                    .map(|(other, tensor)| (*other, if other == name { moved } else { *tensor }))
                    .collect();
                graph.evaluate(&given, &[target.value]).map(|values| values[0].values[target.index])
            };
            let slopes =
                [[-STEP, STEP], [-STEP, 0.0], [0.0, STEP]].map(|steps| slope(input, at, steps, value));
            let [Ok(difference), Ok(before), Ok(after)] = slopes else { continue };
            // At an edge or a pole there is nothing to compare with.
            if !difference.is_finite() || (before - after).abs() > 1e-3 * (1.0 + difference.abs()) {
                continue;
            }
            compared = true;
            if (exact.values[at] - difference).abs() > 1e-6 + 1e-4 * difference.abs() {
                return Err(format!(
                    "the gradient of `{name}` is {} at {at}, not {difference}",
                    exact.values[at]
                ));
            }
        }
        derived += usize::from(compared);
    }
    Ok(derived)
}

#[test]
#[ignore = "needs PDK_ONNX_NODE_TESTS"]
fn the_official_node_tests_of_known_operators_pass() {
    let folder = std::env::var_os(VARIABLE).map(PathBuf::from);
    let folder = folder
        .unwrap_or_else(|| panic!("{VARIABLE} is not set; set it to the folder of the node tests of ONNX"));
    let mut folders: Vec<_> =
        std::fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    folders.sort();
    let (mut tallies, mut wrong, mut unknown) =
        (BTreeMap::<String, Tally>::new(), Vec::new(), BTreeSet::new());
    for folder in &folders {
        let name = folder.file_name().unwrap().to_string_lossy().into_owned();
        let model = model::read(&folder.join("model.onnx")).unwrap();
        let nodes = model.graph.map(|graph| graph.node).unwrap_or_default();
        // Cases of one operator; those whose names end in `_expanded` have what it consists of.
        let Some(operator) = nodes.last().map(|node| node.op_type.clone()) else { continue };
        if let Some(node) = nodes.iter().find(|node| operators::find(node).is_none()) {
            unknown.insert(node.op_type.clone());
            continue;
        }
        let tally = tallies.entry(operator).or_default();
        let tried =
            |variable| case(folder, variable).and_then(|case| passes(&case).map(|passed| (case, passed)));
        match tried(usize::MAX).or_else(|_| tried(1)).or_else(|_| tried(0)) {
            Err(error) => tally.refused.push(format!("{name}: {error}")),
            Ok((_, Err(_))) if AS_THE_RUNTIMES.contains(&name.as_str()) => {
                tally.refused.push(format!("{name}: as runtimes compute it"))
            }
            Ok((_, Err(difference))) => wrong.push(format!("{name}: {difference}")),
            Ok((case, Ok(()))) => {
                tally.passed += 1;
                // A program has to know sizes and axes beforehand, even if the case computes from others.
                let from_constants = |error: String| match error.contains("has to be a constant") {
                    true => [1, 0]
                        .into_iter()
                        .find_map(|variable| programmed(&self::case(folder, variable).ok()?).ok())
                        .ok_or(error),
                    false => Err(error),
                };
                match programmed(&case).or_else(from_constants) {
                    Ok(ran) => tally.programmed += usize::from(ran),
                    Err(difference) => wrong.push(format!("{name}: {difference}")),
                }
                match derived(&case) {
                    Ok(count) => tally.derived += count,
                    Err(difference) => wrong.push(format!("{name}: {difference}")),
                }
            }
        }
    }
    for (operator, Tally { passed, programmed, refused, derived }) in &tallies {
        println!(
            "{operator:<24} passed {passed:>3}, by a program {programmed:>3}, refused {:>3}, gradients {derived:>3}",
            refused.len()
        );
        refused.iter().for_each(|refused| println!("    {refused}"));
    }
    let total = |count: fn(&Tally) -> usize| tallies.values().map(count).sum::<usize>();
    println!(
        "{} operators: passed {}, by a program {}, wrong {}, refused {}, gradients as by differences {}; operators without a rule: {}",
        tallies.len(),
        total(|tally| tally.passed),
        total(|tally| tally.programmed),
        wrong.len(),
        total(|tally| tally.refused.len()),
        total(|tally| tally.derived),
        unknown.len()
    );
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    assert!(total(|tally| tally.passed) > 0, "{} holds no cases", folder.display());
}
