//! Contrast: hard light.

use pdk_sdk::ops::point::scale_about;
use pdk_sdk::prelude::*;

/// Spreads values away from the middle grey.
pub struct Contrast;

impl Component for Contrast {
    fn description() -> Description {
        Description::perturbation("contrast", "Spreads all values away from the middle grey")
            .family("weather")
            .keeps_geometry()
            .mathematics("clip(127.5 + factor (v - 127.5))")
            .source("Linear map about 127.5, clipped")
            .parameter(
                Parameter::by_level(
                    "factor",
                    [1.1, 1.2, 1.3, 1.5, 1.7],
                    "factor of the distance from the middle grey; below 1 it lowers contrast",
                )
                .range(0.0, 10.0),
            )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for Contrast {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        scale_about(src, dst, 127.5, cx.number("factor"));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::Contrast;
    use crate::golden;

    #[test]
    fn matches_the_published_outputs() {
        golden::matches_outputs::<Contrast>(0.1);
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<Contrast>(&pdk_sdk::serde_json::Value::Null);
    }
}
