//! The fast gradient sign method: one step along the gradient of a network's steering.

use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::json;

use crate::attack::descent::{Descent, Way};
use crate::attack::{ball, expectation, goal, network};

/// One step, as long as the change may be.
const WAY: Way = Way { steps: 1, share: 1.0, drawn: false };

/// Attacks with one step.
pub struct Fgsm {
    descent: Descent,
}

impl Component for Fgsm {
    fn description() -> Description {
        let description = Description::perturbation(
            "fgsm",
            "Changes each pixel a little so that a network steers elsewhere, by one step along the gradient of its steering",
        )
        .family("attack")
        .not_default()
        .keeps_geometry()
        .example(json!({"model": "dave2"}))
        .mathematics("v + epsilon sign(g), g the gradient of the steering towards the goal; with l2 v + epsilon sqrt(n) g / |g|")
        .source("Goodfellow et al., Explaining and Harnessing Adversarial Examples, 2015; `expectation`: Athalye et al., Synthesizing Robust Adversarial Examples, 2018")
        .drawn_per_frame("with `expectation`, the changes over which the gradient is averaged");
        network::parameters(expectation::parameters(goal::parameters(ball::parameters(description))))
    }

    fn new(config: &Config) -> Result<Self> {
        Ok(Self { descent: Descent::open(config)? })
    }

    fn input_files(config: &Config) -> Result<Vec<InputFiles>> {
        Ok(network::files(config))
    }
}

impl Perturbation for Fgsm {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        self.descent.attack(src, dst, cx, &WAY)
    }
}
