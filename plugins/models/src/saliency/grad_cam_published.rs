//! Grad-CAM as published with PerturbationDrive.

use pdk_sdk::prelude::*;

use super::cam::{Cam, Rule, add_weighed};
use super::method::Map;

/// Grad-CAM as published with PerturbationDrive.
pub type PublishedGradCam = Map<Cam<Published>>;

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
    use super::super::cam::tests::assert_map;
    use super::*;

    #[test]
    fn channels_weigh_as_the_formula_says() {
        // Guided means: 0.25, and 0.5 because the first cell of the second channel is not above zero.
        assert_map::<Published>([0.25, 0.75 + 1.0]);
    }
}
