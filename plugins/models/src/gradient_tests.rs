//! Graphs of gradients on every engine that the machine has, against the plain reference in 64-bit floats.

use std::collections::BTreeMap;
use std::time::Instant;

use pdk_network::Element;
use pdk_onnx::proto::ModelProto;
use pdk_onnx::testing::{self, CASES, OPSETS, numbers, relative_error};
use pdk_onnx::{Graph, Target, Tensor, gradients, layers, model};
use pdk_sdk::prelude::*;

use crate::engine;
use crate::fixture;
use crate::session::Graph as Content;
use crate::session::{Network, Session, Taken};

/// The engines to test; ONNX Runtime if it is found.
pub fn engines() -> Vec<&'static str> {
    match crate::locate::Search::from_environment().find().unwrap() {
        Some(_) => vec!["pdk", "onnxruntime"],
        None => {
            println!("skipped for onnxruntime: it is not installed");
            vec!["pdk"]
        }
    }
}

fn open(model: &ModelProto, engine: &str) -> Result<Box<dyn Session>> {
    let graph = Graph::new(model.clone())?;
    let taken = |name| Taken { shape: graph.fact(name).unwrap().shape.clone(), element: Element::Float32 };
    let inputs = graph.inputs().map(taken).collect();
    engine::open(&Network { graph: Content::Memory(&model::encode(model)), inputs }, engine)
}

/// What an engine computes, or why it does not.
fn run(model: &ModelProto, engine: &str, x: &Tensor) -> Result<Vec<f64>> {
    let values: Vec<f32> = x.values.iter().map(|&value| value as f32).collect();
    let mut outputs = vec![Vec::new()];
    open(model, engine)?.run(&[values], &mut outputs)?;
    Ok(outputs[0].iter().map(|&value| f64::from(value)).collect())
}

/// The gradient of a model with the input `x` on each engine, compared with the reference: errors by engine.
///
/// An engine that does not run the model itself is not asked for its gradient.
fn compare(model: &ModelProto, x: &Tensor) -> BTreeMap<&'static str, Result<f64, String>> {
    let graph = Graph::new(model.clone()).unwrap();
    let built = gradients(&graph, Target { value: "target", index: 0 }, &["x"], &[]).unwrap();
    let reference = Graph::new(built.model.clone()).unwrap();
    let expected = reference.evaluate(&[("x", x)], &[&built.outputs[0]]).unwrap().swap_remove(0);
    let forward = graph.evaluate(&[("x", x)], &["target"]).unwrap().swap_remove(0);
    let mut errors = BTreeMap::new();
    for engine in engines() {
        let Ok(found) = run(model, engine, x) else { continue };
        // A forward pass that differs is the engine's own reading of the operator.
        if relative_error(&found, &forward.values) > 1e-4 {
            errors.insert(engine, Err("reads the operator in another way".to_owned()));
            continue;
        }
        let gradient = run(&built.model, engine, x).map_err(|error| error.to_string());
        errors.insert(engine, gradient.map(|found| relative_error(&found, &expected.values)));
    }
    errors
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn gradients_of_every_operator_are_right_on_every_engine() {
    let mut ran: BTreeMap<&str, Vec<String>> = BTreeMap::new();
    let mut wrong = Vec::new();
    let mut otherwise = Vec::new();
    for case in CASES {
        for opset in OPSETS.into_iter().filter(|opset| case.opsets.contains(opset)) {
            for (engine, error) in compare(&case.model(opset), &case.x()) {
                match error {
                    Ok(error) if error < 1e-4 => ran.entry(engine).or_default().push(case.name.to_owned()),
                    Ok(error) => {
                        wrong.push(format!("{engine}: {} at version {opset}: {error:.1e}", case.name))
                    }
                    Err(error) if error.starts_with("reads") => {
                        otherwise.push(format!("{engine}: {} at version {opset}", case.name))
                    }
                    Err(error) => wrong.push(format!("{engine}: {} at version {opset}: {error}", case.name)),
                }
            }
        }
    }
    println!("computed in another way by the engine itself: {otherwise:#?}");
    for engine in engines() {
        let mut names = ran.remove(engine).unwrap_or_default();
        let count = names.len();
        names.dedup();
        let missing: Vec<_> =
            CASES.iter().map(|case| case.name).filter(|name| !names.iter().any(|ran| ran == name)).collect();
        println!("{engine}: {count} gradients of {} cases; it does not run {missing:?}", names.len());
        assert!(names.len() * 10 > CASES.len() * 9, "{engine} runs too few");
    }
    assert!(wrong.is_empty(), "{wrong:#?}");
}

#[test]
fn gradients_of_random_graphs_are_right_on_every_engine() {
    for seed in 0..40 {
        let model = testing::random(seed, OPSETS[seed as usize % OPSETS.len()]);
        let shape = [1, 2, 6, 7];
        let values = numbers(seed + 1000, 84).into_iter().map(|value| f64::from(value as f32)).collect();
        for (engine, error) in compare(&model, &Tensor::floats(&shape, values)) {
            let error = error.unwrap_or_else(|error| panic!("graph {seed} on {engine}: {error}"));
            assert!(error < 1e-4, "graph {seed} on {engine}: relative error {error:e}");
        }
    }
}

#[test]
#[ignore = "long: .ci/run runs it"]
fn gradients_of_networks_are_right_and_cost_little_more_than_the_network() {
    let root = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    let mut paths = ["dave2", "dave2_augmented", "dave2_temporal"]
        .map(|name| root.join(format!("scripts/models/{name}.onnx")))
        .to_vec();
    paths.extend(fixture::shared("tub_pilot.onnx"));
    for path in paths {
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        let graph = Graph::new(model::read(&path).unwrap()).unwrap();
        let inputs = graph.inputs().map(|name| {
            let shape = &graph.fact(name).unwrap().shape;
            let values: Vec<_> = match name {
                "image" => {
                    numbers(4, shape.iter().product()).iter().map(|v| (127.0 + 100.0 * v).round()).collect()
                }
                "speed" => vec![8.0],
                _ => numbers(5, shape.iter().product()),
            };
            (name.to_owned(), Tensor::floats(shape, values))
        });
        let inputs: Vec<_> = inputs.collect();
        let given: Vec<_> = inputs.iter().map(|(name, tensor)| (name.as_str(), tensor)).collect();
        let values: Vec<Vec<f32>> =
            inputs.iter().map(|(_, tensor)| tensor.values.iter().map(|&v| v as f32).collect()).collect();
        let target = Target { value: &graph.outputs()[0], index: 0 };
        let image = layers::Image { input: "image", height: 2, width: 3 };
        let all = layers::layers(&graph, image, target.value);
        let layer = layers::find(&all, "").unwrap();
        for of in [layer.activated.as_str(), "image"] {
            let keep = [of].into_iter().filter(|of| *of != "image").collect::<Vec<_>>();
            let built = gradients(&graph, target, &[of], &keep).unwrap();
            let gradient = built.outputs.last().unwrap();
            let expected = Graph::new(built.model.clone())
                .unwrap()
                .evaluate(&given, &[gradient])
                .unwrap()
                .swap_remove(0);
            let plain = graph.model(&[target.value]).unwrap();
            for engine in engines() {
                let mut times = [&plain, &built.model].map(|model| {
                    let mut session = open(model, engine).unwrap();
                    let count = model.graph.as_ref().map_or(0, |graph| graph.output.len());
                    let mut outputs = vec![Vec::new(); count];
                    let mut best = f64::INFINITY;
                    for _ in 0..30 {
                        let start = Instant::now();
                        session.run(&values, &mut outputs).unwrap();
                        best = best.min(start.elapsed().as_secs_f64() * 1e3);
                    }
                    (best, outputs)
                });
                let found: Vec<f64> =
                    times[1].1[built.outputs.len() - 1].iter().map(|&v| f64::from(v)).collect();
                // By the sum of all: a unit whose input is all but zero may be off in 32 bits and on in 64, which changes the few
                // pixels before it.
                let difference: f64 = found.iter().zip(&expected.values).map(|(a, b)| (a - b).abs()).sum();
                let error = difference / expected.values.iter().map(|value| value.abs()).sum::<f64>();
                let [(forward, _), (both, _)] = &mut times;
                println!(
                    "{name}, {engine}, gradient of `{of}`: {both:.2} ms, {:.1} times the network's {forward:.2} ms; relative error {error:.1e}",
                    *both / *forward
                );
                assert!(error < 1e-3, "{name} on {engine}: {error:e}");
            }
        }
    }
}
