//! Less saturation: haze, dusk, or a cheap sensor.

use pdk_sdk::ops::saturation::scale_saturation;
use pdk_sdk::prelude::*;

/// Multiplies the saturation of every pixel by a factor below 1.
pub struct SaturationDecreaseFilter;

impl Component for SaturationDecreaseFilter {
    fn description() -> Description {
        Description::perturbation(
            "saturation_decrease_filter",
            "Makes colours paler, keeping their hue and brightness",
        )
        .family("color")
        .keeps_geometry()
        .source("Smith, Color gamut transform pairs (1978), in 8 bits")
        .mathematics("S' = floor(factor * S) in HSV")
        .divergence(
            "The way back from HSV rounds everywhere; the published one truncates in blocks of 32 pixels, which darkens by up to a level.",
        )
        .parameter(
            Parameter::by_level("factor", [0.9, 0.85, 0.6, 0.35, 0.1], "factor of the saturation")
                .range(0.0, 1.0),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for SaturationDecreaseFilter {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        scale_saturation(src, dst, cx.number("factor"));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::SaturationDecreaseFilter;
    use crate::golden;

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<SaturationDecreaseFilter>();
    }

    #[test]
    fn matches_the_published_outputs() {
        golden::matches_outputs::<SaturationDecreaseFilter>(0.5);
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<SaturationDecreaseFilter>(&pdk_sdk::serde_json::Value::Null);
    }
}
