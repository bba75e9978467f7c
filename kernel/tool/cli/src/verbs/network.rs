//! `pdk show MODEL.onnx`: what a network takes and gives, what is known about its preprocessing and why, and which of its layers maps can
//! be made of.

use std::path::Path;

use pdk_network::described::Described;
use pdk_network::reason::Reason;
use pdk_network::{Declared, Given, Outputs, Plan, seen, waypoints};
use pdk_notice::println;
use pdk_onnx::layers::{self, Image, LEAST_CELLS, Layer, layers};
use pdk_onnx::tensor::shape_text;
use pdk_onnx::{Graph, gradient, model};
use pdk_sdk::describe::Kind;
use pdk_sdk::error::{Error, Place, Result};
use pdk_terminal::table::table;
use pdk_terminal::text::wrapped;
use serde_json::{Value, json};

use super::{Global, print_json};

/// Whether a name is that of a network's file and not of a component.
pub fn is_file(name: &str) -> bool {
    Path::new(name).extension().is_some_and(|ending| ending.eq_ignore_ascii_case(pdk_onnx::ENDING))
}

/// What is known about a network's preprocessing and control.
pub struct Reading {
    /// What the file declares.
    pub declared: Declared,
    /// The graph, or why it cannot be followed.
    pub graph: Result<Graph>,
    /// The description's file, if there is one.
    pub file: Option<String>,
    /// What its inputs get.
    pub plan: Result<Plan>,
    /// How its outputs drive.
    pub drives: Result<Outputs>,
}

impl Reading {
    /// Reads a model and the description beside it.
    ///
    /// # Errors
    /// If the model cannot be read.
    pub fn of(path: &str) -> Result<Self> {
        let mut model = model::read(Path::new(path))?;
        let given = Given::beside(Path::new(path));
        let file =
            given.as_ref().ok().and_then(|given| given.file.as_ref()).map(|file| file.display().to_string());
        let given = given.and_then(|mut given| {
            waypoints::follow(&mut model, &mut given)?;
            Ok(given)
        });
        let declared = Declared::of_model(&model);
        let graph = Graph::new(model);
        let plan = given.and_then(Described::new).and_then(|described| Plan::new(&declared, described));
        let mut reading = Self { declared, graph, file, drives: Err(Error::new("")), plan };
        reading.drives = reading.find_drives();
        Ok(reading)
    }

    /// How many numbers an output has; none if that is not known without running the network.
    pub fn size(&self, place: usize) -> Option<usize> {
        let port = &self.declared.outputs[place];
        let known = self.graph.as_ref().ok().and_then(|graph| graph.fact(&port.name).ok());
        known.map(|fact| fact.shape.iter().product()).or_else(|| port.values())
    }

    fn find_drives(&self) -> Result<Outputs> {
        let plan = self.plan.as_ref().map_err(Clone::clone)?;
        let sizes: Option<Vec<usize>> =
            (0..self.declared.outputs.len()).map(|place| self.size(place)).collect();
        let sizes =
            sizes.ok_or_else(|| Error::new("the sizes of its outputs are not known without running it"))?;
        Outputs::new(&plan.described, &plan.outputs, &sizes, &plan.states().collect::<Vec<_>>())
    }

    /// All that is known, and why.
    pub fn reasons(&self) -> Vec<Reason> {
        let of_inputs = self.plan.iter().flat_map(|plan| &plan.reasons);
        of_inputs.chain(self.drives.iter().flat_map(|drives| &drives.reasons)).cloned().collect()
    }

    /// Why something is not known.
    pub fn error(&self) -> Option<&Error> {
        self.plan.as_ref().err().or(self.drives.as_ref().err())
    }
}

/// Shows what describes the network.
fn show_reading(reading: &Reading, path: &str) {
    let beside = Path::new(path).with_extension("toml");
    match &reading.file {
        Some(file) => println!("described {file}"),
        None => {
            println!("described nowhere; `pdk new network {path}` writes {} to complete", beside.display())
        }
    }
    for Reason { subject, value, why, assumed } in reading.reasons() {
        let mark = if assumed { "ASSUMED: " } else { "" };
        println!("{}", wrapped(&format!("{subject:<9} "), &format!("{value} ({mark}{why})")));
    }
    if let Some(error) = reading.error() {
        println!("{}", wrapped("unknown   ", error.message()));
    }
}

/// Writes what the network sees of a picture, beside the picture.
fn write_seen(reading: &Reading, image: &Path, out: &Path) -> Result<()> {
    let plan = reading.plan.as_ref().map_err(Clone::clone)?;
    let frame = pdk_image::read(image)?;
    pdk_image::write(out, seen::picture(plan, frame.as_ref())?.as_ref())?;
    println!("Wrote {}", out.display());
    Ok(())
}

/// Shows the network in a file; `seen` are a picture, and where to write what the network sees of it.
pub fn show(global: &Global, path: &str, seen: Option<(&Path, &Path)>) -> Result<()> {
    let place = format!("network `{path}`");
    let reading = Reading::of(path).place(&place)?;
    if let Some((image, out)) = seen {
        return write_seen(&reading, image, out).place(&place);
    }
    show_all(global, path, &reading).place(&place)?;
    // A description that is there has to fit; a network without one need not be a driver.
    match (&reading.file, reading.error()) {
        (Some(_), Some(error)) => Err(error.clone().at(&place)),
        // What is wrong with a description's file is not known by its name.
        (None, Some(error)) if Given::beside(Path::new(path)).is_err() => Err(error.clone().at(&place)),
        _ => Ok(()),
    }
}

fn show_all(global: &Global, path: &str, reading: &Reading) -> Result<()> {
    let graph = reading.graph.as_ref().map_err(Clone::clone)?;
    let outputs: Vec<Output> =
        graph.outputs().iter().map(|name| Output::of(graph, reading.plan.as_ref().ok(), name)).collect();
    if global.json {
        let reasons = reading.reasons();
        let reasons = reasons.iter().map(|Reason { subject, value, why, assumed }| {
            json!({ "subject": subject, "value": value, "why": why, "assumed": assumed })
        });
        return print_json(&json!({
            "description": { "file": reading.file, "known": reasons.collect::<Vec<_>>(), "error": reading.error().map(Error::message) },
            "opset": graph.opset(),
            "inputs": graph.inputs().map(|name| json!({ "name": name, "shape": shape(graph, name) })).collect::<Vec<_>>(),
            "outputs": outputs.iter().map(|output| output.to_json(graph)).collect::<Vec<_>>(),
        }));
    }
    println!("opset     {}, {} nodes", graph.opset(), graph.nodes().len());
    for name in graph.inputs() {
        println!("input     {name} {}", shape_or_reason(graph, name));
    }
    for output in &outputs {
        println!("output    {} {}", output.name, shape_or_reason(graph, &output.name));
        match &output.missing {
            missing if missing.is_empty() => println!("          every operator before it has a gradient"),
            missing => println!(
                "          without a gradient: {}; for layers before these, {}",
                missing.join(", "),
                without_gradients(global)?
            ),
        }
    }
    show_reading(reading, path);
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
    fn of(graph: &Graph, plan: Option<&Plan>, name: &str) -> Self {
        let image = plan.and_then(planned_image).or_else(|| image(graph));
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

/// The image of a plan.
fn planned_image(plan: &Plan) -> Option<Image<'_>> {
    let image = &plan.image;
    Some(Image { input: &plan.inputs[image.place].name, height: image.axis('h')?, width: image.axis('w')? })
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
