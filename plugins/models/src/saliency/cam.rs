//! Class activation maps by gradients: Grad-CAM, Grad-CAM++, HiResCAM, and the published variant of Grad-CAM.

use std::marker::PhantomData;

use pdk_sdk::prelude::*;

use super::derived::{Derived, graph, layer_parameters, named_layer};
use super::grid::{Grid, Sign, sign_parameter};
use super::method::{Map, Method, empty};
use super::viewer::{Viewer, common_parameters, parameters};

/// Grad-CAM.
pub type GradCam = Map<Cam<Mean>>;
/// Grad-CAM++.
pub type GradCamPlusPlus = Map<Cam<PlusPlus>>;
/// HiResCAM.
pub type HiResCam = Map<Cam<HiRes>>;
/// Grad-CAM as published with PerturbationDrive.
pub type PublishedGradCam = Map<Cam<Published>>;

/// How activations and gradients of a layer become a map.
pub trait Rule: Send {
    /// Name and documentation.
    fn description() -> Description;

    /// Adds what a channel contributes.
    fn add(activations: &[f64], gradients: &[f64], map: &mut [f64]);

    /// Whether it explains one number, whose sign can be chosen; else the sum of all numbers that drive.
    const ONE: bool = true;
}

/// A class activation map.
pub struct Cam<R> {
    derived: Derived,
    rule: PhantomData<R>,
}

impl<R: Rule> Method for Cam<R> {
    fn description() -> Description {
        // Version 2 is of another layer than the last convolution if none is named.
        let description = R::description().family("gradient").version(2);
        match R::ONE {
            true => layer_parameters(parameters(description)).parameter(sign_parameter()),
            false => layer_parameters(common_parameters(description)),
        }
    }

    fn new(viewer: &Viewer, config: &Config) -> Result<Self> {
        let graph = graph(viewer)?;
        let layer = named_layer(&graph, viewer, config)?;
        let targets = if R::ONE { vec![viewer.target()] } else { viewer.driving() };
        Ok(Self { derived: Derived::gradient(&graph, viewer, layer, &targets)?, rule: PhantomData })
    }

    fn sign(config: &Config) -> Sign {
        if R::ONE { Sign::of(config.text("sign")) } else { Sign::Range }
    }

    fn cells(&self, _: &Viewer) -> [usize; 2] {
        let layer = &self.derived.layer;
        [layer.shape[layer.rows.0], layer.shape[layer.columns.0]]
    }

    fn grid(&mut self, viewer: &mut Viewer, frame: Frame<'_>, _: &MapContext<'_>) -> Result<Grid> {
        let planes = self.derived.run(viewer, frame)?;
        let mut grid = empty(&self.derived.layer);
        for (activations, gradients) in planes[0].channels().zip(planes[planes.len() - 1].channels()) {
            R::add(activations, gradients, &mut grid.values);
        }
        Ok(grid)
    }
}

/// Adds a channel with a weight.
pub fn add_weighed(activations: &[f64], weight: f64, map: &mut [f64]) {
    map.iter_mut().zip(activations).for_each(|(sum, value)| *sum += weight * value);
}

/// Weights that are the mean gradient of each channel.
pub struct Mean;

impl Rule for Mean {
    fn description() -> Description {
        Description::saliency("grad-cam", "Weighs the channels of a layer by their mean gradient")
            .source("Selvaraju et al., \"Grad-CAM: Visual Explanations from Deep Networks via Gradient-based Localization\" (2017)")
            .mathematics("`map = Σ_c mean(g_c) A_c`, with `A` the layer and `g` the gradient of the output")
    }

    fn add(activations: &[f64], gradients: &[f64], map: &mut [f64]) {
        let mean = gradients.iter().sum::<f64>() / gradients.len() as f64;
        add_weighed(activations, mean, map);
    }
}

/// Weights that count positive gradients by how much of the channel each stands for.
pub struct PlusPlus;

impl Rule for PlusPlus {
    fn description() -> Description {
        Description::saliency("grad-cam++", "Weighs the channels of a layer by their positive gradients, so that several objects count alike")
            .source("Chattopadhay et al., \"Grad-CAM++: Improved Visual Explanations for Deep Convolutional Networks\" (2018)")
            .mathematics("`map = Σ_c w_c A_c`, `w_c = Σ relu(g) / (2 + S_c g)`, `S_c = Σ A_c`")
    }

    fn add(activations: &[f64], gradients: &[f64], map: &mut [f64]) {
        let sum: f64 = activations.iter().sum();
        let positive = gradients.iter().filter(|&&gradient| gradient > 0.0);
        let weight = positive.map(|gradient| gradient / (2.0 + sum * gradient)).sum();
        add_weighed(activations, weight, map);
    }
}

/// Activations times gradients, cell by cell.
pub struct HiRes;

impl Rule for HiRes {
    fn description() -> Description {
        Description::saliency("hirescam", "Multiplies each cell of a layer by its own gradient")
            .source("Draelos and Carin, \"Use HiResCAM instead of Grad-CAM for faithful explanations of convolutional neural networks\" (2020)")
            .mathematics("`map = Σ_c g_c A_c`; before and behind a ReLU it is the same")
    }

    fn add(activations: &[f64], gradients: &[f64], map: &mut [f64]) {
        map.iter_mut().zip(activations.iter().zip(gradients)).for_each(|(sum, (a, g))| *sum += a * g);
    }
}

/// Weights that are the mean of positive gradients at positive activations.
pub struct Published;

impl Rule for Published {
    fn description() -> Description {
        Description::saliency("grad-cam-published", "Grad-CAM with guided gradients, as published with PerturbationDrive")
            .source("PerturbationDrive")
            .mathematics("`map = Σ_c w_c A_c`, `w_c = mean(g_c [g_c > 0] [A_c > 0])`, with `g` the gradient of the sum of steering and throttle, from the least value to the greatest")
            .divergence("The published tool builds the map in the framework that trained the model; this one needs the ONNX file alone.")
    }

    fn add(activations: &[f64], gradients: &[f64], map: &mut [f64]) {
        let guided = activations.iter().zip(gradients).filter(|(a, g)| **a > 0.0 && **g > 0.0);
        let mean = guided.map(|(_, gradient)| gradient).sum::<f64>() / gradients.len() as f64;
        add_weighed(activations, mean, map);
    }

    const ONE: bool = false;
}

#[cfg(test)]
mod tests {
    use super::*;

    fn map<R: Rule>(channels: &[([f64; 2], [f64; 2])]) -> [f64; 2] {
        let mut map = [0.0; 2];
        channels.iter().for_each(|(activations, gradients)| R::add(activations, gradients, &mut map));
        map
    }

    #[test]
    fn each_rule_weighs_as_its_formula_says() {
        let channels = [([1.0, 3.0], [0.5, -0.1]), ([0.0, 2.0], [1.0, 1.0])];
        let close = |found: [f64; 2], expected: [f64; 2]| {
            found.iter().zip(expected).all(|(a, b)| (a - b).abs() < 1e-12)
        };
        // Means of the gradients: 0.2 and 1.
        assert!(close(map::<Mean>(&channels), [0.2, 0.6 + 2.0]));
        // Weights: 0.5 / (2 + 4 * 0.5), and twice 1 / (2 + 2 * 1).
        assert!(close(map::<PlusPlus>(&channels), [0.125, 0.375 + 1.0]));
        assert!(close(map::<HiRes>(&channels), [0.5, -0.3 + 2.0]));
        // Guided means: 0.25, and 0.5 because the first cell of the second channel is not above zero.
        assert!(close(map::<Published>(&channels), [0.25, 0.75 + 1.0]));
    }
}
