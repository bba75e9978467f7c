//! Histogram equalisation: the tone mapping of a camera that lifts shadows, overdone.
//!
//! The limit is a whole number of pixels of a tile, as published, so small frames have few different strengths between two
//! levels. Just above level 0 most of a tile's pixels exceed the limit and are spread evenly, which changes more than
//! level 1 does.

use pdk_sdk::ops::equalise::{Workspace, equalise_value};
use pdk_sdk::prelude::*;

/// Equalises brightness in tiles.
pub struct HistogramEqualisation {
    workspace: Workspace,
}

impl Component for HistogramEqualisation {
    fn description() -> Description {
        Description::perturbation(
            "histogram_equalisation",
            "Equalises the histogram of the brightness in 8x8 tiles, under a limit of contrast",
        )
        .family("color")
        .keeps_geometry()
        .grows_with(pdk_sdk::serde_json::json!({"clip_limit": [3, 5, 7, 10, 15]}))
        .source("Zuiderveld, Contrast limited adaptive histogram equalization (1994)")
        .mathematics("V' = 255 * the share of values up to V in the clipped histogram of its tile, bilinear between tiles")
        .divergence("The way back from HSV rounds everywhere; the published one truncates in blocks of 32 pixels, which darkens by up to a level.")
        .parameter(
            Parameter::by_level(
                "clip_limit",
                [1.0, 3.0, 5.0, 7.0, 10.0],
                "largest share of a value in a tile, as a multiple of its share in a flat histogram",
            )
            .range(0.0, 256.0),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self { workspace: Workspace::default() })
    }
}

impl Perturbation for HistogramEqualisation {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        equalise_value(src, dst, cx.number("clip_limit"), &mut self.workspace);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::HistogramEqualisation;
    use crate::golden;

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<HistogramEqualisation>();
    }

    #[test]
    fn matches_the_published_outputs() {
        golden::matches_outputs::<HistogramEqualisation>(0.5);
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<HistogramEqualisation>(&pdk_sdk::serde_json::Value::Null);
    }
}
