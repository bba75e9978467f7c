//! Graphs that are built from the model's, ready to run.

use pdk_network::Inputs;
use pdk_onnx::layers::{self, Image, Layer};
use pdk_onnx::{Graph, Target, gradients_of_sum, model};
use pdk_sdk::prelude::*;

use super::viewer::Viewer;
use crate::engine;
use crate::session::{self, Network, Session};

/// What can be done where a gradient is missing.
const WITHOUT: &str = "eigen-cam, score-cam, rise and occlusion work without one";

/// Which layer a method looks at.
pub fn layer_parameters(description: Description) -> Description {
    description
        .finer("gradient")
        .parameter(Parameter::text(
            "layer",
            "the layer whose cells are weighed, by the name of its node or of its value; left out, the last convolution that has at least 4 cells in \
             both directions",
        ).role(Role::Layer))
        .parameter(Parameter::boolean(
            "activation",
            true,
            "whether the layer is taken after its activation function, if it has one",
        ))
}

/// A graph that computes values of a layer.
pub struct Derived {
    session: Box<dyn Session>,
    inputs: Inputs,
    outputs: Vec<Vec<f32>>,
    pub layer: Layer,
    /// Whether the last output is a gradient that points the other way.
    reversed: bool,
}

/// The model's graph.
///
/// # Errors
/// If it contradicts itself.
pub fn graph(viewer: &Viewer) -> Result<Graph> {
    viewer.model.source.graph()
}

/// The input of a graph that is the image.
fn image<'a>(graph: &'a Graph, viewer: &Viewer) -> Result<Image<'a>> {
    let (place, height, width) = viewer.image();
    let input = graph.inputs().nth(place).ok_or_else(|| Error::new("it has no image"))?;
    Ok(Image { input, height, width })
}

/// The layer that the parameters name.
///
/// # Errors
/// If there is none of this name.
pub fn named_layer(graph: &Graph, viewer: &Viewer, config: &Config) -> Result<Layer> {
    let layers = layers::layers(graph, image(graph, viewer)?, viewer.explained_output());
    let mut layer = layers::find(&layers, config.text("layer"))?.clone();
    if config.boolean("activation") {
        layer.value.clone_from(&layer.activated);
    }
    Ok(layer)
}

/// The image as a layer of its own.
///
/// # Errors
/// If it is a single pixel.
pub fn image_layer(graph: &Graph, viewer: &Viewer) -> Result<Layer> {
    layers::image_layer(graph, image(graph, viewer)?)
}

impl Derived {
    /// A graph that computes the layer, and the gradient of the sum of these numbers with respect to it. The gradient comes last.
    ///
    /// # Errors
    /// If an operator behind the layer has no gradient, or the engine cannot run the graph.
    pub fn gradient(graph: &Graph, viewer: &Viewer, layer: Layer, targets: &[Target<'_>]) -> Result<Self> {
        let is_input = graph.inputs().any(|input| input == layer.value);
        let keep: &[&str] = if is_input { &[] } else { &[&layer.value] };
        let built = gradients_of_sum(graph, targets, &[&layer.value], keep)
            .map_err(|error| Error::new(format!("{error}; {WITHOUT}")))?;
        let mut derived = Self::open(viewer, layer, &built.model, built.outputs.len())?;
        derived.reversed = targets.len() == 1 && viewer.is_reversed();
        Ok(derived)
    }

    /// A graph that computes the layer alone.
    ///
    /// # Errors
    /// If the engine cannot run the graph.
    pub fn forward(graph: &Graph, viewer: &Viewer, layer: Layer) -> Result<Self> {
        let model = graph.model(&[&layer.value])?;
        Self::open(viewer, layer, &model, 1)
    }

    fn open(
        viewer: &Viewer,
        layer: Layer,
        model: &pdk_onnx::proto::ModelProto,
        outputs: usize,
    ) -> Result<Self> {
        let bytes = model::encode(model);
        let network = Network {
            graph: session::Graph::Memory(&bytes),
            inputs: viewer.model.plan.inputs.iter().map(Into::into).collect(),
        };
        let session = engine::open(&network, &viewer.engine)?;
        Ok(Self {
            session,
            inputs: Inputs::new(&viewer.model.plan),
            outputs: vec![Vec::new(); outputs],
            layer,
            reversed: false,
        })
    }

    /// Runs the graph on a frame in the size of the model's image, and gives each output channel by channel.
    ///
    /// # Errors
    /// If the engine fails, or gives another number of values than the layer has.
    pub fn run(&mut self, viewer: &Viewer, frame: Frame<'_>) -> Result<Vec<Planes>> {
        viewer.numbers(frame, self.inputs.image());
        self.compute(viewer)
    }

    /// Runs the graph on the numbers of an image.
    ///
    /// # Errors
    /// As for [`Self::run`].
    pub fn run_on(&mut self, viewer: &Viewer, image: &[f32]) -> Result<Vec<Planes>> {
        self.inputs.image().copy_from_slice(image);
        self.compute(viewer)
    }

    /// Numbers of an image by channel, for a graph whose layer is the image.
    pub fn planes(&self, image: &[f32]) -> Planes {
        Planes::new(&self.layer, image)
    }

    fn compute(&mut self, viewer: &Viewer) -> Result<Vec<Planes>> {
        self.inputs.move_at(viewer.speed())?;
        self.session.run(self.inputs.values(), &mut self.outputs)?;
        check_counts(&self.layer, &self.outputs)?;
        if let Some(gradient) = self.outputs.last_mut().filter(|_| self.reversed) {
            gradient.iter_mut().for_each(|value| *value = -*value);
        }
        Ok(self.outputs.iter().map(|values| Planes::new(&self.layer, values)).collect())
    }
}

/// Checks that an engine gave as many numbers as the layer has: shapes are inferred from the file, and an engine may compute others.
fn check_counts(layer: &Layer, outputs: &[Vec<f32>]) -> Result<()> {
    let count: usize = layer.shape.iter().product();
    match outputs.iter().find(|values| values.len() != count) {
        None => Ok(()),
        Some(values) => Err(Error::new(format!(
            "the layer `{}` has {count} numbers by the shapes in the file, but the engine gives {}; export the model with fixed shapes, or choose another \
             layer with `layer`",
            layer.name,
            values.len()
        ))),
    }
}

/// The values of a layer, channel by channel.
#[derive(Debug, Clone, PartialEq)]
pub struct Planes {
    pub rows: usize,
    pub columns: usize,
    values: Vec<f64>,
}

impl Planes {
    fn new(layer: &Layer, values: &[f32]) -> Self {
        let shape = &layer.shape;
        let (down, right) = (layer.rows.0, layer.columns.0);
        let stride = |axis: usize| shape[axis + 1..].iter().product::<usize>();
        // The first value of each channel: all places that are first downwards and to the right.
        let mut starts = vec![0];
        for axis in (0..shape.len()).filter(|&axis| axis != down && axis != right) {
            starts = starts
                .iter()
                .flat_map(|start| (0..shape[axis]).map(move |at| start + at * stride(axis)))
                .collect();
        }
        let (rows, columns) = (shape[down], shape[right]);
        let cells = (0..rows).flat_map(|row| (0..columns).map(move |column| (row, column)));
        let cells: Vec<_> = cells.map(|(row, column)| row * stride(down) + column * stride(right)).collect();
        let values =
            starts.iter().flat_map(|start| cells.iter().map(move |cell| f64::from(values[start + cell])));
        Self { rows, columns, values: values.collect() }
    }

    /// Adds the values of another one of the same layer.
    pub fn add(&mut self, other: &Self) {
        self.values.iter_mut().zip(&other.values).for_each(|(sum, value)| *sum += value);
    }

    /// Adds the squares of the values of another one of the same layer.
    pub fn add_squares(&mut self, other: &Self) {
        self.values.iter_mut().zip(&other.values).for_each(|(sum, value)| *sum += value * value);
    }

    /// Changes each value, given the one of another one of the same layer.
    pub fn change(&mut self, other: &Self, to: impl Fn(f64, f64) -> f64) {
        self.values.iter_mut().zip(&other.values).for_each(|(value, other)| *value = to(*value, *other));
    }

    /// As many values, all zero.
    pub fn zeros(&self) -> Self {
        Self { values: vec![0.0; self.values.len()], ..*self }
    }

    /// The values of each channel, row by row.
    pub fn channels(&self) -> impl Iterator<Item = &[f64]> {
        self.values.chunks(self.rows * self.columns)
    }
}

#[cfg(test)]
mod tests {
    use pdk_onnx::testing::Sketch;

    use super::*;

    #[test]
    fn an_engine_that_gives_other_shapes_than_the_file_is_refused() {
        let mut sketch = Sketch::new(13);
        sketch.input("x", &[1, 1, 2, 3]);
        sketch.node("Relu", &["x"], "y", &[]);
        let graph = Graph::new(sketch.model(&["y"])).unwrap();
        let layer = layers::image_layer(&graph, Image { input: "x", height: 2, width: 3 }).unwrap();
        assert!(check_counts(&layer, &[vec![0.0; 6], vec![1.0; 6]]).is_ok());
        let error = check_counts(&layer, &[vec![0.0; 6], vec![1.0; 4]]).unwrap_err().to_string();
        assert!(error.contains("the layer `x` has 6 numbers") && error.contains("gives 4"), "{error}");
    }
}
