//! HiResCAM: activations times gradients, cell by cell.

use pdk_sdk::prelude::*;

use super::cam::{Cam, Rule};
use super::method::Map;

/// HiResCAM.
pub type HiResCam = Map<Cam<HiRes>>;

/// Activations times gradients, cell by cell.
pub struct HiRes;

impl Rule for HiRes {
    fn description() -> Description {
        Description::saliency("hirescam", "Multiplies each cell of a layer by its own gradient")
            .source("Draelos and Carin, \"Use HiResCAM instead of Grad-CAM for faithful explanations of convolutional neural networks\" (2020)")
            .preferred()
            .mathematics("`map = Σ_c g_c A_c`; before and behind a ReLU it is the same")
    }

    fn add(activations: &[f64], gradients: &[f64], map: &mut [f64]) {
        map.iter_mut().zip(activations.iter().zip(gradients)).for_each(|(sum, (a, g))| *sum += a * g);
    }
}

#[cfg(test)]
mod tests {
    use super::super::cam::tests::assert_map;
    use super::*;

    #[test]
    fn channels_weigh_as_the_formula_says() {
        // Each activation times its own gradient.
        assert_map::<HiRes>([0.5, -0.3 + 2.0]);
    }
}
