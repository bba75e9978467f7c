//! Operators with code of their own against their rules in 64-bit floats, with awkward shapes, and with and without vector instructions.

use super::lanes::portably;
use super::speed;
use super::*;
use crate::tensor::Tensor;
use crate::testing::Setting::{Float, Int, Text};
use crate::testing::{Sketch, numbers};

/// Name, version of the operator set, shape of `x`, and the nodes from `x` to `y`.
type Comparison = (&'static str, i64, &'static [usize], fn(&mut Sketch));

fn unary(s: &mut Sketch, operator: &str) {
    s.node(operator, &["x"], "y", &[]);
}

fn number(s: &mut Sketch, operator: &str, value: f64) {
    let value = s.weights("number", Tensor::floats(&[], vec![value]));
    s.node(operator, &["x", &value], "y", &[]);
}

fn weights(
    s: &mut Sketch,
    operator: &str,
    shapes: &[&[usize]],
    settings: &[(&str, crate::testing::Setting<'_>)],
) {
    let weights: Vec<String> = shapes.iter().map(|shape| s.drawn(shape, -1.0, 1.5)).collect();
    let inputs: Vec<&str> = std::iter::once("x").chain(weights.iter().map(String::as_str)).collect();
    s.node(operator, &inputs, "y", settings);
}

fn reduction(s: &mut Sketch, operator: &str, axes: &[i64], keeps: i64) {
    let since = if operator == "ReduceSum" { 13 } else { 18 };
    s.with_ints(since, operator, "x", "y", ("axes", axes), &[("keepdims", Int(keeps))]);
}

fn place(s: &mut Sketch, operator: &str, axis: i64, last: i64) {
    s.node(operator, &["x"], "place", &[("axis", Int(axis)), ("select_last_index", Int(last))]);
    s.node("Cast", &["place"], "y", &[("to", Int(1))]);
}

/// A choice between `x` and weights of a shape by a condition of another.
fn choice(s: &mut Sketch, condition: &[usize], other: &[usize], is_turned: bool) {
    let bound = s.drawn(condition, -1.0, 1.0);
    s.node("Greater", &["x", &bound], "holds", &[]);
    let other = s.drawn(other, -1.0, 1.0);
    let sides = if is_turned { [&other, "x"] } else { ["x", &other] };
    s.node("Where", &["holds", sides[0], sides[1]], "y", &[]);
}

const COMPARISONS: &[Comparison] = &[
    ("layer", 17, &[3, 197], |s| weights(s, "LayerNormalization", &[&[197], &[197]], &[])),
    ("layer of one", 17, &[5, 1], |s| weights(s, "LayerNormalization", &[&[1], &[1]], &[])),
    ("layer without terms", 17, &[2, 3, 7], |s| {
        weights(s, "LayerNormalization", &[&[7]], &[("epsilon", Float(0.1))])
    }),
    ("layer of two axes", 17, &[2, 3, 7], |s| {
        weights(s, "LayerNormalization", &[&[3, 7], &[1, 3, 7]], &[("axis", Int(1))])
    }),
    ("layer, broadcast", 17, &[2, 3, 7], |s| {
        weights(s, "LayerNormalization", &[&[7], &[3, 1]], &[("axis", Int(1))])
    }),
    ("mean of a layer", 17, &[3, 11], |s| {
        let [scale, bias] = [s.drawn(&[11], 0.5, 1.5), s.drawn(&[11], -1.0, 1.0)];
        s.split("LayerNormalization", &["x", &scale, &bias], &["normal", "y", "inverse"], &[]);
    }),
    ("deviation of a layer", 17, &[3, 11], |s| {
        let [scale, bias] = [s.drawn(&[11], 0.5, 1.5), s.drawn(&[11], -1.0, 1.0)];
        s.split("LayerNormalization", &["x", &scale, &bias], &["normal", "", "y"], &[]);
    }),
    ("layer with computed factors", 17, &[9, 9], |s| {
        let axes = s.ints(&[0]);
        s.node("ReduceSum", &["x", &axes], "sum", &[("keepdims", Int(0))]);
        s.node("LayerNormalization", &["x", "sum", "sum"], "y", &[]);
    }),
    ("root mean square", 23, &[3, 13], |s| weights(s, "RMSNormalization", &[&[13]], &[])),
    ("instance", 20, &[2, 3, 5, 7], |s| weights(s, "InstanceNormalization", &[&[3], &[3]], &[])),
    ("groups", 21, &[2, 6, 5, 3], |s| {
        weights(s, "GroupNormalization", &[&[6], &[6]], &[("num_groups", Int(2))])
    }),
    ("groups, old", 18, &[2, 6, 5, 3], |s| {
        weights(s, "GroupNormalization", &[&[3], &[3]], &[("num_groups", Int(3))])
    }),
    ("erf", 13, &[1003], |s| unary(s, "Erf")),
    ("gelu", 20, &[1003], |s| unary(s, "Gelu")),
    ("gelu by tanh", 20, &[1003], |s| s.node("Gelu", &["x"], "y", &[("approximate", Text("tanh"))])),
    ("swish", 24, &[1003], |s| s.node("Swish", &["x"], "y", &[("alpha", Float(1.5))])),
    ("selu", 13, &[1003], |s| unary(s, "Selu")),
    ("celu", 13, &[1003], |s| s.node("Celu", &["x"], "y", &[("alpha", Float(1.5))])),
    ("log", 13, &[1003], |s| unary(s, "Log")),
    ("softplus", 13, &[1003], |s| unary(s, "Softplus")),
    ("mish", 18, &[1003], |s| unary(s, "Mish")),
    ("softmax", 13, &[3, 45], |s| unary(s, "Softmax")),
    ("softmax of one", 13, &[45, 1], |s| unary(s, "Softmax")),
    ("softmax over channels", 13, &[2, 5, 33], |s| s.node("Softmax", &["x"], "y", &[("axis", Int(1))])),
    ("softmax, few apart", 13, &[2, 5, 3], |s| s.node("Softmax", &["x"], "y", &[("axis", Int(1))])),
    ("softmax, many apart", 13, &[7, 97], |s| s.node("Softmax", &["x"], "y", &[("axis", Int(0))])),
    ("logarithms of softmax", 13, &[3, 45], |s| unary(s, "LogSoftmax")),
    ("logarithms of softmax, apart", 13, &[2, 5, 33], |s| {
        s.node("LogSoftmax", &["x"], "y", &[("axis", Int(1))])
    }),
    ("sum of the last", 13, &[3, 5, 45], |s| reduction(s, "ReduceSum", &[-1], 1)),
    ("sum of the middle", 13, &[3, 5, 45], |s| reduction(s, "ReduceSum", &[1], 0)),
    ("sum of the first", 13, &[3, 5, 1], |s| reduction(s, "ReduceSum", &[0], 1)),
    ("sum of every other", 13, &[3, 2, 5, 4], |s| reduction(s, "ReduceSum", &[0, 2], 0)),
    ("sum of every other and the last", 13, &[3, 2, 5, 4], |s| reduction(s, "ReduceSum", &[-1, 1], 0)),
    ("sum of nothing", 13, &[3, 2], |s| {
        let axes = s.ints(&[]);
        s.node("ReduceSum", &["x", &axes], "y", &[("noop_with_empty_axes", Int(1))]);
    }),
    ("sum of one", 13, &[1], |s| reduction(s, "ReduceSum", &[0], 1)),
    ("mean of all", 18, &[3, 5, 7], |s| unary(s, "ReduceMean")),
    ("mean of two", 11, &[3, 5, 7, 2], |s| reduction(s, "ReduceMean", &[2, 3], 1)),
    ("sizes", 18, &[3, 5, 7], |s| reduction(s, "ReduceL1", &[0, 2], 1)),
    ("length", 18, &[3, 5, 7], |s| reduction(s, "ReduceL2", &[2], 1)),
    ("squares", 18, &[3, 5, 7], |s| reduction(s, "ReduceSumSquare", &[1], 1)),
    ("greatest of the last", 18, &[3, 5, 67], |s| reduction(s, "ReduceMax", &[2], 1)),
    ("greatest of two", 18, &[3, 5, 67], |s| reduction(s, "ReduceMax", &[0, 2], 0)),
    ("greatest of the first", 18, &[3, 5, 7], |s| reduction(s, "ReduceMax", &[0], 1)),
    ("least", 18, &[3, 5, 7], |s| reduction(s, "ReduceMin", &[1, 2], 1)),
    ("greatest of channels", 13, &[2, 3, 5, 7], |s| unary(s, "GlobalMaxPool")),
    ("means of channels", 13, &[2, 3, 5, 7], |s| unary(s, "GlobalAveragePool")),
    ("power 2", 13, &[37], |s| number(s, "Pow", 2.0)),
    ("power 3", 13, &[37], |s| number(s, "Pow", 3.0)),
    ("power 4", 13, &[37], |s| number(s, "Pow", 4.0)),
    ("power 0.5", 13, &[37], |s| number(s, "Pow", 0.5)),
    ("power -0.5", 13, &[37], |s| number(s, "Pow", -0.5)),
    ("power -1", 13, &[37], |s| number(s, "Pow", -1.0)),
    ("power -2", 13, &[37], |s| number(s, "Pow", -2.0)),
    ("power 1.7", 13, &[37], |s| number(s, "Pow", 1.7)),
    ("power -2.3", 13, &[37], |s| number(s, "Pow", -2.3)),
    ("power 65", 13, &[37], |s| number(s, "Pow", 65.0)),
    ("power 0", 13, &[37], |s| number(s, "Pow", 0.0)),
    ("power 1", 13, &[37], |s| number(s, "Pow", 1.0)),
    ("a whole power", 13, &[37], |s| {
        let two = s.ints(&[3]);
        s.node("Pow", &["x", &two], "y", &[]);
    }),
    ("computed powers", 13, &[37], |s| {
        s.node("Abs", &["x"], "size", &[]);
        s.node("Pow", &["size", "x"], "y", &[]);
    }),
    ("slopes by channel", 13, &[2, 3, 5, 7], |s| weights(s, "PRelu", &[&[3, 1, 1]], &[])),
    ("one slope", 13, &[3, 5], |s| weights(s, "PRelu", &[&[1]], &[])),
    ("slopes by element", 13, &[3, 5], |s| weights(s, "PRelu", &[&[5]], &[])),
    ("neighbours", 13, &[2, 7, 3, 5], |s| {
        s.node("LRN", &["x"], "y", &[("size", Int(3)), ("alpha", Float(0.5))])
    }),
    ("even neighbours", 13, &[1, 5, 3], |s| {
        s.node("LRN", &["x"], "y", &[("size", Int(4)), ("beta", Float(0.6))])
    }),
    ("more neighbours than channels", 13, &[1, 2, 3], |s| s.node("LRN", &["x"], "y", &[("size", Int(9))])),
    ("place of the greatest", 13, &[3, 5, 67], |s| place(s, "ArgMax", -1, 0)),
    ("last place of the greatest", 13, &[3, 67], |s| place(s, "ArgMax", 1, 1)),
    ("place of the least", 13, &[3, 5, 7], |s| place(s, "ArgMin", 1, 0)),
    ("last place of the least", 13, &[3, 5, 7], |s| place(s, "ArgMin", 0, 1)),
    ("place of channels", 13, &[2, 5, 33], |s| place(s, "ArgMax", 1, 0)),
    ("choice", 13, &[3, 5], |s| choice(s, &[3, 5], &[3, 5], false)),
    ("choice of a number", 13, &[3, 5], |s| choice(s, &[3, 5], &[], false)),
    ("choice of a column", 13, &[2, 3, 5], |s| choice(s, &[5], &[3, 1], true)),
    ("choice by a column", 13, &[3, 1], |s| choice(s, &[3, 1], &[3, 5], false)),
    ("choice between rows", 13, &[1, 5], |s| choice(s, &[1, 5], &[4, 1], true)),
    ("sum of three", 13, &[3, 1, 5], |s| {
        let column = s.drawn(&[4, 1], -1.0, 1.0);
        s.node("Sum", &["x", &column, "x"], "y", &[]);
    }),
    ("mean of two", 13, &[3, 5], |s| weights(s, "Mean", &[&[2, 1, 5]], &[])),
    ("sum of one operand", 13, &[3, 5], |s| unary(s, "Sum")),
    ("greatest of four", 13, &[3, 5], |s| weights(s, "Max", &[&[5], &[3, 1], &[]], &[])),
    ("least of three", 13, &[1, 5], |s| weights(s, "Min", &[&[3, 1], &[3, 5]], &[])),
    ("product with itself", 13, &[2, 3, 17, 9], |s| {
        s.node("Transpose", &["x"], "turned", &[("perm", crate::testing::Setting::Ints(&[0, 1, 3, 2]))]);
        s.node("MatMul", &["x", "turned"], "y", &[]);
    }),
    ("product of a row with itself", 13, &[1, 65], |s| {
        s.node("Gemm", &["x", "x"], "y", &[("transB", Int(1))]);
    }),
    ("outer product", 13, &[1, 65], |s| s.node("Gemm", &["x", "x"], "y", &[("transA", Int(1))])),
];

/// Numbers from -4 to 4, some of which are equal or special.
fn input(shape: &[usize], special: &[f32]) -> Vec<f32> {
    let count = shape.iter().product();
    let mut values: Vec<f32> =
        numbers(count as u64, count).iter().map(|value| (value * 32.0).round() as f32 / 8.0 + 1e-3).collect();
    let step = (count / special.len().max(1)).max(1);
    for (at, value) in special.iter().enumerate().filter(|(at, _)| at * step < count) {
        values[at * step] = *value;
    }
    values
}

/// What a program computes of `x` with and without vector instructions, and what the rules compute.
fn three((name, opset, shape, build): &Comparison, x: &[f32]) -> [Vec<f32>; 3] {
    let mut s = Sketch::new(*opset);
    s.input("x", shape);
    build(&mut s);
    let graph = Graph::new(s.model(&["y"])).unwrap_or_else(|error| panic!("{name}: {error}"));
    let tensor = Tensor::floats(shape, x.iter().map(|&x| f64::from(x)).collect());
    let expected = graph.evaluate(&[("x", &tensor)], &["y"]).unwrap().swap_remove(0);
    let mut program = Program::new(graph).unwrap_or_else(|error| panic!("{name}: {error}"));
    let mut run = || {
        let mut outputs = [Vec::new()];
        program.run(&[x.to_vec()], &mut outputs).unwrap();
        let [output] = outputs;
        output
    };
    let (found, portable) = (run(), portably(&mut run));
    assert_eq!(found.len(), expected.values.len(), "{name}");
    [found, portable, expected.values.iter().map(|&value| value as f32).collect()]
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|value| value.to_bits()).collect()
}

/// Both round to 32 bits what they compute in 64, in sums of another order: so the last bit differs sometimes. Sums of products in 32 bits are
/// compared with the largest.
#[test]
fn operators_compute_what_their_rules_say_with_and_without_vectors() {
    for comparison in COMPARISONS {
        let name = comparison.0;
        let [found, portable, expected] = three(comparison, &input(comparison.2, &[]));
        assert_eq!(bits(&found), bits(&portable), "{name}");
        let largest = expected.iter().fold(0.0f32, |largest, value| largest.max(value.abs()));
        let tolerance = |expected: f32| match name.contains("product") {
            true => 1e-6 * largest,
            // Below -6, `Gelu` by its rule loses digits.
            false => expected.abs() * f32::EPSILON + if name.starts_with("gelu") { 1e-14 } else { 0.0 },
        };
        for (at, (found, expected)) in found.iter().zip(&expected).enumerate() {
            let same = found == expected
                || found.is_nan() && expected.is_nan()
                || (found - expected).abs() <= tolerance(*expected);
            assert!(same, "{name} is {expected:e} at {at}, not {found:e}");
        }
    }
}

#[test]
fn operators_take_special_numbers_as_their_rules_do() {
    let special =
        [0.0, -0.0, f32::NAN, f32::INFINITY, f32::NEG_INFINITY, f32::MAX, f32::MIN_POSITIVE, -1e-40];
    let mut wrong = Vec::new();
    for comparison in COMPARISONS.iter().filter(|comparison| !comparison.0.contains("product")) {
        let name = comparison.0;
        for first in 0..special.len() {
            for count in [1, 2, 8] {
                let mut turned = special;
                turned.rotate_left(first);
                let [found, portable, expected] = three(comparison, &input(comparison.2, &turned[..count]));
                assert_eq!(bits(&found), bits(&portable), "{name}");
                for (at, (found, expected)) in found.iter().zip(&expected).enumerate() {
                    // Equal zeros have the same sign.
                    let same = match found == expected {
                        true => *expected != 0.0 || found.to_bits() == expected.to_bits(),
                        false => {
                            let tolerance = 2.0 * f32::EPSILON * expected.abs() + 1e-14;
                            found.is_nan() && expected.is_nan() || (found - expected).abs() <= tolerance
                        }
                    };
                    if !same {
                        let given = &turned[..count];
                        wrong.push(format!("{name} of {given:?} is {expected:e} at {at}, not {found:e}"));
                    }
                }
            }
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
}

#[test]
fn a_block_of_a_transformer_is_computed_as_the_rules_say() {
    for (name, build) in [
        ("block", (|s| speed::block(s, false, ["x", "y"])) as fn(&mut Sketch)),
        ("block in old operators", |s| speed::block(s, true, ["x", "y"])),
    ] {
        let comparison: Comparison = (name, 20, &[1, 197, 192], build);
        let x: Vec<f32> = numbers(3, 197 * 192).iter().map(|&x| x as f32).collect();
        let [found, portable, expected] = three(&comparison, &x);
        assert_eq!(bits(&found), bits(&portable), "{name}");
        let largest = expected.iter().fold(0.0f32, |largest, value| largest.max(value.abs()));
        let far = found.iter().zip(&expected).fold(0.0f32, |far, (a, b)| far.max((a - b).abs()));
        assert!(far <= 1e-6 * largest, "{name}: {far:e} of {largest}");
    }
}
