//! One small model for each way in which an operator can be used.

use std::ops::RangeInclusive;

use super::Setting::{Float, Int, Ints, Text};
use super::{Sketch, numbers};
use crate::graph::Graph;
use crate::proto::ModelProto;
use crate::tensor::Tensor;

/// A model with the input `x` and the output `target`, one number that depends on all that an operator computes.
pub struct Case {
    /// Operator and use.
    pub name: &'static str,
    /// The versions of the operator set that have it.
    pub opsets: RangeInclusive<i64>,
    /// The shape of the input.
    pub shape: &'static [usize],
    /// The range of the input's elements.
    pub range: (f64, f64),
    /// Adds the nodes from `x` to `y`.
    build: fn(&mut Sketch),
}

impl Case {
    /// The input.
    pub fn x(&self) -> Tensor {
        let (low, high) = self.range;
        let values = numbers(3, self.shape.iter().product()).into_iter();
        // As 32-bit floats, which is what a backend takes.
        let values = values.map(|v| f64::from((low + (high - low) * (v + 1.0) / 2.0) as f32));
        Tensor::floats(self.shape, values.collect())
    }

    /// The model for a version of the operator set.
    ///
    /// # Panics
    /// If the case is put together wrongly.
    pub fn model(&self, opset: i64) -> ModelProto {
        let mut sketch = Sketch::new(opset);
        sketch.input("x", self.shape);
        (self.build)(&mut sketch);
        weigh(sketch, self.name)
    }
}

/// Adds the sum of all elements of `y`, each with a weight of its own, as `target`.
pub(super) fn weigh(mut sketch: Sketch, name: &str) -> ModelProto {
    let graph = Graph::new(sketch.model(&["y"]));
    let count = match graph.and_then(|graph| graph.fact("y").cloned()) {
        Ok(fact) => fact.shape.iter().product::<usize>(),
        Err(error) => panic!("{name}: {error}"),
    };
    let shape = sketch.ints(&[1, count as i64]);
    let weights = sketch.drawn(&[count, 1], -1.0, 1.0);
    sketch.node("Reshape", &["y", &shape], "row", &[]);
    sketch.node("MatMul", &["row", &weights], "target", &[]);
    sketch.model(&["target"])
}

const ALL: RangeInclusive<i64> = 7..=25;
const IMAGE: &[usize] = &[1, 2, 5, 6];
const WIDE: (f64, f64) = (-4.0, 4.0);
const UNIT: (f64, f64) = (-1.0, 1.0);
const INSIDE: (f64, f64) = (-0.75, 0.75);
const POSITIVE: (f64, f64) = (0.5, 3.0);

const fn case(
    name: &'static str,
    opsets: RangeInclusive<i64>,
    shape: &'static [usize],
    range: (f64, f64),
    build: fn(&mut Sketch),
) -> Case {
    Case { name, opsets, shape, range, build }
}

fn conv(s: &mut Sketch, operator: &str, weights: &[usize], settings: &[(&str, super::Setting<'_>)]) {
    let filters = if operator == "Conv" { weights[0] } else { 2 * weights[1] / (2 / weights[0].min(2)) };
    let w = s.drawn(weights, -1.0, 1.0);
    let biased = operator == "Conv";
    match biased {
        true => {
            let bias = s.drawn(&[filters], -1.0, 1.0);
            s.node(operator, &["x", &w, &bias], "y", settings);
        }
        false => s.node(operator, &["x", &w], "y", settings),
    }
}

fn unary(s: &mut Sketch, operator: &str) {
    s.node(operator, &["x"], "y", &[]);
}

fn cumulated(s: &mut Sketch, axis: i64, exclusive: bool, reverse: bool) {
    let axis = s.weights("axis", Tensor { shape: Vec::new(), ..Tensor::ints(&[axis]) });
    let attributes = [("exclusive", Int(exclusive.into())), ("reverse", Int(reverse.into()))];
    s.node("CumSum", &["x", &axis], "y", &attributes);
}

/// `x` with weights on the right of an operator.
fn right(s: &mut Sketch, operator: &str, shape: &[usize], low: f64, high: f64) {
    let w = s.drawn(shape, low, high);
    s.node(operator, &["x", &w], "y", &[]);
}

/// `x` with weights on the left of an operator.
fn left(s: &mut Sketch, operator: &str, shape: &[usize], low: f64, high: f64) {
    let w = s.drawn(shape, low, high);
    s.node(operator, &[&w, "x"], "y", &[]);
}

/// An operator between `x` and something that is computed from it.
fn both(s: &mut Sketch, operator: &str) {
    s.node("Sigmoid", &["x"], "other", &[]);
    s.node(operator, &["x", "other"], "y", &[]);
}

/// An operator on `x`, weights, something that is computed from `x`, and `x` once more.
fn several(s: &mut Sketch, operator: &str) {
    let w = s.drawn(&[6], -1.0, 1.0);
    s.node("Tanh", &["x"], "other", &[]);
    s.node(operator, &["x", &w, "other", "x"], "y", &[]);
}

/// A reduction over two axes, or over one that is dropped. The axes are an attribute before version 18.
fn reduction(s: &mut Sketch, operator: &str, axes: &[i64], keeps: bool) {
    s.with_ints(18, operator, "x", "y", ("axes", axes), &[("keepdims", Int(i64::from(keeps)))]);
}

fn gemm(
    s: &mut Sketch,
    on_right: bool,
    settings: &[(&str, super::Setting<'_>)],
    shape: &[usize],
    sum: &[usize],
) {
    let w = s.drawn(shape, -1.0, 1.0);
    let c = s.drawn(sum, -1.0, 1.0);
    let inputs = if on_right { [&*w, "x", &*c] } else { ["x", &*w, &*c] };
    s.node("Gemm", &inputs, "y", settings);
}

fn pool(s: &mut Sketch, operator: &str, settings: &[(&str, super::Setting<'_>)]) {
    s.node(operator, &["x"], "y", settings);
}

fn slice(s: &mut Sketch, starts: &[i64], ends: &[i64], axes: &[i64], steps: &[i64]) {
    if s.opset() >= 10 {
        let (starts, ends, axes, steps) = (s.ints(starts), s.ints(ends), s.ints(axes), s.ints(steps));
        return s.node("Slice", &["x", &starts, &ends, &axes, &steps], "y", &[]);
    }
    s.node("Slice", &["x"], "y", &[("starts", Ints(starts)), ("ends", Ints(ends)), ("axes", Ints(axes))]);
}

fn gather(s: &mut Sketch, axis: i64, shape: &[usize], indices: &[i64]) {
    let tensor = Tensor { shape: shape.to_vec(), ..Tensor::ints(indices) };
    let indices = s.weights("indices", tensor);
    s.node("Gather", &["x", &indices], "y", &[("axis", Int(axis))]);
}

fn resize(s: &mut Sketch, scales: &[f64], sizes: &[i64], settings: &[(&str, super::Setting<'_>)]) {
    let roi = s.weights("roi", Tensor::floats(&[0], Vec::new()));
    let scale = s.weights("scales", Tensor::floats(&[scales.len()], scales.to_vec()));
    if sizes.is_empty() {
        return s.node("Resize", &["x", &roi, &scale], "y", settings);
    }
    let sizes = s.ints(sizes);
    let scale = if s.opset() >= 13 { "" } else { &scale };
    s.node("Resize", &["x", if s.opset() >= 13 { "" } else { &roi }, scale, &sizes], "y", settings);
}

fn reshape(s: &mut Sketch, shape: &[i64]) {
    let shape = s.ints(shape);
    s.node("Reshape", &["x", &shape], "y", &[]);
}

fn normalization(s: &mut Sketch, operator: &str, shape: &[usize], settings: &[(&str, super::Setting<'_>)]) {
    let (scale, bias) = (s.drawn(shape, 0.5, 2.0), s.drawn(shape, -1.0, 1.0));
    if operator == "BatchNormalization" {
        let (mean, variance) = (s.drawn(shape, -1.0, 1.0), s.drawn(shape, 0.5, 2.0));
        return s.node(operator, &["x", &scale, &bias, &mean, &variance], "y", settings);
    }
    s.node(operator, &["x", &scale, &bias], "y", settings);
}

fn condition(s: &mut Sketch) {
    let zero = s.weights("zero", Tensor::floats(&[], vec![0.1]));
    s.node("Greater", &["x", &zero], "holds", &[]);
}

fn split(s: &mut Sketch, since_lengths: Option<&[i64]>, axis: i64, used: &[&str]) {
    match since_lengths {
        Some(lengths) if s.opset() >= 13 => {
            let lengths = s.ints(lengths);
            s.split("Split", &["x", &lengths], &["a", "b"], &[("axis", Int(axis))]);
        }
        Some(lengths) => {
            s.split("Split", &["x"], &["a", "b"], &[("axis", Int(axis)), ("split", Ints(lengths))])
        }
        None if s.opset() >= 18 => {
            s.split("Split", &["x"], &["a", "b"], &[("axis", Int(axis)), ("num_outputs", Int(2))])
        }
        None => s.split("Split", &["x"], &["a", "b"], &[("axis", Int(axis))]),
    }
    match used {
        [one] => s.node("Tanh", &[one], "y", &[]),
        _ => {
            s.node("Tanh", &["b"], "curved", &[]);
            s.node("Concat", &["curved", "a"], "y", &[("axis", Int(axis))]);
        }
    }
}

fn clip(s: &mut Sketch, low: Option<f64>, high: Option<f64>) {
    if s.opset() < 11 {
        let low = low.map(|low| ("min", Float(low as f32)));
        let high = high.map(|high| ("max", Float(high as f32)));
        return s.node("Clip", &["x"], "y", &low.into_iter().chain(high).collect::<Vec<_>>());
    }
    let mut bound = |name: &str, bound: Option<f64>| {
        bound.map_or(String::new(), |bound| s.weights(name, Tensor::floats(&[], vec![bound])))
    };
    let (low, high) = (bound("low", low), bound("high", high));
    s.node("Clip", &["x", &low, &high], "y", &[]);
}

fn tile(s: &mut Sketch, repeats: &[i64]) {
    let repeats = s.ints(repeats);
    s.node("Tile", &["x", &repeats], "y", &[]);
}

fn upsample(s: &mut Sketch, mode: &str) {
    if s.opset() < 9 {
        let scales = crate::proto::AttributeProto {
            name: "scales".into(),
            floats: vec![1.0, 1.0, 2.0, 3.0],
            r#type: 6,
            ..Default::default()
        };
        s.node("Upsample", &["x"], "y", &[("mode", Text(mode))]);
        return s.push_attribute(scales);
    }
    let scales = s.weights("scales", Tensor::floats(&[4], vec![1.0, 1.0, 2.0, 3.0]));
    s.node(if s.opset() < 10 { "Upsample" } else { "Resize" }, &["x", &scales], "y", &[("mode", Text(mode))]);
}

fn pad(s: &mut Sketch, pads: &[i64], mode: &str) {
    s.with_ints(11, "Pad", "x", "y", ("pads", pads), &[("mode", Text(mode))]);
}

fn computed_shape(s: &mut Sketch, operator: &str) {
    // What exporters write for `view(size(0), -1)`.
    s.node("Shape", &["x"], "shape", &[]);
    let first = s.weights("first", Tensor { shape: Vec::new(), ..Tensor::ints(&[0]) });
    s.node("Gather", &["shape", &first], "batch", &[("axis", Int(0))]);
    s.with_ints(13, "Unsqueeze", "batch", "batch_1", ("axes", &[0]), &[]);
    let rest = s.ints(if operator == "Expand" { &[4, 2, 5, 6] } else { &[-1] });
    s.node("Concat", &["batch_1", &rest], "asked", &[("axis", Int(0))]);
    s.node(operator, &["x", "asked"], "y", &[]);
}

/// All cases.
pub const CASES: &[Case] = &[
    case("conv", ALL, IMAGE, UNIT, |s| conv(s, "Conv", &[3, 2, 3, 2], &[])),
    case("conv/groups", ALL, IMAGE, UNIT, |s| conv(s, "Conv", &[4, 1, 2, 2], &[("group", Int(2))])),
    case("conv/strides", ALL, IMAGE, UNIT, |s| {
        conv(s, "Conv", &[3, 2, 2, 3], &[("strides", Ints(&[2, 3])), ("pads", Ints(&[1, 0, 0, 2]))])
    }),
    case("conv/dilations", ALL, IMAGE, UNIT, |s| {
        conv(s, "Conv", &[3, 2, 2, 2], &[("dilations", Ints(&[3, 2])), ("pads", Ints(&[2, 1, 2, 1]))])
    }),
    case("conv/same", ALL, IMAGE, UNIT, |s| {
        conv(s, "Conv", &[3, 2, 3, 3], &[("auto_pad", Text("SAME_UPPER")), ("strides", Ints(&[2, 2]))])
    }),
    case("conv/one_axis", ALL, &[1, 2, 7], UNIT, |s| conv(s, "Conv", &[3, 2, 3], &[("strides", Ints(&[2]))])),
    case("conv/three_axes", ALL, &[1, 2, 3, 4, 3], UNIT, |s| conv(s, "Conv", &[2, 2, 2, 2, 2], &[])),
    case("conv_transpose", ALL, &[1, 2, 3, 4], UNIT, |s| conv(s, "ConvTranspose", &[2, 3, 3, 2], &[])),
    case("conv_transpose/groups", ALL, &[1, 4, 3, 4], UNIT, |s| {
        conv(s, "ConvTranspose", &[4, 2, 2, 2], &[("group", Int(2))])
    }),
    case("conv_transpose/strides", ALL, &[1, 2, 3, 4], UNIT, |s| {
        conv(
            s,
            "ConvTranspose",
            &[2, 3, 3, 2],
            &[("strides", Ints(&[2, 3])), ("pads", Ints(&[1, 0, 1, 1])), ("output_padding", Ints(&[1, 1]))],
        );
    }),
    case("conv_transpose/output_shape", ALL, &[1, 2, 3, 4], UNIT, |s| {
        conv(
            s,
            "ConvTranspose",
            &[2, 3, 3, 3],
            &[("strides", Ints(&[2, 2])), ("output_shape", Ints(&[6, 8]))],
        );
    }),
    case("gemm", ALL, &[2, 3], UNIT, |s| gemm(s, false, &[], &[3, 4], &[4])),
    case("gemm/a", ALL, &[3, 2], UNIT, |s| {
        gemm(s, false, &[("transA", Int(1)), ("alpha", Float(0.5))], &[3, 4], &[4])
    }),
    case("gemm/b", ALL, &[2, 3], UNIT, |s| gemm(s, false, &[("transB", Int(1))], &[4, 3], &[4])),
    case("gemm/both", ALL, &[3, 2], UNIT, |s| {
        gemm(s, false, &[("transA", Int(1)), ("transB", Int(1))], &[4, 3], &[4])
    }),
    case("gemm/right", ALL, &[3, 4], UNIT, |s| gemm(s, true, &[], &[2, 3], &[4])),
    case("gemm/right_a", ALL, &[3, 4], UNIT, |s| gemm(s, true, &[("transA", Int(1))], &[3, 2], &[4])),
    case("gemm/right_b", ALL, &[4, 3], UNIT, |s| gemm(s, true, &[("transB", Int(1))], &[2, 3], &[4])),
    case("gemm/right_both", ALL, &[4, 3], UNIT, |s| {
        gemm(s, true, &[("transA", Int(1)), ("transB", Int(1))], &[3, 2], &[4])
    }),
    case("gemm/sum", ALL, &[1, 4], UNIT, |s| {
        let (a, b) = (s.drawn(&[2, 3], -1.0, 1.0), s.drawn(&[3, 4], -1.0, 1.0));
        s.node("Gemm", &[&a, &b, "x"], "y", &[("beta", Float(0.5))]);
    }),
    case("matmul", ALL, &[2, 3], UNIT, |s| right(s, "MatMul", &[3, 4], -1.0, 1.0)),
    case("matmul/right", ALL, &[3, 4], UNIT, |s| left(s, "MatMul", &[2, 3], -1.0, 1.0)),
    case("matmul/stacks", ALL, &[2, 1, 2, 3], UNIT, |s| right(s, "MatMul", &[2, 3, 4], -1.0, 1.0)),
    case("matmul/stacks_right", ALL, &[3, 4], UNIT, |s| left(s, "MatMul", &[2, 2, 3], -1.0, 1.0)),
    case("matmul/vector", ALL, &[3], UNIT, |s| right(s, "MatMul", &[2, 3, 4], -1.0, 1.0)),
    case("matmul/vector_right", ALL, &[3], UNIT, |s| left(s, "MatMul", &[2, 2, 3], -1.0, 1.0)),
    case("matmul/both", ALL, &[2, 3, 3], UNIT, |s| both(s, "MatMul")),
    case("add", ALL, IMAGE, UNIT, |s| right(s, "Add", &[2, 1, 1], -1.0, 1.0)),
    case("add/right", ALL, &[5, 1], UNIT, |s| left(s, "Add", &[2, 1, 3], -1.0, 1.0)),
    case("add/both", ALL, IMAGE, UNIT, |s| both(s, "Add")),
    case("add/scalar", ALL, IMAGE, UNIT, |s| right(s, "Add", &[], -1.0, 1.0)),
    case("add/scalar_right", ALL, &[1], UNIT, |s| left(s, "Add", &[2, 3], -1.0, 1.0)),
    case("sub", ALL, IMAGE, UNIT, |s| right(s, "Sub", &[2, 1, 1], -1.0, 1.0)),
    case("sub/right", ALL, &[5, 1], UNIT, |s| left(s, "Sub", &[2, 1, 3], -1.0, 1.0)),
    case("sub/both", ALL, IMAGE, UNIT, |s| both(s, "Sub")),
    case("sub/scalar", ALL, IMAGE, UNIT, |s| right(s, "Sub", &[], -1.0, 1.0)),
    case("sub/scalar_right", ALL, &[1], UNIT, |s| left(s, "Sub", &[2, 3], -1.0, 1.0)),
    case("mul", ALL, IMAGE, UNIT, |s| right(s, "Mul", &[2, 1, 1], -1.0, 1.0)),
    case("mul/right", ALL, &[5, 1], UNIT, |s| left(s, "Mul", &[2, 1, 3], -1.0, 1.0)),
    case("mul/both", ALL, IMAGE, UNIT, |s| both(s, "Mul")),
    case("mul/scalar", ALL, IMAGE, UNIT, |s| right(s, "Mul", &[], -1.0, 1.0)),
    case("mul/scalar_right", ALL, &[1], UNIT, |s| left(s, "Mul", &[2, 3], -1.0, 1.0)),
    case("div", ALL, IMAGE, UNIT, |s| right(s, "Div", &[2, 1, 1], 0.5, 2.0)),
    case("div/right", ALL, &[5, 1], POSITIVE, |s| left(s, "Div", &[2, 1, 3], 0.5, 2.0)),
    case("div/both", ALL, IMAGE, UNIT, |s| both(s, "Div")),
    case("div/scalar", ALL, IMAGE, UNIT, |s| right(s, "Div", &[], 0.5, 2.0)),
    case("div/scalar_right", ALL, &[1], POSITIVE, |s| left(s, "Div", &[2, 3], 0.5, 2.0)),
    case("pow", ALL, IMAGE, POSITIVE, |s| right(s, "Pow", &[2, 1, 1], 0.5, 3.0)),
    case("pow/right", ALL, &[5, 1], POSITIVE, |s| left(s, "Pow", &[2, 1, 3], 0.5, 2.0)),
    case("pow/both", ALL, IMAGE, POSITIVE, |s| both(s, "Pow")),
    case("pow/scalar", ALL, IMAGE, WIDE, |s| {
        let two = s.weights("two", Tensor::floats(&[], vec![2.0]));
        s.node("Pow", &["x", &two], "y", &[]);
    }),
    case("pow/scalar_right", ALL, &[1], POSITIVE, |s| left(s, "Pow", &[2, 3], 0.5, 2.0)),
    case("sum", 8..=25, IMAGE, UNIT, |s| several(s, "Sum")),
    case("max", 8..=25, IMAGE, UNIT, |s| right(s, "Max", &[2, 1, 1], -1.0, 1.0)),
    case("max/several", 8..=25, IMAGE, UNIT, |s| several(s, "Max")),
    case("max/same", ALL, IMAGE, UNIT, |s| s.node("Max", &["x", "x"], "y", &[])),
    case("min", 8..=25, IMAGE, UNIT, |s| right(s, "Min", &[2, 1, 1], -1.0, 1.0)),
    case("min/several", 8..=25, IMAGE, UNIT, |s| several(s, "Min")),
    case("min/same", ALL, IMAGE, UNIT, |s| s.node("Min", &["x", "x"], "y", &[])),
    case("mean", 8..=25, IMAGE, UNIT, |s| several(s, "Mean")),
    case("sqrt", ALL, IMAGE, POSITIVE, |s| unary(s, "Sqrt")),
    case("neg", ALL, IMAGE, UNIT, |s| unary(s, "Neg")),
    case("abs", ALL, IMAGE, UNIT, |s| unary(s, "Abs")),
    case("exp", ALL, IMAGE, UNIT, |s| unary(s, "Exp")),
    case("log", ALL, IMAGE, POSITIVE, |s| unary(s, "Log")),
    case("tanh", ALL, IMAGE, UNIT, |s| unary(s, "Tanh")),
    case("sigmoid", ALL, IMAGE, WIDE, |s| unary(s, "Sigmoid")),
    case("erf", 9..=25, IMAGE, UNIT, |s| unary(s, "Erf")),
    case("reciprocal", ALL, IMAGE, POSITIVE, |s| unary(s, "Reciprocal")),
    case("sin", ALL, IMAGE, WIDE, |s| unary(s, "Sin")),
    case("cos", ALL, IMAGE, WIDE, |s| unary(s, "Cos")),
    case("tan", ALL, IMAGE, UNIT, |s| unary(s, "Tan")),
    case("asin", ALL, IMAGE, INSIDE, |s| unary(s, "Asin")),
    case("acos", ALL, IMAGE, INSIDE, |s| unary(s, "Acos")),
    case("atan", ALL, IMAGE, WIDE, |s| unary(s, "Atan")),
    case("sinh", 9..=25, IMAGE, UNIT, |s| unary(s, "Sinh")),
    case("cosh", 9..=25, IMAGE, UNIT, |s| unary(s, "Cosh")),
    case("asinh", 9..=25, IMAGE, WIDE, |s| unary(s, "Asinh")),
    case("acosh", 9..=25, IMAGE, (1.25, 4.0), |s| unary(s, "Acosh")),
    case("atanh", 9..=25, IMAGE, INSIDE, |s| unary(s, "Atanh")),
    case("relu", ALL, IMAGE, UNIT, |s| unary(s, "Relu")),
    case("leaky_relu", ALL, IMAGE, UNIT, |s| s.node("LeakyRelu", &["x"], "y", &[("alpha", Float(0.25))])),
    case("elu", ALL, IMAGE, UNIT, |s| s.node("Elu", &["x"], "y", &[("alpha", Float(0.75))])),
    case("hard_sigmoid", ALL, IMAGE, WIDE, |s| s.node("HardSigmoid", &["x"], "y", &[("alpha", Float(0.25))])),
    case("hard_swish", 14..=25, IMAGE, WIDE, |s| unary(s, "HardSwish")),
    case("softplus", ALL, IMAGE, WIDE, |s| unary(s, "Softplus")),
    case("clip", ALL, IMAGE, UNIT, |s| clip(s, Some(-0.5), Some(0.25))),
    case("clip/low", ALL, IMAGE, UNIT, |s| clip(s, Some(-0.5), None)),
    case("clip/high", ALL, IMAGE, UNIT, |s| clip(s, None, Some(0.25))),
    case("clip/none", ALL, IMAGE, UNIT, |s| unary(s, "Clip")),
    case("prelu", ALL, IMAGE, UNIT, |s| right(s, "PRelu", &[1], 0.1, 0.9)),
    case("prelu/channels", ALL, IMAGE, UNIT, |s| right(s, "PRelu", &[2, 1, 1], 0.1, 0.9)),
    case("prelu/slope", ALL, &[2, 1, 1], UNIT, |s| left(s, "PRelu", &[2, 5, 6], -1.0, 1.0)),
    case("selu", ALL, IMAGE, UNIT, |s| s.node("Selu", &["x"], "y", &[("gamma", Float(1.25))])),
    case("celu", 12..=25, IMAGE, UNIT, |s| s.node("Celu", &["x"], "y", &[("alpha", Float(0.75))])),
    case("thresholded_relu", 10..=25, IMAGE, UNIT, |s| {
        s.node("ThresholdedRelu", &["x"], "y", &[("alpha", Float(0.25))])
    }),
    case("shrink", 9..=25, IMAGE, UNIT, |s| {
        s.node("Shrink", &["x"], "y", &[("lambd", Float(0.25)), ("bias", Float(0.125))])
    }),
    case("mish", 18..=25, IMAGE, WIDE, |s| unary(s, "Mish")),
    case("softsign", ALL, IMAGE, WIDE, |s| unary(s, "Softsign")),
    case("gelu", 20..=25, IMAGE, WIDE, |s| unary(s, "Gelu")),
    case("gelu/tanh", 20..=25, IMAGE, WIDE, |s| {
        s.node("Gelu", &["x"], "y", &[("approximate", Text("tanh"))])
    }),
    case("max_pool", ALL, IMAGE, UNIT, |s| {
        pool(s, "MaxPool", &[("kernel_shape", Ints(&[2, 2])), ("strides", Ints(&[2, 2]))])
    }),
    case("max_pool/overlap", ALL, IMAGE, UNIT, |s| pool(s, "MaxPool", &[("kernel_shape", Ints(&[3, 2]))])),
    case("max_pool/pads", ALL, IMAGE, (-3.0, -1.0), |s| {
        pool(
            s,
            "MaxPool",
            &[("kernel_shape", Ints(&[3, 3])), ("strides", Ints(&[2, 2])), ("pads", Ints(&[1, 1, 1, 1]))],
        )
    }),
    case("max_pool/ceil", 10..=25, IMAGE, UNIT, |s| {
        pool(
            s,
            "MaxPool",
            &[("kernel_shape", Ints(&[2, 2])), ("strides", Ints(&[2, 4])), ("ceil_mode", Int(1))],
        )
    }),
    case("max_pool/one_axis", ALL, &[1, 2, 7], UNIT, |s| {
        pool(s, "MaxPool", &[("kernel_shape", Ints(&[3])), ("strides", Ints(&[2]))])
    }),
    case("max_pool/dilations", 10..=25, IMAGE, UNIT, |s| {
        pool(s, "MaxPool", &[("kernel_shape", Ints(&[2, 2])), ("dilations", Ints(&[2, 3]))])
    }),
    case("average_pool", ALL, IMAGE, UNIT, |s| {
        pool(s, "AveragePool", &[("kernel_shape", Ints(&[2, 2])), ("strides", Ints(&[2, 2]))])
    }),
    case("average_pool/overlap", ALL, IMAGE, UNIT, |s| {
        pool(s, "AveragePool", &[("kernel_shape", Ints(&[3, 2]))])
    }),
    case("average_pool/pads", ALL, IMAGE, UNIT, |s| {
        pool(
            s,
            "AveragePool",
            &[("kernel_shape", Ints(&[3, 3])), ("strides", Ints(&[2, 2])), ("pads", Ints(&[1, 1, 1, 1]))],
        )
    }),
    case("average_pool/counted", ALL, IMAGE, UNIT, |s| {
        pool(
            s,
            "AveragePool",
            &[
                ("kernel_shape", Ints(&[3, 3])),
                ("strides", Ints(&[2, 2])),
                ("pads", Ints(&[1, 1, 1, 1])),
                ("count_include_pad", Int(1)),
            ],
        );
    }),
    case("average_pool/ceil", 10..=25, IMAGE, UNIT, |s| {
        pool(
            s,
            "AveragePool",
            &[("kernel_shape", Ints(&[2, 2])), ("strides", Ints(&[2, 4])), ("ceil_mode", Int(1))],
        )
    }),
    case("global_average_pool", ALL, IMAGE, UNIT, |s| unary(s, "GlobalAveragePool")),
    case("global_max_pool", ALL, IMAGE, UNIT, |s| unary(s, "GlobalMaxPool")),
    case("where", 9..=25, IMAGE, UNIT, |s| {
        condition(s);
        let w = s.drawn(&[6], -1.0, 1.0);
        s.node("Where", &["holds", "x", &w], "y", &[]);
    }),
    case("where/no", 9..=25, IMAGE, UNIT, |s| {
        condition(s);
        let w = s.drawn(&[6], -1.0, 1.0);
        s.node("Where", &["holds", &w, "x"], "y", &[]);
    }),
    case("where/condition", 9..=25, IMAGE, UNIT, |s| {
        condition(s);
        s.node("Exp", &["x"], "e", &[]);
        s.node("Where", &["holds", "x", "e"], "y", &[]);
    }),
    case("where/broadcast", 9..=25, &[3, 1], UNIT, |s| {
        condition(s);
        let w = s.drawn(&[2, 1, 4], -1.0, 1.0);
        s.node("Where", &["holds", "x", &w], "y", &[]);
    }),
    case("expand", 8..=25, &[2, 1, 3], UNIT, |s| {
        let shape = s.ints(&[2, 4, 3]);
        s.node("Expand", &["x", &shape], "y", &[]);
    }),
    case("expand/rank", 8..=25, &[1, 3], UNIT, |s| {
        let shape = s.ints(&[2, 4, 1]);
        s.node("Expand", &["x", &shape], "y", &[]);
    }),
    case("expand/computed", 8..=25, &[1, 1, 5, 6], UNIT, |s| {
        let shape = s.ints(&[2]);
        s.node("Shape", &["x"], "shape", &[]);
        s.node("Concat", &[&shape, "shape"], "asked", &[("axis", Int(0))]);
        s.node("Expand", &["x", "asked"], "y", &[]);
    }),
    case("concat", ALL, IMAGE, UNIT, |s| {
        let w = s.drawn(&[1, 3, 5, 6], -1.0, 1.0);
        s.node("Concat", &["x", &w], "y", &[("axis", Int(1))]);
    }),
    case("concat/front", ALL, IMAGE, UNIT, |s| {
        let w = s.drawn(&[1, 2, 5, 2], -1.0, 1.0);
        s.node("Concat", &[&w, "x"], "y", &[("axis", Int(3))]);
    }),
    case("concat/twice", ALL, IMAGE, UNIT, |s| {
        s.node("Tanh", &["x"], "t", &[]);
        s.node("Concat", &["x", "t", "x"], "y", &[("axis", Int(2))]);
    }),
    case("split", ALL, IMAGE, UNIT, |s| split(s, None, 1, &["a", "b"])),
    case("split/lengths", ALL, IMAGE, UNIT, |s| split(s, Some(&[2, 4]), 3, &["a", "b"])),
    case("split/one_used", ALL, IMAGE, UNIT, |s| split(s, Some(&[2, 3]), 2, &["b"])),
    case("gather", ALL, IMAGE, UNIT, |s| gather(s, 3, &[3], &[5, 0, 2])),
    case("gather/repeated", ALL, IMAGE, UNIT, |s| gather(s, 2, &[4], &[1, 1, 3, 1])),
    case("gather/one", ALL, IMAGE, UNIT, |s| gather(s, 2, &[], &[3])),
    case("gather/matrix", ALL, IMAGE, UNIT, |s| gather(s, 3, &[2, 2], &[4, 0, 0, 1])),
    case("gather/negative", 11..=25, IMAGE, UNIT, |s| gather(s, 3, &[2], &[-1, 0])),
    case("slice", ALL, IMAGE, UNIT, |s| slice(s, &[1], &[4], &[3], &[1])),
    case("slice/open", ALL, IMAGE, UNIT, |s| slice(s, &[-3], &[i64::MAX], &[2], &[1])),
    case("slice/steps", 10..=25, IMAGE, UNIT, |s| slice(s, &[1], &[6], &[3], &[2])),
    case("slice/backwards", 10..=25, IMAGE, UNIT, |s| slice(s, &[-1], &[i64::MIN], &[3], &[-2])),
    case("slice/several", ALL, IMAGE, UNIT, |s| slice(s, &[1, 0], &[4, 3], &[2, 3], &[1, 1])),
    case("pad", ALL, IMAGE, UNIT, |s| pad(s, &[0, 1, 2, 0, 0, 0, 1, 3], "constant")),
    case("pad/negative", ALL, IMAGE, UNIT, |s| pad(s, &[0, 0, -1, 2, 0, 0, 1, -2], "constant")),
    case("pad/edge", ALL, IMAGE, UNIT, |s| pad(s, &[0, 0, 2, 0, 0, 0, 1, 3], "edge")),
    case("pad/reflect", ALL, IMAGE, UNIT, |s| pad(s, &[0, 0, 2, 1, 0, 0, 1, 3], "reflect")),
    case("pad/axes", 18..=25, IMAGE, UNIT, |s| {
        let (pads, axes) = (s.ints(&[1, 2]), s.ints(&[-1]));
        s.node("Pad", &["x", &pads, "", &axes], "y", &[]);
    }),
    case("reduce_sum", ALL, IMAGE, UNIT, |s| unary(s, "ReduceSum")),
    case("reduce_sum/axes", ALL, IMAGE, UNIT, |s| {
        s.with_ints(13, "ReduceSum", "x", "y", ("axes", &[1, 3]), &[])
    }),
    case("reduce_sum/dropped", ALL, IMAGE, UNIT, |s| {
        s.with_ints(13, "ReduceSum", "x", "y", ("axes", &[2]), &[("keepdims", Int(0))])
    }),
    case("reduce_sum/last", 11..=25, IMAGE, UNIT, |s| {
        s.with_ints(13, "ReduceSum", "x", "y", ("axes", &[-1]), &[])
    }),
    case("reduce_mean", ALL, IMAGE, UNIT, |s| unary(s, "ReduceMean")),
    case("reduce_mean/axes", ALL, IMAGE, UNIT, |s| {
        s.with_ints(18, "ReduceMean", "x", "y", ("axes", &[1, 3]), &[])
    }),
    case("reduce_mean/dropped", ALL, IMAGE, UNIT, |s| {
        s.with_ints(18, "ReduceMean", "x", "y", ("axes", &[2]), &[("keepdims", Int(0))])
    }),
    case("reduce_mean/last", 11..=25, IMAGE, UNIT, |s| {
        s.with_ints(18, "ReduceMean", "x", "y", ("axes", &[-1]), &[])
    }),
    case("reduce_max", ALL, IMAGE, UNIT, |s| unary(s, "ReduceMax")),
    case("reduce_max/axes", ALL, IMAGE, UNIT, |s| {
        s.with_ints(18, "ReduceMax", "x", "y", ("axes", &[1, 3]), &[])
    }),
    case("reduce_max/dropped", ALL, IMAGE, UNIT, |s| {
        s.with_ints(18, "ReduceMax", "x", "y", ("axes", &[2]), &[("keepdims", Int(0))])
    }),
    case("reduce_max/last", 11..=25, IMAGE, UNIT, |s| {
        s.with_ints(18, "ReduceMax", "x", "y", ("axes", &[-1]), &[])
    }),
    case("reduce_min", ALL, IMAGE, UNIT, |s| unary(s, "ReduceMin")),
    case("reduce_min/axes", ALL, IMAGE, UNIT, |s| {
        s.with_ints(18, "ReduceMin", "x", "y", ("axes", &[1, 3]), &[])
    }),
    case("reduce_min/dropped", ALL, IMAGE, UNIT, |s| {
        s.with_ints(18, "ReduceMin", "x", "y", ("axes", &[2]), &[("keepdims", Int(0))])
    }),
    case("reduce_min/last", 11..=25, IMAGE, UNIT, |s| {
        s.with_ints(18, "ReduceMin", "x", "y", ("axes", &[-1]), &[])
    }),
    case("reduce_l1", ALL, IMAGE, UNIT, |s| unary(s, "ReduceL1")),
    case("reduce_l1/axes", ALL, IMAGE, UNIT, |s| reduction(s, "ReduceL1", &[1, 3], true)),
    case("reduce_l1/dropped", ALL, IMAGE, UNIT, |s| reduction(s, "ReduceL1", &[2], false)),
    case("reduce_l2", ALL, IMAGE, UNIT, |s| unary(s, "ReduceL2")),
    case("reduce_l2/axes", ALL, IMAGE, UNIT, |s| reduction(s, "ReduceL2", &[1, 3], true)),
    case("reduce_l2/dropped", ALL, IMAGE, UNIT, |s| reduction(s, "ReduceL2", &[2], false)),
    case("reduce_log_sum", ALL, IMAGE, POSITIVE, |s| unary(s, "ReduceLogSum")),
    case("reduce_log_sum/axes", ALL, IMAGE, POSITIVE, |s| reduction(s, "ReduceLogSum", &[1, 3], true)),
    case("reduce_log_sum/dropped", ALL, IMAGE, POSITIVE, |s| reduction(s, "ReduceLogSum", &[2], false)),
    case("reduce_log_sum_exp", ALL, IMAGE, UNIT, |s| unary(s, "ReduceLogSumExp")),
    case("reduce_log_sum_exp/axes", ALL, IMAGE, UNIT, |s| reduction(s, "ReduceLogSumExp", &[1, 3], true)),
    case("reduce_log_sum_exp/dropped", ALL, IMAGE, UNIT, |s| reduction(s, "ReduceLogSumExp", &[2], false)),
    case("reduce_sum_square", ALL, IMAGE, UNIT, |s| unary(s, "ReduceSumSquare")),
    case("reduce_sum_square/axes", ALL, IMAGE, UNIT, |s| reduction(s, "ReduceSumSquare", &[1, 3], true)),
    case("reduce_sum_square/dropped", ALL, IMAGE, UNIT, |s| reduction(s, "ReduceSumSquare", &[2], false)),
    case("softmax", ALL, IMAGE, UNIT, |s| unary(s, "Softmax")),
    case("softmax/axis", 13..=25, IMAGE, UNIT, |s| s.node("Softmax", &["x"], "y", &[("axis", Int(1))])),
    case("softmax/old", 7..=12, IMAGE, UNIT, |s| s.node("Softmax", &["x"], "y", &[("axis", Int(2))])),
    case("log_softmax", ALL, IMAGE, UNIT, |s| s.node("LogSoftmax", &["x"], "y", &[("axis", Int(3))])),
    case("batch_normalization", ALL, IMAGE, UNIT, |s| normalization(s, "BatchNormalization", &[2], &[])),
    case("layer_normalization", 17..=25, IMAGE, UNIT, |s| normalization(s, "LayerNormalization", &[6], &[])),
    case("layer_normalization/axes", 17..=25, IMAGE, UNIT, |s| {
        normalization(s, "LayerNormalization", &[5, 6], &[("axis", Int(2)), ("epsilon", Float(0.01))])
    }),
    case("layer_normalization/broadcast", 17..=25, IMAGE, UNIT, |s| {
        let (scale, bias) = (s.drawn(&[6], 0.5, 2.0), s.drawn(&[2, 1, 1], -1.0, 1.0));
        s.node("LayerNormalization", &["x", &scale, &bias], "y", &[("axis", Int(1))]);
    }),
    case("instance_normalization", ALL, IMAGE, UNIT, |s| {
        normalization(s, "InstanceNormalization", &[2], &[])
    }),
    case("resize", 11..=25, IMAGE, UNIT, |s| {
        resize(
            s,
            &[1.0, 1.0, 2.0, 3.0],
            &[],
            &[("coordinate_transformation_mode", Text("asymmetric")), ("nearest_mode", Text("floor"))],
        )
    }),
    case("resize/linear", 11..=25, IMAGE, UNIT, |s| {
        resize(s, &[1.0, 1.0, 2.0, 1.5], &[], &[("mode", Text("linear"))])
    }),
    case("resize/cubic", 11..=25, IMAGE, UNIT, |s| {
        resize(s, &[1.0, 1.0, 2.0, 2.0], &[], &[("mode", Text("cubic"))])
    }),
    case("resize/sizes", 11..=25, IMAGE, UNIT, |s| {
        resize(
            s,
            &[],
            &[1, 2, 7, 9],
            &[("mode", Text("linear")), ("coordinate_transformation_mode", Text("pytorch_half_pixel"))],
        )
    }),
    case("resize/corners", 11..=25, IMAGE, UNIT, |s| {
        resize(
            s,
            &[],
            &[1, 2, 8, 3],
            &[("mode", Text("linear")), ("coordinate_transformation_mode", Text("align_corners"))],
        )
    }),
    case("resize/ten", 10..=10, IMAGE, UNIT, |s| upsample(s, "linear")),
    case("upsample", 9..=10, IMAGE, UNIT, |s| upsample(s, "nearest")),
    case("upsample/seven", 7..=8, IMAGE, UNIT, |s| upsample(s, "nearest")),
    case("identity", ALL, IMAGE, UNIT, |s| unary(s, "Identity")),
    case("dropout", ALL, IMAGE, UNIT, |s| unary(s, "Dropout")),
    case("cast", 9..=25, IMAGE, UNIT, |s| {
        s.node("Cast", &["x"], "d", &[("to", Int(11))]);
        s.node("Exp", &["d"], "e", &[]);
        s.node("Cast", &["e"], "y", &[("to", Int(1))]);
    }),
    case("cast/like", 15..=25, IMAGE, UNIT, |s| {
        s.node("Cast", &["x"], "d", &[("to", Int(11))]);
        s.node("Exp", &["d"], "e", &[]);
        s.node("CastLike", &["e", "x"], "y", &[]);
    }),
    case("reshape", ALL, IMAGE, UNIT, |s| reshape(s, &[3, -1])),
    case("reshape/copied", ALL, IMAGE, UNIT, |s| reshape(s, &[0, 0, 30])),
    case("reshape/computed", ALL, IMAGE, UNIT, |s| computed_shape(s, "Reshape")),
    case("reshape/range", 11..=25, &[6], UNIT, |s| {
        let number = |s: &mut Sketch, name: &str, value| {
            s.weights(name, Tensor { shape: Vec::new(), ..Tensor::ints(&[value]) })
        };
        let (start, limit, delta) = (number(s, "start", 2), number(s, "limit", 4), number(s, "delta", 1));
        s.node("Range", &[&start, &limit, &delta], "shape", &[]);
        s.node("Reshape", &["x", "shape"], "y", &[]);
    }),
    case("flatten", ALL, IMAGE, UNIT, |s| unary(s, "Flatten")),
    case("flatten/axis", ALL, IMAGE, UNIT, |s| s.node("Flatten", &["x"], "y", &[("axis", Int(3))])),
    case("squeeze", ALL, &[1, 3, 1, 2], UNIT, |s| s.with_ints(13, "Squeeze", "x", "y", ("axes", &[2]), &[])),
    case("squeeze/all", ALL, &[1, 3, 1, 2], UNIT, |s| unary(s, "Squeeze")),
    case("unsqueeze", ALL, &[3, 2], UNIT, |s| s.with_ints(13, "Unsqueeze", "x", "y", ("axes", &[0, 2]), &[])),
    case("transpose", ALL, IMAGE, UNIT, |s| {
        s.node("Transpose", &["x"], "y", &[("perm", Ints(&[0, 2, 3, 1]))])
    }),
    case("transpose/reversed", ALL, &[2, 3, 4], UNIT, |s| unary(s, "Transpose")),
    case("depth_to_space", ALL, &[1, 8, 2, 3], UNIT, |s| {
        s.node("DepthToSpace", &["x"], "y", &[("blocksize", Int(2))])
    }),
    case("depth_to_space/crd", 11..=25, &[1, 8, 2, 3], UNIT, |s| {
        s.node("DepthToSpace", &["x"], "y", &[("blocksize", Int(2)), ("mode", Text("CRD"))])
    }),
    case("space_to_depth", ALL, &[1, 2, 4, 6], UNIT, |s| {
        s.node("SpaceToDepth", &["x"], "y", &[("blocksize", Int(2))])
    }),
    case("tile", ALL, &[2, 1, 3], UNIT, |s| tile(s, &[1, 4, 2])),
    case("tile/one_axis", ALL, &[5], UNIT, |s| tile(s, &[3])),
    case("cum_sum", 11..=25, &[2, 3, 4], UNIT, |s| cumulated(s, 1, false, false)),
    case("cum_sum/exclusive", 11..=25, &[2, 3, 4], UNIT, |s| cumulated(s, -1, true, false)),
    case("cum_sum/reverse", 11..=25, &[2, 3, 4], UNIT, |s| cumulated(s, 0, false, true)),
    case("cum_sum/both", 11..=25, &[2, 3, 4], UNIT, |s| cumulated(s, 1, true, true)),
    case("trilu", 14..=25, &[2, 3, 4], UNIT, |s| unary(s, "Trilu")),
    case("trilu/lower", 14..=25, &[3, 4], UNIT, |s| {
        let k = s.weights("k", Tensor { shape: Vec::new(), ..Tensor::ints(&[1]) });
        s.node("Trilu", &["x", &k], "y", &[("upper", Int(0))]);
    }),
];
