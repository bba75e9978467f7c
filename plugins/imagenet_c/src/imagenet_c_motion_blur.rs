//! Motion blur along a line.

use pdk_sdk::ops::float::{Workspace, moved_frame};
use pdk_sdk::prelude::*;

use crate::line::motion;
use crate::suite::corruption;

/// Blurs along a line at a random angle.
#[derive(Default)]
pub struct MotionBlur {
    workspace: Workspace,
}

impl Component for MotionBlur {
    fn description() -> Description {
        corruption("motion_blur", "Blurs along a line at a random angle within 45 degrees of the horizontal")
            .mathematics("the sum of copies moved along a line, weighted by the half of a Gaussian")
            .drawn_per_sequence("the angle")
            .parameter(
                Parameter::by_level("radius", [10.0, 15.0, 15.0, 15.0, 20.0], "half the number of copies")
                    .range(0.0, 200.0)
                    .unit("px"),
            )
            .parameter(
                Parameter::by_level(
                    "sigma",
                    [3.0, 5.0, 8.0, 12.0, 15.0],
                    "standard deviation of the weights along the line",
                )
                .range(0.1, 200.0)
                .unit("px"),
            )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self::default())
    }
}

impl Perturbation for MotionBlur {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let degrees = cx.sequence_random().uniform(-45.0, 45.0);
        let copies = motion(cx.number("radius"), cx.number("sigma"), degrees, (src.width(), src.height()));
        moved_frame(src, dst, &copies, &mut self.workspace);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::stays_grey;

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<MotionBlur>();
    }

    #[test]
    fn keeps_nothing_that_does_not_fit() {
        crate::testing::keeps_nothing_that_does_not_fit::<MotionBlur>();
    }

    #[test]
    fn a_grey_frame_stays_grey() {
        stays_grey::<MotionBlur>(&[0.0, 1.5, 4.0], 98..=101);
    }
}
