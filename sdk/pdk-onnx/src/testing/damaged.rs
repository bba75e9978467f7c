//! Models of operators that move elements, with each byte damaged in turn: an error or another model, and never a panic.

use prost::Message;

use super::Setting::{Float, Int, Ints, Text};
use super::{Setting, Sketch};
use crate::graph::Graph;
use crate::model;
use crate::tensor::Tensor;

/// An input of floats if it has one list, and of whole numbers in the shape of the first if it has two.
type Given<'a> = (&'a [usize], &'a [i64]);

const FLOATS: &[i64] = &[];

fn sketch(opset: i64, operator: &str, given: &[Given<'_>], settings: &[(&str, Setting<'_>)]) -> Sketch {
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

fn sketches() -> Vec<Sketch> {
    let image: Given<'_> = (&[1, 4, 2, 2], FLOATS);
    let matrix: Given<'_> = (&[2, 3], FLOATS);
    vec![
        sketch(13, "DepthToSpace", &[image], &[("blocksize", Int(2)), ("mode", Text("CRD"))]),
        sketch(13, "SpaceToDepth", &[image], &[("blocksize", Int(2))]),
        sketch(13, "Tile", &[matrix, (&[2], &[2, 1])], &[]),
        sketch(14, "Trilu", &[matrix, (&[], &[1])], &[("upper", Int(0))]),
        sketch(9, "EyeLike", &[matrix], &[("k", Int(1)), ("dtype", Int(7))]),
        sketch(11, "OneHot", &[(&[2], &[0, 2]), (&[], &[3]), (&[2], FLOATS)], &[("axis", Int(1))]),
        sketch(14, "CumSum", &[matrix, (&[], &[1])], &[("reverse", Int(1))]),
        sketch(10, "ReverseSequence", &[matrix, (&[3], &[1, 2, 0])], &[("batch_axis", Int(1))]),
        sketch(13, "Gather", &[matrix, (&[2], &[2, -1])], &[("axis", Int(1))]),
        sketch(13, "GatherElements", &[matrix, (&[1, 2], &[1, -1])], &[("axis", Int(1))]),
        sketch(13, "GatherND", &[matrix, (&[2, 1], &[1, -1])], &[("batch_dims", Int(1))]),
        sketch(
            18,
            "ScatterElements",
            &[matrix, (&[1, 2], &[1, -1]), (&[1, 2], FLOATS)],
            &[("axis", Int(1)), ("reduction", Text("mul"))],
        ),
        sketch(18, "ScatterND", &[matrix, (&[1, 1], &[1]), (&[1, 3], FLOATS)], &[]),
        sketch(13, "ArgMax", &[matrix], &[("axis", Int(1)), ("keepdims", Int(0))]),
        sketch(11, "TopK", &[matrix, (&[1], &[2])], &[("axis", Int(1)), ("largest", Int(0))]),
        sketch(11, "Compress", &[matrix, (&[2], &[1, 0])], &[("axis", Int(1))]),
        sketch(13, "NonZero", &[matrix], &[]),
        sketch(11, "NonMaxSuppression", &[(&[1, 3, 4], FLOATS), (&[1, 1, 3], FLOATS), (&[1], &[2])], &[]),
        sketch(12, "Einsum", &[matrix, (&[3, 2], FLOATS)], &[("equation", Text("ij,jk->ki"))]),
        sketch(20, "GridSample", &[image, (&[1, 2, 2, 2], FLOATS)], &[("mode", Text("cubic"))]),
        sketch(20, "AffineGrid", &[(&[1, 2, 3], FLOATS), (&[4], &[1, 1, 2, 2])], &[]),
        sketch(
            16,
            "RoiAlign",
            &[image, (&[1, 4], FLOATS), (&[1], &[0])],
            &[("output_height", Int(2)), ("sampling_ratio", Int(2)), ("spatial_scale", Float(2.0))],
        ),
        sketch(
            11,
            "MaxUnpool",
            &[(&[1, 1, 1, 2], FLOATS), (&[1, 1, 1, 2], &[1, 4]), (&[4], &[1, 1, 3, 4])],
            &[("kernel_shape", Ints(&[2, 2])), ("strides", Ints(&[1, 2]))],
        ),
        sketch(
            18,
            "Col2Im",
            &[(&[1, 4, 4], FLOATS), (&[2], &[3, 3]), (&[2], &[2, 2])],
            &[("strides", Ints(&[1, 1])), ("pads", Ints(&[0, 0, 0, 0]))],
        ),
        sketch(18, "CenterCropPad", &[matrix, (&[2], &[3, 2])], &[("axes", Ints(&[0, 1]))]),
    ]
}

#[test]
fn damaged_models_are_errors_or_other_models() {
    for sketch in sketches() {
        let model = sketch.model(&["y"]);
        let graph = Graph::new(model.clone()).unwrap();
        graph.fact("y").unwrap();
        assert!(graph.constant("y").unwrap().is_some(), "{:?}", graph.nodes());
        let whole = model.encode_to_vec();
        for place in 0..whole.len() {
            for mask in [0x01, 0x55, 0x80, 0xff] {
                let mut damaged = whole.clone();
                damaged[place] ^= mask;
                let _ = model::decode(&damaged).and_then(Graph::new);
            }
        }
    }
}
