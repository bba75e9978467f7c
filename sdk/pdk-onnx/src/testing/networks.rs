//! Gradients of whole networks: those that come with pdk, and a real one if it is at hand.

use std::path::{Path, PathBuf};

use super::{both_gradients, differences, numbers, relative_error};
use crate::gradient::{Target, gradients};
use crate::graph::Graph;
use crate::layers::{self, Image};
use crate::model;
use crate::tensor::Tensor;

const IMAGE: Image<'static> = Image { input: "image", height: 2, width: 3 };

/// The files of the networks.
fn networks() -> Vec<PathBuf> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut networks: Vec<_> =
        ["dave2", "dave2_augmented"].map(|name| root.join(format!("scripts/models/{name}.onnx"))).into();
    let data = std::env::var_os("PDK_TEST_DATA").map_or_else(|| root.join("../shared"), PathBuf::from);
    let pilot = data.join("data/tub_pilot.onnx");
    match pilot.is_file() {
        true => networks.push(pilot),
        false => println!("skipped for the pilot of a real car: there is no `{}`", pilot.display()),
    }
    networks
}

fn open(path: &Path) -> (Graph, Vec<(String, Tensor)>) {
    let graph = Graph::new(model::read(path).unwrap()).unwrap();
    let inputs = graph.inputs().map(|name| {
        let shape = graph.fact(name).unwrap().shape.clone();
        let count = shape.iter().product();
        let values = match name {
            // A soft pattern with noise, like a picture.
            "image" => numbers(5, count)
                .iter()
                .enumerate()
                .map(|(i, v)| 120.0 + 60.0 * libm::sin(i as f64 / 37.0) + 20.0 * v)
                .collect(),
            _ => vec![8.0; count],
        };
        (name.to_owned(), Tensor::floats(&shape, values))
    });
    let inputs = inputs.collect();
    (graph, inputs)
}

fn steering(graph: &Graph) -> Target<'_> {
    Target { value: &graph.outputs()[0], index: 0 }
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn gradients_of_networks_are_those_that_central_differences_show() {
    for path in networks() {
        let (graph, inputs) = open(&path);
        let given: Vec<(&str, &Tensor)> =
            inputs.iter().map(|(name, tensor)| (name.as_str(), tensor)).collect();
        let layers = layers::layers(&graph, IMAGE, steering(&graph).value);
        let layer = layers::find(&layers, "").unwrap();
        assert_eq!(layers.iter().filter(|layer| layer.is_convolution()).count(), 5);
        for (value, count) in [(layer.value.as_str(), 150), ("image", 12)] {
            let built = gradients(&graph, steering(&graph), &[value], &[]).unwrap();
            let derived = Graph::new(built.model).unwrap();
            let exact = derived.evaluate(&given, &[&built.outputs[0]]).unwrap().swap_remove(0);
            let base = graph.evaluate(&given, &[value]).unwrap().swap_remove(0);
            let stride = base.values.len() / count;
            let places: Vec<_> = (0..count).map(|place| place * stride + place % stride).collect();
            let moved = |moved: &Tensor| {
                let mut given = given.clone();
                given.retain(|(name, _)| *name != value);
                given.push((value, moved));
                Ok(graph.evaluate(&given, &[steering(&graph).value])?[0].values[0])
            };
            // The steering hardly changes with one pixel of 0 to 255, so that a larger step rounds less.
            let step = if value == "image" { 1e-4 } else { 1e-6 };
            let differences = differences(&base, places.iter().copied(), step, moved).unwrap();
            let exact: Vec<_> = places.iter().map(|&place| exact.values[place]).collect();
            let error = relative_error(&exact, &differences);
            println!("{} `{value}`: relative error {error:.1e}", path.file_name().unwrap().to_string_lossy());
            assert!(
                error < 1e-4 && exact.iter().any(|&value| value != 0.0),
                "{}: {value}: {error:e}",
                path.display()
            );
        }
    }
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn activations_times_gradients_are_the_same_before_and_behind_a_relu() {
    for path in networks() {
        let (graph, inputs) = open(&path);
        let given: Vec<(&str, &Tensor)> =
            inputs.iter().map(|(name, tensor)| (name.as_str(), tensor)).collect();
        let layers = layers::layers(&graph, IMAGE, steering(&graph).value);
        for layer in layers.iter().filter(|layer| layer.is_convolution()) {
            assert_ne!(layer.value, layer.activated);
            let maps = [&layer.value, &layer.activated].map(|value| {
                let built = gradients(&graph, steering(&graph), &[value], &[value]).unwrap();
                let derived = Graph::new(built.model).unwrap();
                let results = derived.evaluate(&given, &[&built.outputs[0], &built.outputs[1]]).unwrap();
                results[0].values.iter().zip(&results[1].values).map(|(a, g)| a * g).collect::<Vec<_>>()
            });
            assert!(relative_error(&maps[0], &maps[1]) < 1e-12, "{} {}", path.display(), layer.name);
        }
    }
}

#[test]
fn the_gradient_of_a_small_network_is_the_one_that_pencil_and_paper_give() {
    let mut sketch = super::Sketch::new(13);
    sketch.input("x", &[1, 2]);
    let weights = sketch.weights("w", Tensor::floats(&[2, 1], vec![3.0, -2.0]));
    sketch.node("MatMul", &["x", &weights], "sum", &[]);
    sketch.node("Mul", &["sum", "sum"], "target", &[]);
    let graph = Graph::new(sketch.model(&["target"])).unwrap();
    let x = Tensor::floats(&[1, 2], vec![1.0, 2.0]);
    // The derivative of (3 a - 2 b)^2 at (1, 2).
    let (exact, _, _) =
        both_gradients(&graph, Target { value: "target", index: 0 }, ("x", &x), &[0, 1]).unwrap();
    assert_eq!(exact, [-6.0, 4.0]);
}
