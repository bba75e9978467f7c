//! Zoom blur: the camera moves towards the scene while the shutter is open.
//!
//! In the published version an edge can darken: where rounding puts the last row or column of an enlargement a trace
//! beyond the last pixel, it counts as black. The variant `published` keeps that, and `corrected` takes the last pixel.
//!
//! The published levels 1 and 2 are about equally strong: the first has more enlargements in smaller steps.

use pdk_sdk::ops::zoom::{Ends, MAX_COUNT, MAX_STEP, Workspace, zoom_blur};
use pdk_sdk::prelude::*;

/// Averages the frame with its enlargements about the middle.
pub struct ZoomBlur {
    workspace: Workspace,
}

impl Component for ZoomBlur {
    fn description() -> Description {
        Description::perturbation("zoom_blur", "Averages the frame with its enlargements about the middle")
            .family("blur")
            .not_default()
            .source("Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations (2019)")
            .parameter(
                Parameter::by_level(
                    "count",
                    [2.0, 12.0, 8.0, 11.0, 11.0],
                    "number of enlargements, the first of which is none; a fraction is the weight of the last",
                )
                .range(0.0, MAX_COUNT),
            )
            .parameter(
                Parameter::by_level(
                    "step",
                    [0.01, 0.01, 0.02, 0.02, 0.03],
                    "difference between the factors of one enlargement and the next",
                )
                .range(0.0, MAX_STEP),
            )
            .parameter(Parameter::choice(
                "variant",
                &["published", "corrected"],
                "published: where rounding leads beyond the last row or column, that of the enlargement is black; corrected: it never is",
            ))
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self { workspace: Workspace::default() })
    }
}

impl Perturbation for ZoomBlur {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let ends = if cx.integer("variant") == 0 { Ends::Black } else { Ends::Kept };
        zoom_blur(src, dst, cx.number("count"), cx.number("step"), ends, &mut self.workspace);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::serde_json::json;

    use super::ZoomBlur;
    use crate::golden;

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<ZoomBlur>();
    }

    #[test]
    fn matches_the_published_outputs() {
        golden::matches_outputs::<ZoomBlur>(0.1);
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<ZoomBlur>(&json!({}));
        golden::writes_exactly_the_frame::<ZoomBlur>(&json!({"variant": "corrected"}));
    }
}
