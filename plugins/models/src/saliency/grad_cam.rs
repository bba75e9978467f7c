//! Grad-CAM: each channel of a layer weighs as much as its mean gradient.

use pdk_sdk::prelude::*;

use super::cam::{Cam, Rule, add_weighed};
use super::method::Map;

/// Grad-CAM.
pub type GradCam = Map<Cam<Mean>>;

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

#[cfg(test)]
mod tests {
    use super::super::cam::tests::assert_map;
    use super::*;

    #[test]
    fn channels_weigh_as_the_formula_says() {
        // Means of the gradients: 0.2 and 1.
        assert_map::<Mean>([0.2, 0.6 + 2.0]);
    }
}
