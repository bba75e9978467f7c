//! Grad-CAM++: channels weigh by their positive gradients.

use pdk_sdk::prelude::*;

use super::cam::{Cam, Rule, add_weighed};
use super::method::Map;

/// Grad-CAM++.
pub type GradCamPlusPlus = Map<Cam<PlusPlus>>;

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

#[cfg(test)]
mod tests {
    use super::super::cam::tests::assert_map;
    use super::*;

    #[test]
    fn channels_weigh_as_the_formula_says() {
        // Weights: 0.5 / (2 + 4 * 0.5), and twice 1 / (2 + 2 * 1).
        assert_map::<PlusPlus>([0.125, 0.375 + 1.0]);
    }
}
