//! `pdk show MODEL.onnx`: what a network takes and gives, and which of its layers maps can be made of.

use std::path::Path;

use pdk_notice::println;
use pdk_onnx::layers::{self, Image, LEAST_CELLS, Layer, layers};
use pdk_onnx::tensor::shape_text;
use pdk_onnx::{Graph, gradient, model};
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Place, Result};
use pdk_terminal::table::table;
use serde_json::{Value, json};

use super::{Global, print_json};

/// Whether a name is that of a network's file and not of a component.
pub fn is_file(name: &str) -> bool {
    Path::new(name).extension().is_some_and(|ending| ending.eq_ignore_ascii_case(pdk_onnx::ENDING))
}

/// Shows the network in a file.
pub fn show(global: &Global, path: &str) -> Result<()> {
    let place = format!("network `{path}`");
    let graph = model::read(Path::new(path)).and_then(Graph::new).place(&place)?;
    let outputs: Vec<Output> = graph.outputs().iter().map(|name| Output::of(&graph, name)).collect();
    if global.json {
        return print_json(&json!({
            "opset": graph.opset(),
            "inputs": graph.inputs().map(|name| json!({ "name": name, "shape": shape(&graph, name) })).collect::<Vec<_>>(),
            "outputs": outputs.iter().map(|output| output.to_json(&graph)).collect::<Vec<_>>(),
        }));
    }
    println!("opset     {}, {} nodes", graph.opset(), graph.nodes().len());
    for name in graph.inputs() {
        println!("input     {name} {}", shape_or_reason(&graph, name));
    }
    for output in &outputs {
        println!("output    {} {}", output.name, shape_or_reason(&graph, &output.name));
        match &output.missing {
            missing if missing.is_empty() => println!("          every operator before it has a gradient"),
            missing => println!(
                "          without a gradient: {}; for layers before these, {}",
                missing.join(", "),
                without_gradients(global)?
            ),
        }
    }
    let Some(first) = outputs.first() else { return Ok(()) };
    if first.layers.is_empty() {
        println!("layers    none whose cells have a place on an image");
        return Ok(());
    }
    let mut rows = table(["layer", "operator", "channels", "cells", "receptive field", "apart", "first at"]);
    for layer in first.layers.iter().filter(|layer| layer.is_convolution() || layer.operator.contains("Pool"))
    {
        let [cells, size, step, start] = measures(layer);
        let channels = layer.shape.iter().product::<usize>()
            / (layer.shape[layer.rows.0] * layer.shape[layer.columns.0]);
        rows.add_row([
            layer.name.clone(),
            layer.operator.clone(),
            channels.to_string(),
            cells,
            size,
            step,
            start,
        ]);
    }
    println!("{rows}\nin pixels, width x height");
    if let Some(default) = layers::default(&first.layers) {
        println!(
            "without `layer`, maps are made of {}: the last convolution that has at least {LEAST_CELLS} cells in both directions, or else \
             comes closest",
            default.name
        );
    }
    Ok(())
}

/// Which saliency methods work for layers before an operator without a gradient, as a clause.
fn without_gradients(global: &Global) -> Result<String> {
    let registry = global.registry()?;
    let methods = registry.catalog().of_kind(Kind::Saliency).filter(|entry| entry.description.gradient_free);
    let methods: Vec<&str> = methods.map(|entry| entry.description.name.as_str()).collect();
    Ok(match methods.as_slice() {
        [] => "no method works".to_owned(),
        [one] => format!("{one} works"),
        [first @ .., last] => format!("{} and {last} work", first.join(", ")),
    })
}

/// An output, and what can be said about the way to it.
struct Output {
    name: String,
    layers: Vec<Layer>,
    missing: Vec<String>,
}

impl Output {
    fn of(graph: &Graph, name: &str) -> Self {
        let image = image(graph);
        let missing =
            image.map(|image| gradient::without_gradient(graph, name, image.input)).unwrap_or_default();
        let layers = image.map(|image| layers(graph, image, name)).unwrap_or_default();
        Self { name: name.to_owned(), layers, missing }
    }

    fn to_json(&self, graph: &Graph) -> Value {
        let layers = self.layers.iter().map(|layer| {
            json!({
                "name": layer.name, "operator": layer.operator, "value": layer.value, "behind_activation": layer.activated,
                "shape": layer.shape,
                "rows": { "count": layer.shape[layer.rows.0], "first_at": layer.rows.1.start, "apart": layer.rows.1.step, "receptive_field": layer.rows.1.size },
                "columns": { "count": layer.shape[layer.columns.0], "first_at": layer.columns.1.start, "apart": layer.columns.1.step, "receptive_field": layer.columns.1.size },
            })
        });
        json!({
            "name": self.name, "shape": shape(graph, &self.name), "without_gradient": self.missing,
            "layers": layers.collect::<Vec<_>>(),
        })
    }
}

/// The first input that is an image of one or three channels.
fn image(graph: &Graph) -> Option<Image<'_>> {
    graph.inputs().find_map(|input| match graph.fact(input).ok()?.shape.as_slice() {
        [_, 1 | 3, _, _] => Some(Image { input, height: 2, width: 3 }),
        [_, _, _, 1 | 3] => Some(Image { input, height: 1, width: 2 }),
        _ => None,
    })
}

fn shape(graph: &Graph, name: &str) -> Value {
    graph.fact(name).map_or(Value::Null, |fact| json!(fact.shape))
}

fn shape_or_reason(graph: &Graph, name: &str) -> String {
    match graph.fact(name) {
        Ok(fact) => format!("{} {}", shape_text(&fact.shape), fact.element),
        Err(error) => format!("({error})"),
    }
}

/// Number of cells, receptive field, distance and first place of a layer's cells, each as width and height.
fn measures(layer: &Layer) -> [String; 4] {
    let (down, right) = (layer.rows.1, layer.columns.1);
    [
        format!("{}x{}", layer.shape[layer.columns.0], layer.shape[layer.rows.0]),
        format!("{}x{}", right.size, down.size),
        format!("{}x{}", right.step, down.step),
        format!("{}, {}", right.start, down.start),
    ]
}
