//! Models with each byte damaged in turn: an error or another model, and never a panic.

use prost::Message;

use super::Setting::{Float, Int, Ints, Text};
use super::refusals::sketch;
use super::{Setting, Sketch};
use crate::graph::Graph;
use crate::model;
use crate::proto::ModelProto;
use crate::tensor::{Element, Tensor};

/// An input of floats if it has one list, and of whole numbers in the shape of the first if it has two.
type Given<'a> = (&'a [usize], &'a [i64]);

const FLOATS: &[i64] = &[];

/// A model of one operator whose inputs are constants.
fn of_constants(opset: i64, operator: &str, given: &[Given<'_>], settings: &[(&str, Setting<'_>)]) -> Sketch {
    let mut s = Sketch::new(opset);
    let names: Vec<String> = given
        .iter()
        .enumerate()
        .map(|(place, &(shape, ints))| match ints {
            [] => s.drawn(shape, -1.0, 1.0),
            ints => s.weights(&format!("i{place}"), Tensor { shape: shape.to_vec(), ..Tensor::ints(ints) }),
        })
        .collect();
    let names: Vec<&str> = names.iter().map(String::as_str).collect();
    s.node(operator, &names, "y", settings);
    s
}

/// A model for each operator that moves elements.
fn of_movements() -> Vec<Sketch> {
    let image: Given<'_> = (&[1, 4, 2, 2], FLOATS);
    let matrix: Given<'_> = (&[2, 3], FLOATS);
    vec![
        of_constants(13, "DepthToSpace", &[image], &[("blocksize", Int(2)), ("mode", Text("CRD"))]),
        of_constants(13, "SpaceToDepth", &[image], &[("blocksize", Int(2))]),
        of_constants(13, "Tile", &[matrix, (&[2], &[2, 1])], &[]),
        of_constants(14, "Trilu", &[matrix, (&[], &[1])], &[("upper", Int(0))]),
        of_constants(9, "EyeLike", &[matrix], &[("k", Int(1)), ("dtype", Int(7))]),
        of_constants(11, "OneHot", &[(&[2], &[0, 2]), (&[], &[3]), (&[2], FLOATS)], &[("axis", Int(1))]),
        of_constants(14, "CumSum", &[matrix, (&[], &[1])], &[("reverse", Int(1))]),
        of_constants(10, "ReverseSequence", &[matrix, (&[3], &[1, 2, 0])], &[("batch_axis", Int(1))]),
        of_constants(13, "Gather", &[matrix, (&[2], &[2, -1])], &[("axis", Int(1))]),
        of_constants(13, "GatherElements", &[matrix, (&[1, 2], &[1, -1])], &[("axis", Int(1))]),
        of_constants(13, "GatherND", &[matrix, (&[2, 1], &[1, -1])], &[("batch_dims", Int(1))]),
        of_constants(
            18,
            "ScatterElements",
            &[matrix, (&[1, 2], &[1, -1]), (&[1, 2], FLOATS)],
            &[("axis", Int(1)), ("reduction", Text("mul"))],
        ),
        of_constants(18, "ScatterND", &[matrix, (&[1, 1], &[1]), (&[1, 3], FLOATS)], &[]),
        of_constants(13, "ArgMax", &[matrix], &[("axis", Int(1)), ("keepdims", Int(0))]),
        of_constants(11, "TopK", &[matrix, (&[1], &[2])], &[("axis", Int(1)), ("largest", Int(0))]),
        of_constants(11, "Compress", &[matrix, (&[2], &[1, 0])], &[("axis", Int(1))]),
        of_constants(13, "NonZero", &[matrix], &[]),
        of_constants(
            11,
            "NonMaxSuppression",
            &[(&[1, 3, 4], FLOATS), (&[1, 1, 3], FLOATS), (&[1], &[2])],
            &[],
        ),
        of_constants(12, "Einsum", &[matrix, (&[3, 2], FLOATS)], &[("equation", Text("ij,jk->ki"))]),
        of_constants(20, "GridSample", &[image, (&[1, 2, 2, 2], FLOATS)], &[("mode", Text("cubic"))]),
        of_constants(20, "AffineGrid", &[(&[1, 2, 3], FLOATS), (&[4], &[1, 1, 2, 2])], &[]),
        of_constants(
            16,
            "RoiAlign",
            &[image, (&[1, 4], FLOATS), (&[1], &[0])],
            &[("output_height", Int(2)), ("sampling_ratio", Int(2)), ("spatial_scale", Float(2.0))],
        ),
        of_constants(
            11,
            "MaxUnpool",
            &[(&[1, 1, 1, 2], FLOATS), (&[1, 1, 1, 2], &[1, 4]), (&[4], &[1, 1, 3, 4])],
            &[("kernel_shape", Ints(&[2, 2])), ("strides", Ints(&[1, 2]))],
        ),
        of_constants(
            18,
            "Col2Im",
            &[(&[1, 4, 4], FLOATS), (&[2], &[3, 3]), (&[2], &[2, 2])],
            &[("strides", Ints(&[1, 1])), ("pads", Ints(&[0, 0, 0, 0]))],
        ),
        of_constants(18, "CenterCropPad", &[matrix, (&[2], &[3, 2])], &[("axes", Ints(&[0, 1]))]),
    ]
}

/// A model for each family of operators that compute with integers or sequences. The input is an image.
fn of_integers_and_sequences() -> Vec<ModelProto> {
    let bytes = |s: &mut Sketch, name: &str, shape: &[usize]| {
        s.weights(name, Tensor::filled(Element::UINT8, shape, 3.0).unwrap())
    };
    let quantized = |s: &mut Sketch| {
        let scale = s.drawn(&[4], 0.1, 1.0);
        let zero = bytes(s, "zero", &[4]);
        s.node("QuantizeLinear", &["x", &scale, &zero], "q", &[("axis", Int(2))]);
    };
    vec![
        sketch(21, |s| {
            quantized(s);
            s.node("DequantizeLinear", &["q", "w0", "zero"], "y", &[("axis", Int(-1))]);
        }),
        sketch(13, |s| {
            s.split("DynamicQuantizeLinear", &["x"], &["q", "scale", "zero"], &[]);
            let w = bytes(s, "w", &[2, 1, 2, 2]);
            s.node("ConvInteger", &["q", &w, "zero"], "y", &[("pads", Ints(&[1, 1, 0, 0]))]);
        }),
        sketch(13, |s| {
            quantized(s);
            let (one, zero, w) = (s.drawn(&[], 0.1, 1.0), bytes(s, "z", &[]), bytes(s, "w", &[2, 1, 2, 2]));
            let all = ["q", &one, &zero, &w, &one, &zero, &one, &zero];
            s.node("QLinearConv", &all, "c", &[]);
            let w = bytes(s, "m", &[3, 2]);
            s.node("QLinearMatMul", &["c", &one, &zero, &w, &one, &zero, &one, &zero], "p", &[]);
            let w = bytes(s, "n", &[2, 3]);
            s.node("MatMulInteger", &["p", &w], "y", &[]);
        }),
        sketch(14, |s| {
            let three = s.ints(&[1, 4, 4]);
            s.node("Reshape", &["x", &three], "r", &[]);
            let (w, r) = (s.drawn(&[1, 8, 4], -1.0, 1.0), s.drawn(&[1, 8, 2], -1.0, 1.0));
            let (b, lengths) = (s.drawn(&[1, 16], -1.0, 1.0), s.ints(&[1, 1, 0, 1]));
            let (h, p) = (s.drawn(&[1, 4, 2], -1.0, 1.0), s.drawn(&[1, 6], -1.0, 1.0));
            let settings = [("hidden_size", Int(2)), ("direction", Text("reverse"))];
            s.split("LSTM", &["r", &w, &r, &b, &lengths, &h, &h, &p], &["", "", "y"], &settings);
        }),
    ]
}

/// Reads a model again and again, with one byte after the other changed by each mask, and uses what is a graph.
pub(super) fn damage(model: &ModelProto, masks: &[u8], used: impl Fn(Graph)) {
    let whole = model.encode_to_vec();
    for place in 0..whole.len() {
        for mask in masks {
            let mut damaged = whole.clone();
            damaged[place] ^= mask;
            let _ = model::decode(&damaged).and_then(Graph::new).map(&used);
        }
    }
}

#[test]
fn damaged_models_of_movements_are_errors_or_other_models() {
    for sketch in of_movements() {
        let model = sketch.model(&["y"]);
        let graph = Graph::new(model.clone()).unwrap();
        graph.fact("y").unwrap();
        assert!(graph.constant("y").unwrap().is_some(), "{:?}", graph.nodes());
        damage(&model, &[0x01, 0x55, 0x80, 0xff], drop);
    }
}

#[test]
fn damaged_models_of_integers_and_sequences_are_errors_or_other_models() {
    let x = Tensor::floats(&[1, 1, 4, 4], (0..16).map(f64::from).collect());
    let computed = |graph: Graph| graph.evaluate(&[("x", &x)], &["y"]);
    for model in of_integers_and_sequences() {
        assert_eq!(Graph::new(model.clone()).and_then(computed).map(|values| values.len()), Ok(1));
        damage(&model, &[0x01, 0x02, 0x55, 0x80], |graph| drop(computed(graph)));
    }
}
