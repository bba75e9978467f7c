//! How long operators take, and a block of a transformer: figures for a person.
//!
//! `cargo test --release -p pdk-onnx --lib speed -- --ignored --nocapture` prints them. If `PDK_ONNX_SPEED` names a folder, the models are
//! written there, so that other runtimes can be compared.

use std::path::PathBuf;
use std::time::Instant;

use super::*;
use crate::model;
use crate::tensor::Tensor;
use crate::testing::Setting::{Float, Int, Ints, Text};
use crate::testing::{Sketch, numbers};

/// Adds the nodes from `x` to `y`.
type Build = fn(&mut Sketch);

/// Patches and features of the smallest vision transformer, its heads, and the features between the two layers of its perceptron.
const PATCHES: usize = 197;
const FEATURES: usize = 192;
const HEADS: usize = 3;
const WIDE: usize = 768;

const ROWS: &[usize] = &[1, PATCHES, FEATURES];
const HIDDEN: &[usize] = &[1, PATCHES, WIDE];
const SCORES: &[usize] = &[1, HEADS, PATCHES, PATCHES];
const IMAGE: &[usize] = &[1, 64, 56, 56];

fn number(s: &mut Sketch, name: &str, value: f64) -> String {
    s.weights(name, Tensor::floats(&[], vec![value]))
}

fn unary(s: &mut Sketch, operator: &str) {
    s.node(operator, &["x"], "y", &[]);
}

fn with_number(s: &mut Sketch, operator: &str, value: f64) {
    let value = number(s, "number", value);
    s.node(operator, &["x", &value], "y", &[]);
}

fn with_weights(s: &mut Sketch, operator: &str, shape: &[usize]) {
    let weights = s.drawn(shape, 0.5, 1.5);
    s.node(operator, &["x", &weights], "y", &[]);
}

fn reduction(s: &mut Sketch, operator: &str, axes: &[i64]) {
    s.with_ints(if operator == "ReduceSum" { 13 } else { 18 }, operator, "x", "y", ("axes", axes), &[]);
}

fn layer_normalization(s: &mut Sketch, x: &str, y: &str) {
    let (scale, bias) = (s.drawn(&[FEATURES], 0.5, 1.5), s.drawn(&[FEATURES], -0.5, 0.5));
    s.node("LayerNormalization", &[x, &scale, &bias], y, &[("axis", Int(-1)), ("epsilon", Float(1e-6))]);
}

/// The same as exporters spelled it before version 17.
fn spelled_normalization(s: &mut Sketch, x: &str, y: &str) {
    let (scale, bias) = (s.drawn(&[FEATURES], 0.5, 1.5), s.drawn(&[FEATURES], -0.5, 0.5));
    let [mean, centred, square, variance, sum, root, quotient, product] =
        ["mean", "centred", "square", "variance", "sum", "root", "quotient", "product"]
            .map(|part| format!("{y}_{part}"));
    let two = number(s, &format!("{y}_two"), 2.0);
    let epsilon = number(s, &format!("{y}_epsilon"), 1e-6);
    s.with_ints(18, "ReduceMean", x, &mean, ("axes", &[-1]), &[]);
    s.node("Sub", &[x, &mean], &centred, &[]);
    s.node("Pow", &[&centred, &two], &square, &[]);
    s.with_ints(18, "ReduceMean", &square, &variance, ("axes", &[-1]), &[]);
    s.node("Add", &[&variance, &epsilon], &sum, &[]);
    s.node("Sqrt", &[&sum], &root, &[]);
    s.node("Div", &[&centred, &root], &quotient, &[]);
    s.node("Mul", &[&quotient, &scale], &product, &[]);
    s.node("Add", &[&product, &bias], y, &[]);
}

/// The exact `Gelu` as exporters spelled it before version 20.
fn spelled_gelu(s: &mut Sketch, x: &str, y: &str) {
    let [quotient, erf, step, product] =
        ["quotient", "erf", "step", "product"].map(|part| format!("{y}_{part}"));
    let root = number(s, &format!("{y}_root"), f64::from(std::f32::consts::SQRT_2));
    let (one, half) = (number(s, &format!("{y}_one"), 1.0), number(s, &format!("{y}_half"), 0.5));
    s.node("Div", &[x, &root], &quotient, &[]);
    s.node("Erf", &[&quotient], &erf, &[]);
    s.node("Add", &[&erf, &one], &step, &[]);
    s.node("Mul", &[x, &step], &product, &[]);
    s.node("Mul", &[&product, &half], y, &[]);
}

fn linear(s: &mut Sketch, x: &str, y: &str, shape: [usize; 2]) {
    let far = 1.0 / (shape[0] as f64).sqrt();
    let (weights, bias) = (s.drawn(&shape, -far, far), s.drawn(&[shape[1]], -far, far));
    let product = format!("{y}_product");
    s.node("MatMul", &[x, &weights], &product, &[]);
    s.node("Add", &[&bias, &product], y, &[]);
}

/// One block: attention of three heads and a perceptron, each behind a normalization and with a shortcut.
pub(super) fn block(s: &mut Sketch, is_spelled: bool, [x, y]: [&str; 2]) {
    let normalize = if is_spelled { spelled_normalization } else { layer_normalization };
    let name = |part: &str| format!("{y}_{part}");
    normalize(s, x, &name("normal"));
    linear(s, &name("normal"), &name("all"), [FEATURES, 3 * FEATURES]);
    let width = FEATURES / HEADS;
    let heads = s.ints(&[1, PATCHES as i64, 3, HEADS as i64, width as i64]);
    s.node("Reshape", &[&name("all"), &heads], &name("split"), &[]);
    s.node("Transpose", &[&name("split")], &name("turned"), &[("perm", Ints(&[2, 0, 3, 1, 4]))]);
    for (place, part) in ["q", "k", "v"].into_iter().enumerate() {
        let place = s.weights(
            &name(&format!("{part}_place")),
            Tensor { shape: Vec::new(), ..Tensor::ints(&[place as i64]) },
        );
        s.node("Gather", &[&name("turned"), &place], &name(part), &[("axis", Int(0))]);
    }
    s.node("Transpose", &[&name("k")], &name("kt"), &[("perm", Ints(&[0, 1, 3, 2]))]);
    s.node("MatMul", &[&name("q"), &name("kt")], &name("raw"), &[]);
    let factor = number(s, &name("factor"), 0.125);
    s.node("Mul", &[&name("raw"), &factor], &name("scores"), &[]);
    s.node("Softmax", &[&name("scores")], &name("shares"), &[("axis", Int(-1))]);
    s.node("MatMul", &[&name("shares"), &name("v")], &name("mixed"), &[]);
    s.node("Transpose", &[&name("mixed")], &name("rows"), &[("perm", Ints(&[0, 2, 1, 3]))]);
    let joined = s.ints(&[1, PATCHES as i64, FEATURES as i64]);
    s.node("Reshape", &[&name("rows"), &joined], &name("joined"), &[]);
    linear(s, &name("joined"), &name("projected"), [FEATURES, FEATURES]);
    s.node("Add", &[x, &name("projected")], &name("attended"), &[]);
    normalize(s, &name("attended"), &name("again"));
    linear(s, &name("again"), &name("wide"), [FEATURES, WIDE]);
    match is_spelled {
        true => spelled_gelu(s, &name("wide"), &name("active")),
        false => s.node("Gelu", &[&name("wide")], &name("active"), &[]),
    }
    linear(s, &name("active"), &name("narrow"), [WIDE, FEATURES]);
    s.node("Add", &[&name("attended"), &name("narrow")], y, &[]);
}

const MEASURED: &[(&str, &[usize], Build)] = &[
    ("block of a transformer", ROWS, |s| block(s, false, ["x", "y"])),
    ("block, spelled in old operators", ROWS, |s| block(s, true, ["x", "y"])),
    ("LayerNormalization", ROWS, |s| layer_normalization(s, "x", "y")),
    ("LayerNormalization, spelled", ROWS, |s| spelled_normalization(s, "x", "y")),
    ("Gelu", HIDDEN, |s| unary(s, "Gelu")),
    ("Gelu by tanh", HIDDEN, |s| s.node("Gelu", &["x"], "y", &[("approximate", Text("tanh"))])),
    ("Gelu, spelled", HIDDEN, |s| spelled_gelu(s, "x", "y")),
    ("Erf", HIDDEN, |s| unary(s, "Erf")),
    ("Sigmoid", HIDDEN, |s| unary(s, "Sigmoid")),
    ("Softmax", SCORES, |s| s.node("Softmax", &["x"], "y", &[("axis", Int(-1))])),
    ("Softmax over channels", IMAGE, |s| s.node("Softmax", &["x"], "y", &[("axis", Int(1))])),
    ("MatMul of computed 197x64 64x197, 3 times", &[1, HEADS, PATCHES, 64], |s| {
        s.node("Transpose", &["x"], "turned", &[("perm", Ints(&[0, 1, 3, 2]))]);
        s.node("MatMul", &["x", "turned"], "y", &[]);
    }),
    ("MatMul with weights 197x192 192x768", ROWS, |s| {
        let weights = s.drawn(&[FEATURES, WIDE], -0.1, 0.1);
        s.node("MatMul", &["x", &weights], "y", &[]);
    }),
    ("Add of 192 numbers", ROWS, |s| with_weights(s, "Add", &[FEATURES])),
    ("Mul by one number", HIDDEN, |s| with_number(s, "Mul", 0.125)),
    ("Mul of both", HIDDEN, |s| s.node("Mul", &["x", "x"], "y", &[])),
    ("Div by a number for each row", HIDDEN, |s| with_weights(s, "Div", &[PATCHES, 1])),
    ("Sqrt", HIDDEN, |s| unary(s, "Sqrt")),
    ("Reciprocal", HIDDEN, |s| unary(s, "Reciprocal")),
    ("Relu", HIDDEN, |s| unary(s, "Relu")),
    ("Pow 2", HIDDEN, |s| with_number(s, "Pow", 2.0)),
    ("Pow 3", HIDDEN, |s| with_number(s, "Pow", 3.0)),
    ("Pow 0.5", HIDDEN, |s| with_number(s, "Pow", 0.5)),
    ("Pow -0.5", HIDDEN, |s| with_number(s, "Pow", -0.5)),
    ("Pow 1.7", HIDDEN, |s| with_number(s, "Pow", 1.7)),
    ("ReduceMean of the last axis", HIDDEN, |s| reduction(s, "ReduceMean", &[-1])),
    ("ReduceMean of the middle axis", HIDDEN, |s| reduction(s, "ReduceMean", &[1])),
    ("ReduceSum of height and width", IMAGE, |s| reduction(s, "ReduceSum", &[2, 3])),
    ("ReduceMax of the last axis", HIDDEN, |s| reduction(s, "ReduceMax", &[-1])),
    ("ReduceMax of channels", IMAGE, |s| reduction(s, "ReduceMax", &[1])),
    ("PRelu by channel", IMAGE, |s| with_weights(s, "PRelu", &[64, 1, 1])),
    ("LRN over 5 channels", IMAGE, |s| s.node("LRN", &["x"], "y", &[("size", Int(5))])),
    ("ArgMax of the last axis", HIDDEN, |s| {
        s.node("ArgMax", &["x"], "place", &[("axis", Int(-1))]);
        s.node("Cast", &["place"], "y", &[("to", Int(1))]);
    }),
    ("ArgMax of channels", IMAGE, |s| {
        s.node("ArgMax", &["x"], "place", &[("axis", Int(1))]);
        s.node("Cast", &["place"], "y", &[("to", Int(1))]);
    }),
    ("Greater than a number", HIDDEN, |s| {
        let zero = number(s, "zero", 0.0);
        s.node("Greater", &["x", &zero], "holds", &[]);
        s.node("Cast", &["holds"], "y", &[("to", Int(1))]);
    }),
    ("Where by a computed condition", HIDDEN, |s| {
        let zero = number(s, "zero", 0.0);
        s.node("Greater", &["x", &zero], "holds", &[]);
        s.node("Where", &["holds", "x", &zero], "y", &[]);
    }),
    ("InstanceNormalization", IMAGE, |s| {
        let weights = [s.drawn(&[64], 0.5, 1.5), s.drawn(&[64], -0.5, 0.5)];
        s.node("InstanceNormalization", &["x", &weights[0], &weights[1]], "y", &[]);
    }),
    ("GlobalMaxPool", IMAGE, |s| unary(s, "GlobalMaxPool")),
    ("Softplus", HIDDEN, |s| unary(s, "Softplus")),
    ("Mish", HIDDEN, |s| unary(s, "Mish")),
    ("LogSoftmax", HIDDEN, |s| unary(s, "LogSoftmax")),
    ("Sin", HIDDEN, |s| unary(s, "Sin")),
    ("Softsign", HIDDEN, |s| unary(s, "Softsign")),
    ("Sum of three", HIDDEN, |s| s.node("Sum", &["x", "x", "x"], "y", &[])),
    ("Mean of two", HIDDEN, |s| s.node("Mean", &["x", "x"], "y", &[])),
    ("CumSum", HIDDEN, |s| {
        let axis = s.ints(&[1]);
        s.node("CumSum", &["x", &axis], "y", &[]);
    }),
    ("TopK, 5 of 768", HIDDEN, |s| {
        let count = s.ints(&[5]);
        s.split("TopK", &["x", &count], &["y", "places"], &[]);
    }),
    ("Einsum of 197x64 and 197x64, 3 times", &[1, HEADS, PATCHES, 64], |s| {
        s.node("Einsum", &["x", "x"], "y", &[("equation", Text("bhid,bhjd->bhij"))]);
    }),
    ("Log", HIDDEN, |s| unary(s, "Log")),
];

#[test]
#[ignore = "measures time"]
fn prints_how_long_operators_take() {
    let folder = std::env::var_os("PDK_ONNX_SPEED").map(PathBuf::from);
    for (name, shape, build) in MEASURED {
        let mut s = Sketch::new(20);
        s.input("x", shape);
        build(&mut s);
        let model = s.model(&["y"]);
        if let Some(folder) = &folder {
            std::fs::write(folder.join(format!("{name}.onnx")), model::encode(&model)).unwrap();
        }
        let graph = Graph::new(model).unwrap_or_else(|error| panic!("{name}: {error}"));
        let mut program = Program::new(graph).unwrap();
        // Positive, so that roots and powers are numbers.
        let x = numbers(3, shape.iter().product()).iter().map(|value| (value * 0.9 + 1.0) as f32).collect();
        let (inputs, mut outputs) = ([x], [Vec::new()]);
        let mut best = f64::INFINITY;
        let begin = Instant::now();
        for round in 0..2000 {
            let start = Instant::now();
            program.run(&inputs, &mut outputs).unwrap();
            best = best.min(start.elapsed().as_secs_f64());
            if round > 3 && begin.elapsed().as_secs_f64() > 0.5 {
                break;
            }
        }
        println!("{:9.3} ms  {name}", best * 1e3);
    }
}

/// How long each step of the models in `PDK_ONNX_MODELS` takes, whose paths are separated by colons. The sum of the bits of what they compute
/// tells whether two versions compute the same.
#[test]
#[ignore = "measures time"]
fn prints_how_long_each_step_takes() {
    for file in std::env::var("PDK_ONNX_MODELS").unwrap().split(':') {
        let mut program = Program::new(Graph::new(model::read(file.as_ref()).unwrap()).unwrap()).unwrap();
        let given = program.inputs.iter().map(|&(_, _, count)| {
            numbers(count as u64, count).iter().map(|value| (value * 100.0 + 100.0) as f32).collect()
        });
        let (given, mut outputs): (Vec<Vec<f32>>, _) = (given.collect(), [Vec::new()]);
        let mut best = vec![f64::INFINITY; program.steps.len()];
        let mut whole = f64::INFINITY;
        let begin = Instant::now();
        while begin.elapsed().as_secs_f64() < 2.0 {
            let start = Instant::now();
            program.run(&given, &mut outputs).unwrap();
            whole = whole.min(start.elapsed().as_secs_f64());
            let Program { steps, buffers, constants, inputs, .. } = &mut program;
            for (&mut (place, _, count), values) in inputs.iter_mut().zip(&given) {
                buffers[place].resize(count);
                buffers[place].single_mut().unwrap().copy_from_slice(values);
            }
            for (step, best) in steps.iter_mut().zip(&mut best) {
                let start = Instant::now();
                step.run(buffers, constants).unwrap();
                *best = best.min(start.elapsed().as_secs_f64());
            }
        }
        let bits = outputs[0].iter().fold(0u64, |sum, value| sum.rotate_left(5) ^ u64::from(value.to_bits()));
        println!("{:9.1} us  {file}, bits {bits:x}", whole * 1e6);
        for (step, best) in program.steps.iter().zip(&best).filter(|(_, best)| **best > 2e-6) {
            let counts: Vec<usize> = step.outputs.iter().map(|(_, _, count)| *count).collect();
            println!("{:9.1} us  a step to {counts:?}", best * 1e6);
        }
    }
}
