//! Canny edges: contours in red over a darkened frame.
//!
//! As published, higher levels have higher thresholds and so fewer edges: what all levels share, the darkening, makes
//! most of the effect, and level 0 is the strongest.

use pdk_sdk::ops::canny::{Workspace, blend_with_edges};
use pdk_sdk::prelude::*;

/// Darkens the frame and marks edges in red.
pub struct CannyEdgesMapping {
    workspace: Workspace,
}

impl Component for CannyEdgesMapping {
    fn description() -> Description {
        Description::perturbation(
            "canny_edges_mapping",
            "Darkens the frame and marks its edges in red; higher levels mark fewer, as published",
        )
        .family("pattern")
        .grows_with(pdk_sdk::serde_json::json!({"weight": [0.1, 0.2, 0.3, 0.4, 0.5]}))
        .source("Canny, A computational approach to edge detection (1986)")
        .mathematics("(1 - weight) * v + weight * red where there is an edge, (1 - weight) * v elsewhere")
        .parameter(
            Parameter::by_level(
                "low_threshold",
                [51.0, 60.0, 75.0, 90.0, 120.0],
                "gradient (Sobel, |dx| + |dy|) above which a pixel continues an edge",
            )
            .range(0.0, 2040.0),
        )
        .parameter(
            Parameter::by_level(
                "high_threshold",
                [151.0, 160.0, 175.0, 190.0, 220.0],
                "gradient above which a pixel starts an edge",
            )
            .range(0.0, 2040.0),
        )
        .parameter(
            Parameter::by_level("weight", [0.3; 5], "share of the edges, red on black, in the result")
                .range(0.0, 1.0),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self { workspace: Workspace::default() })
    }
}

impl Perturbation for CannyEdgesMapping {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let thresholds = (cx.number("low_threshold"), cx.number("high_threshold"));
        blend_with_edges(src, dst, cx.number("weight"), thresholds, &mut self.workspace);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::prelude::*;
    use pdk_sdk::serde_json::{Value, json};

    use super::CannyEdgesMapping;
    use crate::golden;

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<CannyEdgesMapping>();
    }

    #[test]
    fn matches_the_published_outputs() {
        golden::matches_outputs::<CannyEdgesMapping>(0.1);
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<CannyEdgesMapping>(&Value::Null);
    }

    #[test]
    fn full_weight_shows_the_edges_alone() {
        let mut src = FrameBuf::new(20, 10);
        src.as_mut().rows_mut().for_each(|row| row[30..].fill(255));
        let out = golden::perturb::<CannyEdgesMapping>(
            &json!({"weight": 1.0}),
            src.as_ref(),
            0.0,
            &Key::default(),
            0,
        );
        for (i, pixel) in out.data().chunks(3).enumerate() {
            // Of the two columns beside the step, which are equally steep, the left one counts.
            assert_eq!(pixel, if i % 20 == 9 { [255, 0, 0] } else { [0; 3] }, "column {}", i % 20);
        }
    }
}
