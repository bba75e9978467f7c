//! Models of which no gradient can be built: each is a sentence.

use prost::Message;

use super::Setting::{Int, Ints, Text};
use super::Sketch;
use super::damaged::damage;
use crate::gradient::{Target, gradients, without_gradient};
use crate::graph::Graph;
use crate::model;
use crate::proto::{AttributeProto, GraphProto, ModelProto, ValueInfoProto};
use crate::tensor::{Element, Tensor};

fn refusal(model: ModelProto, of: &str) -> String {
    let built =
        Graph::new(model).and_then(|graph| gradients(&graph, Target { value: "y", index: 0 }, &[of], &[]));
    built.err().expect("it is refused").to_string()
}

/// A model whose input `x` is an image.
pub(super) fn sketch(opset: i64, build: impl Fn(&mut Sketch)) -> ModelProto {
    let mut sketch = Sketch::new(opset);
    sketch.input("x", &[1, 1, 4, 4]);
    build(&mut sketch);
    sketch.model(&["y"])
}

#[test]
fn each_reason_is_named() {
    let relu = |s: &mut Sketch| s.node("Relu", &["x"], "y", &[]);
    assert_eq!(
        refusal(sketch(6, relu), "x"),
        "it is written for version 6 of the operator set, but gradients are known for 7 to 25; export it for one of these"
    );
    assert!(refusal(sketch(26, relu), "x").starts_with("it is written for version 26"));
    assert_eq!(refusal(sketch(13, relu), "z"), "there is no value `z`");
    assert_eq!(
        refusal(sketch(13, |s| s.node("Floor", &["x"], "y", &[])), "x"),
        "`y` does not change with `x`: its gradient is zero everywhere"
    );
    let unknown = sketch(16, |s| {
        let grid = s.drawn(&[1, 3, 3, 2], -1.0, 1.0);
        s.node("GridSample", &["x", &grid], "y", &[]);
    });
    assert_eq!(refusal(unknown, "x"), "these operators have no gradient here: GridSample");
    assert_eq!(
        refusal(sketch(13, |s| s.node("Relu", &["q"], "y", &[])), "x"),
        "node `relu_0` (Relu) needs `q`, which nothing before it computes"
    );
    assert_eq!(
        refusal(
            sketch(13, |s| {
                let w = s.drawn(&[3, 3], -1.0, 1.0);
                s.node("MatMul", &["x", &w], "y", &[]);
            }),
            "x"
        ),
        "node `matmul_0` (MatMul): its matrices (1, 1, 4, 4) and (3, 3) do not go together"
    );
    let weights = |s: &mut Sketch| {
        let w = s.drawn(&[1, 1, 2, 2], -1.0, 1.0);
        s.node("Conv", &[&w, "x"], "y", &[]);
    };
    assert!(refusal(sketch(13, weights), "x").contains("its window of 4 is larger than its input of 2"));
    assert!(
        refusal(sketch(14, |s| s.node("Dropout", &["x", "", "training"], "y", &[])), "x")
            .contains("needs `training`")
    );
    let half = sketch(13, |s| {
        s.node("Cast", &["x"], "h", &[("to", Int(10))]);
        s.node("Relu", &["h"], "r", &[]);
        s.node("Cast", &["r"], "y", &[("to", Int(1))]);
    });
    let error = refusal(half, "x");
    assert!(
        error.contains("is FLOAT16, but gradients need FLOAT (32 bit) or DOUBLE; export the model in 32 bit"),
        "{error}"
    );
}

#[test]
fn operators_without_a_gradient_are_listed_where_shapes_are_declared() {
    let mut model = sketch(16, |s| {
        s.node("Bernoulli", &["x"], "c", &[]);
        s.node("RandomNormalLike", &["c"], "m", &[]);
        s.node("RandomNormalLike", &["m"], "y", &[]);
    });
    let graph = model.graph.as_mut().unwrap();
    graph.value_info = ["c", "m", "y"].map(|name| ValueInfoProto::tensor(name, 1, &[1, 1, 4, 4])).into();
    assert_eq!(
        refusal(model.clone(), "x"),
        "these operators have no gradient here: Bernoulli, RandomNormalLike"
    );
    let graph = Graph::new(model).unwrap();
    assert_eq!(without_gradient(&graph, "y", "m"), ["RandomNormalLike"]);
    assert!(
        gradients(&graph, Target { value: "y", index: 16 }, &["y"], &[])
            .err()
            .unwrap()
            .to_string()
            .contains("16 numbers")
    );
    assert!(gradients(&graph, Target { value: "y", index: 3 }, &["y"], &[]).is_ok());
}

#[test]
fn a_value_that_the_body_of_an_if_uses_passes_through_the_if() {
    let body =
        GraphProto { output: vec![ValueInfoProto::tensor("r", 1, &[1, 1, 4, 4])], ..Default::default() };
    let mut model = sketch(16, |s| {
        s.node("Relu", &["x"], "r", &[]);
        let condition = s.weights("condition", Tensor { element: Element::BOOL, ..Tensor::ints(&[1]) });
        s.node("If", &[&condition], "branch", &[]);
        let body = Some(body.encode_to_vec());
        s.push_attribute(AttributeProto { name: "then_branch".into(), g: body, ..Default::default() });
        s.node("Add", &["r", "branch"], "y", &[]);
    });
    let declared = ["branch", "y"].map(|name| ValueInfoProto::tensor(name, 1, &[1, 1, 4, 4]));
    model.graph.as_mut().unwrap().value_info = declared.into();
    assert_eq!(refusal(model.clone(), "x"), "these operators have no gradient here: If");
    assert_eq!(without_gradient(&Graph::new(model).unwrap(), "y", "x"), ["If"]);
}

#[test]
fn operators_that_only_compute_shapes_need_no_gradient() {
    let model = sketch(13, |s| {
        s.node("Shape", &["x"], "shape", &[]);
        s.node("Cast", &["shape"], "floats", &[("to", Int(1))]);
        s.node("ReduceProd", &["floats"], "count", &[("keepdims", Int(0))]);
        s.node("Div", &["x", "count"], "y", &[]);
    });
    let graph = Graph::new(model).unwrap();
    assert_eq!(without_gradient(&graph, "y", "x"), [""; 0]);
    let built = gradients(&graph, Target { value: "y", index: 0 }, &["x"], &[]).unwrap();
    let x = Tensor::floats(&[1, 1, 4, 4], vec![1.0; 16]);
    let gradient = Graph::new(built.model).unwrap().evaluate(&[("x", &x)], &[&built.outputs[0]]).unwrap();
    assert_eq!(gradient[0].values[..2], [1.0 / 16.0, 0.0]);
    // Neither does what is rounded on its way.
    let graph = Graph::new(sketch(13, |s| {
        s.node("ReduceProd", &["x"], "p", &[]);
        s.node("Floor", &["p"], "f", &[]);
        s.node("Add", &["x", "f"], "y", &[]);
    }));
    assert_eq!(without_gradient(&graph.unwrap(), "y", "x"), [""; 0]);
}

#[test]
fn open_shapes_and_damaged_files_are_refused() {
    let mut model = sketch(13, |s| s.node("Relu", &["x"], "y", &[]));
    let whole = model.encode_to_vec();
    for length in 0..whole.len() {
        // A cut may leave a smaller model that is whole in itself; it never panics.
        let _ = model::decode(&whole[..length]).and_then(Graph::new);
    }
    assert!(model::decode(&whole[..whole.len() / 2]).is_err());
    damage(&model, &[0x55], |graph| {
        let _ = gradients(&graph, Target { value: "y", index: 0 }, &["x"], &[]);
    });
    let dims = &mut model.graph.as_mut().unwrap().input[0]
        .r#type
        .as_mut()
        .unwrap()
        .tensor_type
        .as_mut()
        .unwrap()
        .shape
        .as_mut()
        .unwrap()
        .dim;
    dims[2].dim_value = None;
    dims[2].dim_param = Some("height".into());
    let error = Graph::new(model).err().unwrap().to_string();
    assert!(
        error.starts_with(
            "its input `x` has the shape (1, 1, height, 4), in which more than the batch is open"
        ),
        "{error}"
    );
}

#[test]
fn batch_normalization_for_training_is_refused() {
    let model = |opset: i64, outputs: &[&str], mode: i64| {
        sketch(opset, |s| {
            let w = s.drawn(&[1], 0.5, 1.0);
            s.split("BatchNormalization", &["x", &w, &w, &w, &w], outputs, &[("training_mode", Int(mode))]);
        })
    };
    for model in [model(15, &["y"], 1), model(9, &["y", "mean"], 0)] {
        let error = refusal(model, "x");
        assert!(error.ends_with("it is set to training; export the model for inference"), "{error}");
    }
    for (opset, outputs) in [(15, &["y"][..]), (9, &["y", ""])] {
        assert!(Graph::new(model(opset, outputs, 0)).unwrap().fact("y").is_ok());
    }
}

#[test]
fn tensors_that_would_be_huge_are_refused() {
    let model = sketch(13, |s| {
        let shape = s.ints(&[1 << 20, 1 << 20, 4, 4]);
        s.node("Expand", &["x", &shape], "y", &[]);
    });
    assert!(refusal(model, "x").ends_with("is too large"));
    let model = sketch(13, |s| {
        let pads = s.ints(&[0, 0, 0, 0, 0, 0, i64::MAX, i64::MAX]);
        s.node("Pad", &["x", &pads], "y", &[]);
    });
    assert!(refusal(model, "x").contains("do not fit an axis of the length 4"));
    let model = sketch(13, |s| {
        let w = s.drawn(&[1, 1, 2, 2], -1.0, 1.0);
        s.node("Conv", &["x", &w], "y", &[("pads", Ints(&[i64::MAX, 0, i64::MAX, 0]))]);
    });
    assert!(refusal(model, "x").ends_with("but can be 1073741824 at most"));
}

#[test]
fn nothing_is_repeated_along_an_empty_axis() {
    for mode in ["edge", "reflect", "wrap"] {
        let model = sketch(19, |s| {
            let (empty, pads) = (s.drawn(&[0], -1.0, 1.0), s.ints(&[1, 1]));
            s.node("Pad", &[&empty, &pads], "y", &[("mode", Text(mode))]);
        });
        let error = Graph::new(model).unwrap().fact("y").unwrap_err().to_string();
        assert!(error.contains("has nothing to repeat along an axis of the length 0"), "{error}");
    }
}

#[test]
fn negative_pads_cut_and_have_a_gradient() {
    let model = sketch(13, |s| {
        let pads = s.ints(&[0, 0, -1, -1, 0, 0, -1, 0]);
        s.node("Pad", &["x", &pads], "y", &[]);
    });
    let graph = Graph::new(model).unwrap();
    assert_eq!(graph.fact("y").unwrap().shape, [1, 1, 2, 3]);
    let built = gradients(&graph, Target { value: "y", index: 0 }, &["x"], &[]).unwrap();
    let operators: Vec<_> =
        built.model.graph.iter().flat_map(|graph| &graph.node).map(|node| node.op_type.as_str()).collect();
    // The gradient has no negative pads, which not every backend takes.
    assert_eq!(operators, ["Pad", "Pad", "Identity"]);
    let x = Tensor::floats(&[1, 1, 4, 4], (0..16).map(f64::from).collect());
    let gradient = Graph::new(built.model).unwrap().evaluate(&[("x", &x)], &[&built.outputs[0]]).unwrap();
    let ones: Vec<_> = gradient[0]
        .values
        .iter()
        .enumerate()
        .filter(|(_, value)| **value == 1.0)
        .map(|(place, _)| place)
        .collect();
    assert_eq!(ones, [5]);
}
