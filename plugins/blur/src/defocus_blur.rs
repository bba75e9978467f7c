//! Defocus blur: a lens that is focused too near.

use pdk_sdk::ops::average::{Workspace, disc_blur};
use pdk_sdk::prelude::*;

/// Spreads every pixel evenly over a disc.
pub struct DefocusBlur {
    workspace: Workspace,
}

impl Component for DefocusBlur {
    fn description() -> Description {
        Description::perturbation("defocus_blur", "Replaces every pixel by the mean of the disc around it")
            .family("blur")
            .keeps_geometry().mathematics("mean of v over the disc x² + y² <= radius²")
            .source("Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations (2019)")
            .parameter(
                Parameter::by_level("radius", [2.0, 5.0, 6.0, 9.0, 12.0], "radius of the disc; the disc grows pixel by pixel between whole numbers too")
                    .range(0.0, 100.0)
                    .unit("px"),
            )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self { workspace: Workspace::default() })
    }
}

impl Perturbation for DefocusBlur {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        disc_blur(src, dst, cx.number("radius"), &mut self.workspace);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::DefocusBlur;
    use crate::golden;

    #[test]
    fn matches_the_published_outputs() {
        golden::matches_outputs::<DefocusBlur>(0.1);
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<DefocusBlur>(&pdk_sdk::serde_json::Value::Null);
    }
}
