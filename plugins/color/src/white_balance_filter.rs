//! White balance: the camera takes the scene's mean colour for grey.

use pdk_sdk::ops::white_balance::blend_with_grey_world;
use pdk_sdk::prelude::*;

/// Blends the frame with its grey-world correction.
pub struct WhiteBalanceFilter;

impl Component for WhiteBalanceFilter {
    fn description() -> Description {
        Description::perturbation(
            "white_balance_filter",
            "Blends the frame with a version whose channels have equal means",
        )
        .family("color")
        .keeps_geometry()
        .source("Buchsbaum, A spatial processor model for object colour perception (1980): the grey-world assumption")
        .mathematics("(1 - weight) * v + weight * min(255, v * mean of the channel means / mean of the channel)")
        .divergence("A channel without any light stays black; the published tool divides by zero.")
        .parameter(
            Parameter::by_level("weight", [0.1, 0.25, 0.5, 0.75, 0.99], "share of the correction in the result")
                .range(0.0, 1.0),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for WhiteBalanceFilter {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        blend_with_grey_world(src, dst, cx.number("weight"));
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::WhiteBalanceFilter;
    use crate::golden;

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<WhiteBalanceFilter>();
    }

    #[test]
    fn matches_the_published_outputs() {
        golden::matches_outputs::<WhiteBalanceFilter>(0.1);
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<WhiteBalanceFilter>(&pdk_sdk::serde_json::Value::Null);
    }
}
