//! Increased brightness: low sun, over-exposure.
//!
//! Hue and saturation keep the 8-bit steps of the published version. On the way back to RGB this one rounds; the
//! published one drops fractions in blocks of 32 pixels and rounds in the rest of a row, which darkens by up to a level.

use pdk_sdk::ops::hsv::scale_hsv;
use pdk_sdk::prelude::*;

/// Multiplies the value of every pixel's hue, saturation and value.
pub struct IncreaseBrightness;

impl Component for IncreaseBrightness {
    fn description() -> Description {
        Description::perturbation(
            "increase_brightness",
            "Multiplies the brightness of every pixel, keeping its hue and saturation",
        )
        .family("weather")
        .keeps_geometry().mathematics("V' = min(255, trunc(factor V)) in HSV").divergence("The way back from HSV rounds everywhere; the published one truncates in blocks of 32 pixels, which darkens by up to a level.")
        .source("Smith, Color gamut transform pairs (1978), in 8 bits")
        .parameter(
            Parameter::by_level(
                "factor",
                [1.1, 1.2, 1.3, 1.5, 1.7],
                "factor of the brightness, which is clipped at 255; below 1 it darkens",
            )
            .range(0.0, 10.0),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for IncreaseBrightness {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        scale_hsv(src, dst, 1.0, cx.number("factor"));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::IncreaseBrightness;
    use crate::golden;

    #[test]
    fn matches_the_published_outputs() {
        golden::matches_outputs::<IncreaseBrightness>(0.5);
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<IncreaseBrightness>(&pdk_sdk::serde_json::Value::Null);
    }
}
