//! More saturation: vivid colours, as cameras set for looks make them.

use pdk_sdk::ops::saturation::scale_saturation;
use pdk_sdk::prelude::*;

/// Multiplies the saturation of every pixel by a factor above 1.
pub struct SaturationFilter;

impl Component for SaturationFilter {
    fn description() -> Description {
        Description::perturbation(
            "saturation_filter",
            "Makes colours more vivid, keeping their hue and brightness",
        )
        .family("color")
        .keeps_geometry()
        .source("Smith, Color gamut transform pairs (1978), in 8 bits")
        .mathematics("S' = floor(min(255, factor * S)) in HSV")
        .divergence(
            "The way back from HSV rounds everywhere; the published one truncates in blocks of 32 pixels, which darkens by up to a level.",
        )
        .parameter(
            Parameter::by_level(
                "factor",
                [1.05, 1.15, 1.4, 1.65, 1.9],
                "factor of the saturation, which is clipped at 255",
            )
            .range(0.0, 10.0),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for SaturationFilter {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        scale_saturation(src, dst, cx.number("factor"));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::SaturationFilter;
    use crate::golden;

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<SaturationFilter>();
    }

    #[test]
    fn matches_the_published_outputs() {
        golden::matches_outputs::<SaturationFilter>(0.5);
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<SaturationFilter>(&pdk_sdk::serde_json::Value::Null);
    }
}
