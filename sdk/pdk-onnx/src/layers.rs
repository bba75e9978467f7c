//! The layers of a network that keep the image's order, so that maps can be made of them.

use std::collections::HashSet;

use pdk_sdk::error::{Error, Result};

use crate::field::{ImageAxis, Look, Looks, looks};
use crate::graph::Graph;
use crate::values::Source;

/// The input that is the image.
#[derive(Debug, Clone, Copy)]
pub struct Image<'a> {
    /// Its name.
    pub input: &'a str,
    /// Its axis that goes down.
    pub height: usize,
    /// Its axis that goes to the right.
    pub width: usize,
}

/// A layer whose cells have a place on the image.
#[derive(Debug, Clone, PartialEq)]
pub struct Layer {
    /// The name of its node, or of its value where the node has none.
    pub name: String,
    /// Its operator.
    pub operator: String,
    /// The value that it computes.
    pub value: String,
    /// Its value behind its activation function; the same value if it has none.
    pub activated: String,
    /// The shape of its value.
    pub shape: Vec<usize>,
    /// The axis of its value that goes down the image, and where its cells look.
    pub rows: (usize, Look),
    /// The axis of its value that goes to the right, and where its cells look.
    pub columns: (usize, Look),
}

impl Layer {
    /// Whether it is a convolution.
    pub fn is_convolution(&self) -> bool {
        matches!(self.operator.as_str(), "Conv" | "ConvTranspose")
    }
}

/// This many cells a layer needs downwards and to the right to be the one that maps are made of by default. With fewer, a map cannot tell
/// near from far, or left from right. docs/saliency.md has the measurements.
pub const LEAST_CELLS: usize = 4;

/// The layers between the image and `target`, in their order: what nodes compute that has more than one cell on the image.
pub fn layers(graph: &Graph, image: Image<'_>, target: &str) -> Vec<Layer> {
    let looks = looks(graph, image.input, image.height, image.width);
    let (dependents, needed) = (graph.dependents(image.input), graph.needed(&[target], &HashSet::new()));
    let nodes = graph.nodes().iter().zip(needed).filter(|(_, needed)| *needed).map(|(node, _)| node);
    let layers = nodes.filter_map(|node| {
        let value = node.output.first().filter(|value| dependents.contains(value.as_str()))?;
        let shape = &graph.fact(value).ok()?.shape;
        let (rows, columns) = axes(looks.get(value)?, shape)?;
        Some(Layer {
            name: if node.name.is_empty() { value.clone() } else { node.name.clone() },
            operator: node.op_type.clone(),
            value: value.clone(),
            activated: activated(graph, value),
            shape: shape.clone(),
            rows,
            columns,
        })
    });
    layers.collect()
}

/// The layer that the image itself is.
///
/// # Errors
/// If the graph has no such input.
pub fn image_layer(graph: &Graph, image: Image<'_>) -> Result<Layer> {
    let shape = graph.fact(image.input)?.shape.clone();
    let looks = looks(graph, image.input, image.height, image.width);
    let axes = looks.get(image.input).and_then(|looks| axes(looks, &shape));
    let (rows, columns) =
        axes.ok_or_else(|| Error::new(format!("`{}` is not an image of several pixels", image.input)))?;
    Ok(Layer {
        name: image.input.to_owned(),
        operator: "image".to_owned(),
        value: image.input.to_owned(),
        activated: image.input.to_owned(),
        shape,
        rows,
        columns,
    })
}

/// The layer that maps are made of if none is named: the last convolution with [`LEAST_CELLS`] in both directions. If no convolution has
/// this many, it is the last of those with the most cells in their narrower direction.
pub fn default(layers: &[Layer]) -> Option<&Layer> {
    let narrower =
        |layer: &&Layer| layer.shape[layer.rows.0].min(layer.shape[layer.columns.0]).min(LEAST_CELLS);
    // Of several with the same number, this takes the last.
    layers.iter().filter(|layer| layer.is_convolution()).max_by_key(narrower)
}

/// The layer of this name, of its node or its value; the [`default`] if the name is empty.
///
/// # Errors
/// If there is none, with those that there are.
pub fn find<'a>(layers: &'a [Layer], name: &str) -> Result<&'a Layer> {
    if name.is_empty() {
        return default(layers).ok_or_else(|| {
            Error::new("it has no convolution whose cells have a place on the image, so a layer has to be named, or a method that needs none")
        });
    }
    let found = layers
        .iter()
        .find(|layer| layer.name == name)
        .or_else(|| layers.iter().find(|layer| layer.value == name));
    found.ok_or_else(|| {
        let convolutions: Vec<_> = layers
            .iter()
            .filter(|layer| layer.is_convolution())
            .map(|layer| format!("`{}`", layer.name))
            .collect();
        Error::new(match convolutions.is_empty() {
            true => {
                format!("it has no layer `{name}` whose cells have a place on the image, and no convolution")
            }
            false => format!(
                "it has no layer `{name}` whose cells have a place on the image; its convolutions are {}",
                convolutions.join(", ")
            ),
        })
    })
}

/// The axes that go down the image and to the right, if there is more than one cell.
fn axes(looks: &Looks, shape: &[usize]) -> Option<((usize, Look), (usize, Look))> {
    let along = |along| {
        let mut axes = looks
            .iter()
            .enumerate()
            .filter_map(|(axis, look)| look.filter(|look| look.along == along).map(|look| (axis, look)));
        axes.next().filter(|_| axes.next().is_none())
    };
    let (rows, columns) = (along(ImageAxis::Height)?, along(ImageAxis::Width)?);
    (shape[rows.0] * shape[columns.0] > 1).then_some((rows, columns))
}

/// The value behind the normalization and the activation function that nothing but they take it to.
fn activated(graph: &Graph, value: &str) -> String {
    let mut current = value;
    loop {
        let mut takers = graph.nodes().iter().filter(|node| node.input.iter().any(|input| input == current));
        let (Some(taker), None) = (takers.next(), takers.next()) else { return value.to_owned() };
        let Some(next) =
            taker.output.first().filter(|next| matches!(graph.source(next), Some(Source::Node(_))))
        else {
            return value.to_owned();
        };
        match taker.op_type.as_str() {
            "Relu" | "LeakyRelu" | "PRelu" | "Elu" | "Selu" | "Celu" | "Gelu" | "HardSwish"
            | "HardSigmoid" | "Sigmoid" | "Tanh" | "Softplus" | "Clip" | "Mish" => return next.clone(),
            "BatchNormalization" | "InstanceNormalization" | "GroupNormalization" => current = next,
            _ => return value.to_owned(),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::Sketch;

    fn graph() -> Graph {
        let mut s = Sketch::new(13);
        s.input("x", &[1, 1, 9, 9]);
        let (first, second, dense) = (
            s.drawn(&[2, 1, 3, 3], -1.0, 1.0),
            s.drawn(&[3, 2, 3, 3], -1.0, 1.0),
            s.drawn(&[75, 1], -1.0, 1.0),
        );
        s.node("Conv", &["x", &first], "a", &[]);
        s.node("Relu", &["a"], "b", &[]);
        s.node("Conv", &["b", &second], "c", &[]);
        s.node("Flatten", &["c"], "f", &[]);
        s.node("MatMul", &["f", &dense], "y", &[]);
        s.node("Sigmoid", &["a"], "unused", &[]);
        Graph::new(s.model(&["y"])).unwrap()
    }

    const IMAGE: Image<'static> = Image { input: "x", height: 2, width: 3 };

    #[test]
    fn the_default_is_the_last_convolution_with_enough_cells_in_both_directions() {
        let default_of = |sizes: &[(usize, usize)]| {
            let one = layers(&graph(), IMAGE, "y").remove(0);
            let layers: Vec<_> = sizes
                .iter()
                .zip(1..)
                .map(|((rows, columns), number)| {
                    let mut shape = one.shape.clone();
                    (shape[one.rows.0], shape[one.columns.0]) = (*rows, *columns);
                    Layer { name: format!("{number}"), shape, ..one.clone() }
                })
                .collect();
            default(&layers).map(|layer| layer.name.clone()).unwrap_or_default()
        };
        // The networks that are part of pdk, and a pilot of a DonkeyCar.
        assert_eq!(default_of(&[(31, 98), (14, 47), (5, 22), (3, 20), (1, 18)]), "3");
        assert_eq!(default_of(&[(58, 78), (27, 37), (12, 17), (10, 15), (8, 13)]), "5");
        assert_eq!(default_of(&[(8, 8), (4, 4), (20, 3)]), "2");
        // With too few everywhere, the one that comes closest, and of several the last.
        assert_eq!(default_of(&[(3, 9), (2, 9), (3, 5), (1, 9)]), "3");
        assert_eq!(default_of(&[]), "");
    }

    #[test]
    fn layers_are_found_by_node_and_value_and_the_last_convolution_without_a_name() {
        let layers = layers(&graph(), IMAGE, "y");
        let names: Vec<_> = layers.iter().map(|layer| layer.value.as_str()).collect();
        assert_eq!(names, ["a", "b", "c"]);
        assert_eq!(find(&layers, "").unwrap().value, "c");
        assert_eq!(find(&layers, "b").unwrap().operator, "Relu");
        assert_eq!(find(&layers, "conv_0").unwrap().value, "a");
        let error = find(&layers, "conv_9").unwrap_err().to_string();
        assert_eq!(
            error,
            "it has no layer `conv_9` whose cells have a place on the image; its convolutions are `conv_0`, `conv_2`"
        );
        assert!(find(&[], "").unwrap_err().to_string().starts_with("it has no convolution"));
    }

    #[test]
    fn an_activation_belongs_to_a_layer_that_nothing_else_takes() {
        // The first convolution is also taken by a sigmoid, so that neither is its only activation.
        let layers = layers(&graph(), IMAGE, "y");
        assert_eq!(find(&layers, "conv_0").unwrap().activated, "a");
        let mut s = Sketch::new(13);
        s.input("x", &[1, 1, 9, 9]);
        let weights = s.drawn(&[2, 1, 3, 3], -1.0, 1.0);
        let rest: Vec<_> = (0..4).map(|_| s.drawn(&[2], 0.5, 1.0)).collect();
        s.node("Conv", &["x", &weights], "a", &[]);
        s.node("BatchNormalization", &["a", &rest[0], &rest[1], &rest[2], &rest[3]], "n", &[]);
        s.node("Relu", &["n"], "y", &[]);
        let layers = super::layers(&Graph::new(s.model(&["y"])).unwrap(), IMAGE, "y");
        assert_eq!(find(&layers, "").unwrap().activated, "y");
    }

    #[test]
    fn the_image_is_a_layer_of_its_own() {
        let layer = image_layer(&graph(), IMAGE).unwrap();
        assert_eq!((layer.rows.0, layer.columns.0, layer.columns.1.step), (2, 3, 1.0));
        let flat = Image { height: 0, width: 1, ..IMAGE };
        assert!(image_layer(&graph(), flat).is_err());
    }
}
