//! Gaussian blur.

use pdk_sdk::ops::float::{Edge, Workspace, separable_frame};
use pdk_sdk::prelude::*;

use crate::gaussian::weights;
use crate::suite::corruption;

/// Smooths with a Gaussian.
#[derive(Default)]
pub struct GaussianBlur {
    workspace: Workspace,
}

impl Component for GaussianBlur {
    fn description() -> Description {
        corruption("gaussian_blur", "Smooths with a Gaussian kernel")
            .mathematics("v * G(sigma), cut off at 4 sigma")
            .parameter(
                Parameter::by_level("sigma", [1.0, 2.0, 3.0, 4.0, 6.0], "standard deviation of the kernel")
                    .range(0.1, 50.0)
                    .unit("px"),
            )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self::default())
    }
}

impl Perturbation for GaussianBlur {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let weights = weights(cx.number("sigma"));
        separable_frame(src, dst, &weights, &weights, Edge::Nearest, &mut self.workspace);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::stays_grey;

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<GaussianBlur>();
    }

    #[test]
    fn keeps_nothing_that_does_not_fit() {
        crate::testing::keeps_nothing_that_does_not_fit::<GaussianBlur>();
    }

    #[test]
    fn a_grey_frame_stays_grey() {
        stays_grey::<GaussianBlur>(&[0.0, 1.5, 4.0], 98..=101);
    }
}
