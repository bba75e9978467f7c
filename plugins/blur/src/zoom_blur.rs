//! Zoom blur: the camera moves towards the scene while the shutter is open.
//!
//! The published version crops and enlarges by whole pixels, so that the middle of an enlargement can lie up to a pixel
//! off, and strength rises and falls a little between the levels (levels 1 and 2 are about equally strong). Where
//! rounding puts the last row or column of an enlargement a trace beyond the last pixel, it counts as black, which
//! darkens that edge. The variant `published` keeps all that, and `corrected` enlarges exactly about the middle.

use pdk_sdk::ops::zoom::{Enlargement, MAX_COUNT, MAX_STEP, Workspace, zoom_blur};
use pdk_sdk::prelude::*;

/// Averages the frame with its enlargements about the middle.
pub struct ZoomBlur {
    workspace: Workspace,
}

impl Component for ZoomBlur {
    fn description() -> Description {
        Description::perturbation("zoom_blur", "Averages the frame with its enlargements about the middle")
            .family("blur")
            .keeps_geometry()
        .grows_with(pdk_sdk::serde_json::json!({"variant": "corrected", "count": [2, 4, 6, 8, 11], "step": 0.02})).mathematics("(v + sum of zoom(v, z) over the n factors z) / (n + 1)").divergence("Only with `variant=corrected`: it enlarges exactly about the middle instead of in crops of whole pixels, so that strength does not rise and fall between levels.")
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
                "published: enlargements of whole pixels, up to a pixel off the middle, whose last row or column may be black; corrected: exactly about the middle",
            ))
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self { workspace: Workspace::default() })
    }
}

impl Perturbation for ZoomBlur {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let enlargement =
            if cx.integer("variant") == 0 { Enlargement::WholePixels } else { Enlargement::Exact };
        zoom_blur(src, dst, cx.number("count"), cx.number("step"), enlargement, &mut self.workspace);
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
