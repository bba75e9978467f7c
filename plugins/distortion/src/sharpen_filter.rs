//! Sharpening: a camera that overdoes it.

use pdk_sdk::ops::sharpen::{Workspace, sharpen};
use pdk_sdk::prelude::*;

/// Blends the frame with a sharpened and brightened one.
pub struct SharpenFilter {
    workspace: Workspace,
}

impl Component for SharpenFilter {
    fn description() -> Description {
        Description::perturbation("sharpen_filter", "Blends the frame with a sharpened and brightened copy")
            .family("distortion")
            .keeps_geometry().mathematics("w v + (1 - w) (v * K), K of -1 with 8 + strength in the middle")
            .source("Laplacian with eight neighbours; its centre is larger by the gain, so it brightens too")
            .parameter(
                Parameter::by_level(
                    "gain",
                    [1.0, 2.0, 3.0, 4.0, 5.0],
                    "sum of the kernel: how much brighter the sharpened copy is than the frame; what it clips loses structure in steps",
                )
                .range(0.0, 100.0),
            )
            .parameter(
                Parameter::by_level(
                    "weight",
                    [0.9, 0.8, 0.7, 0.6, 0.5],
                    "share of the original in the result",
                )
                .range(0.0, 1.0),
            )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self { workspace: Workspace::default() })
    }
}

impl Perturbation for SharpenFilter {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        sharpen(src, dst, cx.number("gain"), cx.number("weight"), &mut self.workspace);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::serde_json::Value;

    use super::SharpenFilter;
    use crate::golden;

    #[test]
    fn matches_the_published_outputs() {
        golden::matches_outputs::<SharpenFilter>(0.1);
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<SharpenFilter>(&Value::Null);
    }

    #[test]
    fn holds_what_every_perturbation_has_to_hold() {
        pdk_sdk::testing::perturbation::<SharpenFilter>();
    }

    #[test]
    fn strength_grows_with_the_intensity() {
        golden::strength_grows::<SharpenFilter>(&Value::Null, &golden::quarters(0.0, 4.0), true);
    }
}
