//! Zoom blur: the mean of enlargements.

use pdk_sdk::ops::zoom::{Enlargement, Workspace, zoom_blur};
use pdk_sdk::prelude::*;

use crate::suite::corruption;

/// Averages the frame with its enlargements.
#[derive(Default)]
pub struct ZoomBlur {
    workspace: Workspace,
}

impl Component for ZoomBlur {
    fn description() -> Description {
        corruption("zoom_blur", "Averages the frame with its enlargements about the middle")
            .mathematics("(v + sum of its zooms by 1 + i step, i < count) / (count + 1)")
            .parameter(
                Parameter::by_level("count", [12.0, 16.0, 11.0, 13.0, 11.0], "number of enlargements")
                    .range(0.0, 200.0),
            )
            .parameter(
                Parameter::by_level("step", [0.01, 0.01, 0.02, 0.02, 0.03], "from one factor to the next")
                    .range(0.0, 1.0),
            )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self::default())
    }
}

impl Perturbation for ZoomBlur {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let count = cx.integer("count").max(0) as f64;
        zoom_blur(src, dst, count, cx.number("step"), Enlargement::Corner, &mut self.workspace);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::stays_grey;

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<ZoomBlur>();
    }

    #[test]
    fn keeps_nothing_that_does_not_fit() {
        crate::testing::keeps_nothing_that_does_not_fit::<ZoomBlur>();
    }

    #[test]
    fn a_grey_frame_stays_grey() {
        stays_grey::<ZoomBlur>(&[4.0], 99..=101);
    }
}
