//! Grey: colours fade.

use pdk_sdk::ops::blend::blend_with_grey;
use pdk_sdk::prelude::*;

/// Blends the frame with its own grey.
pub struct GrayscaleFilter;

impl Component for GrayscaleFilter {
    fn description() -> Description {
        Description::perturbation("grayscale_filter", "Blends the frame with its own grey")
            .family("color")
            .keeps_geometry()
            .mathematics("(1 - s) v + s grey")
            .source("Luma of ITU-R BT.601")
            .parameter(
                Parameter::by_level(
                    "weight",
                    [0.1, 0.2, 0.35, 0.55, 0.85],
                    "share of the grey in the result",
                )
                .range(0.0, 1.0),
            )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for GrayscaleFilter {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        blend_with_grey(src, dst, cx.number("weight"));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::GrayscaleFilter;
    use crate::golden;

    #[test]
    fn matches_the_published_outputs() {
        golden::matches_outputs::<GrayscaleFilter>(0.1);
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<GrayscaleFilter>(&pdk_sdk::serde_json::Value::Null);
    }
}
