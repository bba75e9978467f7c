//! Shift: a camera mounted too far to one side.
//!
//! The published shift is in pixels whatever the size of the frame, and at level 0 it is a tenth of a pixel, to the left
//! and down, where all other levels go right and up. The variant `published` keeps that; `corrected` shifts by a share
//! of the width and of the height, to the right and up at every level.

use pdk_sdk::ops::warp::{Affine, Workspace, warp_affine};
use pdk_sdk::prelude::*;

/// Shifts the frame over black.
pub struct TranslateImage {
    workspace: Workspace,
}

impl Component for TranslateImage {
    fn description() -> Description {
        Description::perturbation("translate_image", "Shifts the frame to the right and up, over black")
            .family("affine")
            .moves_geometry().mathematics("x' = x + dx, y' = y + dy").divergence("Only with `variant=corrected`: it moves by shares of the frame's size, and at level 0 to the right and up as well.")
            .source("Shift with linear interpolation at 1/32 px")
            .parameter(
                Parameter::by_level(
                    "shift",
                    [-0.1, 25.0, 40.0, 65.0, 90.0],
                    "shift to the right, and as far up; negative goes left and down",
                )
                .range(-10_000.0, 10_000.0)
                .unit("px")
                .only_for("variant", "published"),
            )
            .parameter(
                Parameter::by_level(
                    "share",
                    [0.04, 0.08, 0.125, 0.2, 0.28],
                    "shift to the right as a share of the width, and up as a share of the height",
                )
                .only_for("variant", "corrected")
                .range(-1.0, 1.0),
            )
            .parameter(Parameter::choice(
                "variant",
                &["published", "corrected"],
                "published: shift in pixels, a tenth of a pixel in the other direction at level 0; corrected: shares of the frame's size",
            ))
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self { workspace: Workspace::default() })
    }
}

impl Perturbation for TranslateImage {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        warp_affine(src, dst, &shift([src.width(), src.height()], cx), &mut self.workspace);
        Ok(())
    }

    fn move_points(
        &mut self,
        points: &mut [[f64; 2]],
        way: Way,
        size: [usize; 2],
        cx: &Context<'_>,
    ) -> Result<()> {
        way.along(&shift(size, cx), points);
        Ok(())
    }
}

/// The shift of a frame of this size.
fn shift([width, height]: [usize; 2], cx: &Context<'_>) -> Affine {
    let (right, up) = if cx.integer("variant") == 0 {
        (cx.number("shift"), cx.number("shift"))
    } else {
        let share = cx.number("share");
        (share * width as f64, share * height as f64)
    };
    Affine::translation(right, -up)
}

#[cfg(test)]
mod tests {
    use pdk_sdk::prelude::*;
    use pdk_sdk::serde_json::{Value, json};

    use super::TranslateImage;
    use crate::golden;

    #[test]
    fn matches_the_published_outputs() {
        golden::matches_outputs::<TranslateImage>(0.1);
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<TranslateImage>(&Value::Null);
        golden::writes_exactly_the_frame::<TranslateImage>(&json!({"variant": "corrected"}));
        golden::writes_exactly_the_frame::<TranslateImage>(&json!({"shift": -3.37}));
    }

    #[test]
    fn holds_what_every_perturbation_has_to_hold() {
        pdk_sdk::testing::perturbation::<TranslateImage>();
    }

    #[test]
    fn strength_grows_with_the_intensity() {
        golden::strength_grows::<TranslateImage>(
            &json!({"variant": "corrected"}),
            &golden::quarters(0.0, 4.0),
            false,
        );
    }

    #[test]
    fn what_the_variant_does_not_use_is_refused() {
        let check = |given: Value| {
            Config::check(&TranslateImage::description(), given.as_object().unwrap())
                .map_err(|e| e.to_string())
        };
        assert!(
            check(json!({"variant": "corrected", "shift": 300})).unwrap_err().contains("variant=published")
        );
        assert!(check(json!({"share": 0.5})).unwrap_err().contains("variant=corrected"));
        assert!(check(json!({"shift": 300})).is_ok());
    }

    #[test]
    fn the_corrected_variant_moves_with_the_size() {
        for size in [10, 100] {
            let mut src = FrameBuf::new(size, size);
            src.as_mut().set_pixel(0, size - 1, [1, 2, 3]);
            let given = json!({"variant": "corrected", "share": 0.3});
            let moved = golden::perturb::<TranslateImage>(&given, src.as_ref(), 0.0, &Key::default(), 0);
            assert_eq!(moved.as_ref().pixel(size * 3 / 10, size - 1 - size * 3 / 10), [1, 2, 3]);
        }
    }
}
