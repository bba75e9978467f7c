//! The published high-pass filter, which is an unsharp mask: it keeps the frame and doubles what its blur takes away.

use pdk_sdk::ops::unsharp::{Workspace, unsharp_mask};
use pdk_sdk::prelude::*;

/// Emphasises edges and small parts.
pub struct HighPassFilter {
    workspace: Workspace,
}

impl Component for HighPassFilter {
    fn description() -> Description {
        Description::perturbation(
            "high_pass_filter",
            "Subtracts a Gaussian blur from twice the frame: an unsharp mask, which emphasises edges",
        )
        .family("distortion")
        .keeps_geometry()
        .mathematics("trunc(clip(2 v - v * G))")
        .source("Unsharp mask; the blur's standard deviation is 0.3 * ((size - 1) / 2 - 1) + 0.8")
        .not_default()
        .parameter(
            Parameter::by_level(
                "kernel_size",
                [35.0, 59.0, 83.0, 107.0, 113.0],
                "width of the blur's kernel, rounded to the nearest odd number",
            )
            .range(1.0, 301.0)
            .unit("px"),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self { workspace: Workspace::default() })
    }
}

/// The odd number nearest to `size`.
fn nearest_odd(size: f64) -> usize {
    2 * ((size - 1.0) / 2.0).round() as usize + 1
}

impl Perturbation for HighPassFilter {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        unsharp_mask(src, dst, nearest_odd(cx.number("kernel_size")), &mut self.workspace);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::serde_json::{Value, json};

    use super::{HighPassFilter, nearest_odd};
    use crate::golden;

    #[test]
    fn matches_the_published_outputs() {
        golden::matches_outputs::<HighPassFilter>(0.1);
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<HighPassFilter>(&Value::Null);
        golden::writes_exactly_the_frame::<HighPassFilter>(&json!({"kernel_size": 1}));
        golden::writes_exactly_the_frame::<HighPassFilter>(&json!({"kernel_size": 301}));
    }

    #[test]
    fn holds_what_every_perturbation_has_to_hold() {
        pdk_sdk::testing::perturbation::<HighPassFilter>();
    }

    #[test]
    fn strength_grows_with_the_intensity() {
        golden::strength_grows::<HighPassFilter>(&Value::Null, &golden::quarters(0.0, 4.0), true);
    }

    #[test]
    fn kernel_sizes_are_odd() {
        assert_eq!([1.0, 1.9, 2.1, 35.0, 41.1, 112.5].map(nearest_odd), [1, 1, 3, 35, 41, 113]);
    }
}
