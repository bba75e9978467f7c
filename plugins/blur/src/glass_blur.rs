//! Glass blur: a pane of frosted glass in front of the lens.
//!
//! Where the glass takes the light from is drawn once per sequence, since the pane moves with the camera.

use pdk_sdk::ops::scatter::{Workspace, scatter};
use pdk_sdk::prelude::*;

/// Gives every pixel the colour of another one nearby.
pub struct GlassBlur {
    workspace: Workspace,
}

impl Component for GlassBlur {
    fn description() -> Description {
        Description::perturbation(
            "glass_blur",
            "Gives every pixel the colour of a random pixel nearby, the same one in all frames of a sequence",
        )
        .family("blur")
        .keeps_geometry().mathematics("v(x + dx, y + dy), dx and dy uniform whole numbers in [-distance, distance]").drawn_per_sequence("the offsets of all pixels")
        .divergence("Drawn once per sequence; the published tool draws anew on every call, as `draws=per_frame` does.")
        .not_default()
        .source("Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations (2019), without its smoothing")
        .parameter(
            Parameter::by_level(
                "distance",
                [2.0, 5.0, 6.0, 9.0, 12.0],
                "largest distance in each direction, every whole number of pixels up to it equally likely",
            )
            .range(0.0, 1000.0)
            .unit("px"),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self { workspace: Workspace::default() })
    }
}

impl Perturbation for GlassBlur {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        scatter(src, dst, cx.number("distance"), *cx.key(), &mut self.workspace);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::prelude::*;
    use pdk_sdk::serde_json::{Value, json};

    use super::GlassBlur;
    use crate::golden;

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<GlassBlur>();
    }

    #[test]
    fn matches_the_published_statistics() {
        golden::matches_statistics::<GlassBlur>();
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<GlassBlur>(&Value::Null);
    }

    #[test]
    fn the_pane_stays_for_a_sequence_and_differs_between_sequences() {
        let src = pdk_sdk::testing::sample_frame(64, 48);
        let frame =
            |key, index| golden::perturb::<GlassBlur>(&json!({}), src.as_ref(), 2.0, &Key([key; 32]), index);
        assert_eq!(frame(1, 0), frame(1, 9));
        assert_ne!(frame(1, 0), frame(2, 0));
    }
}
