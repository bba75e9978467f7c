//! Projected gradient descent: steps along the gradient of a network's steering, each of which is taken back to what is allowed.

use pdk_sdk::prelude::*;
use pdk_sdk::serde_json::json;

use crate::attack::descent::{Descent, Way};
use crate::attack::{ball, expectation, goal, network};

/// Attacks with several steps.
pub struct Pgd {
    descent: Descent,
    way: Way,
}

impl Component for Pgd {
    fn description() -> Description {
        let description = Description::perturbation(
            "pgd",
            "Changes each pixel a little so that a network steers elsewhere, by several steps along the gradient of its steering",
        )
        .family("attack")
        .not_default()
        .keeps_geometry()
        .example(json!({"model": "dave2", "goal": "left", "steps": 2}))
        .mathematics("v' = P(v' + step epsilon sign(g(v'))), repeated; P takes back to the ball around v, g is the gradient of the steering towards the goal")
        .source("Madry et al., Towards Deep Learning Models Resistant to Adversarial Attacks, 2018; `expectation`: Athalye et al., Synthesizing Robust Adversarial Examples, 2018")
        .drawn_per_frame("the change that the steps start from, and with `expectation` the changes over which the gradient is averaged");
        let description = ball::parameters(description)
            .parameter(
                Parameter::integer(
                    "steps",
                    10,
                    "how many steps are taken; with `goal=away` as many to either side",
                )
                .range(1.0, 1000.0),
            )
            .parameter(
                Parameter::number("step", 0.25, "how long a step is, as a share of `epsilon`")
                    .range(0.001, 2.0),
            )
            .parameter(Parameter::boolean(
                "random_start",
                true,
                "whether the steps start at a change that is drawn for each frame, and not at the frame as it is",
            ));
        network::parameters(expectation::parameters(goal::parameters(description)))
    }

    fn new(config: &Config) -> Result<Self> {
        let way = Way {
            steps: config.integer("steps") as usize,
            share: config.number("step"),
            drawn: config.boolean("random_start"),
        };
        Ok(Self { descent: Descent::open(config)?, way })
    }

    fn input_files(config: &Config) -> Result<Vec<InputFiles>> {
        Ok(network::files(config))
    }
}

impl Perturbation for Pgd {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        self.descent.attack(src, dst, cx, &self.way)
    }
}
