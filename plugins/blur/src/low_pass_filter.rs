//! Low-pass filter: brightness loses its detail, colours keep their edges.
//!
//! As everywhere in pdk, the way back from hue, saturation and value rounds; the published version drops fractions in
//! blocks of 32 pixels.

use pdk_sdk::ops::low_pass::{Workspace, low_pass};
use pdk_sdk::prelude::*;

use crate::gaussian_blur::nearest_odd;

/// Smooths the value of hue, saturation and value with a Gaussian kernel.
pub struct LowPassFilter {
    workspace: Workspace,
}

impl Component for LowPassFilter {
    fn description() -> Description {
        Description::perturbation(
            "low_pass_filter",
            "Smooths brightness with a Gaussian kernel, keeping hue and saturation",
        )
        .family("blur")
        .keeps_geometry()
        .mathematics("V * G in HSV, hue and saturation kept")
        .divergence("The way back from HSV rounds everywhere; the published one truncates in blocks of 32 pixels, which darkens by up to a level.")
        .source("Gaussian filter on the value of hue, saturation and value, in 8 bits")
        .parameter(
            Parameter::by_level(
                "kernel_size",
                [15.0, 23.0, 31.0, 37.0, 41.0],
                "width of the kernel, rounded to the nearest odd number",
            )
            .range(1.0, 99.0)
            .unit("px"),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self { workspace: Workspace::default() })
    }
}

impl Perturbation for LowPassFilter {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        low_pass(src, dst, nearest_odd(cx.number("kernel_size")), &mut self.workspace);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::LowPassFilter;
    use crate::golden;

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<LowPassFilter>();
    }

    #[test]
    fn matches_the_published_outputs() {
        golden::matches_outputs::<LowPassFilter>(0.5);
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<LowPassFilter>(&pdk_sdk::serde_json::Value::Null);
    }
}
