//! Rotation: a camera mounted with a roll.
//!
//! The published centre is half the width and half the height, counted from the centre of the first pixel, so it lies
//! half a pixel right and below of the middle of the image: at 180 degrees the first row and column are black.

use pdk_sdk::ops::warp::{Affine, Workspace, warp_affine};
use pdk_sdk::prelude::*;

/// Rotates the frame over black.
pub struct RotateImage {
    workspace: Workspace,
}

impl Component for RotateImage {
    fn description() -> Description {
        Description::perturbation(
            "rotate_image",
            "Rotates the frame counter-clockwise over black; half a turn (level 4) can be closer to the original than a quarter",
        )
        .family("affine")
        .moves_geometry()
        .grows_with(pdk_sdk::serde_json::json!({"degrees": [2, 5, 10, 20, 45]})).mathematics("rotation by angle about (W/2, H/2)")
        .source("Rotation about half the width and height with linear interpolation at 1/32 px")
        .not_default()
        .parameter(
            Parameter::by_level(
                "degrees",
                [10.0, 20.0, 45.0, 90.0, 180.0],
                "angle, counter-clockwise; negative turns clockwise",
            )
            .range(-360.0, 360.0)
            .unit("degrees"),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self { workspace: Workspace::default() })
    }
}

impl Perturbation for RotateImage {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        warp_affine(src, dst, &rotation([src.width(), src.height()], cx), &mut self.workspace);
        Ok(())
    }

    fn move_points(
        &mut self,
        points: &mut [[f64; 2]],
        way: Way,
        size: [usize; 2],
        cx: &Context<'_>,
    ) -> Result<()> {
        way.along(&rotation(size, cx), points);
        Ok(())
    }
}

/// The rotation of a frame of this size.
fn rotation([width, height]: [usize; 2], cx: &Context<'_>) -> Affine {
    Affine::rotation(cx.number("degrees"), width as f64 / 2.0, height as f64 / 2.0)
}

#[cfg(test)]
mod tests {
    use pdk_sdk::prelude::*;
    use pdk_sdk::serde_json::{Value, json};

    use super::RotateImage;
    use crate::golden;

    #[test]
    fn matches_the_published_outputs() {
        golden::matches_outputs::<RotateImage>(0.1);
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<RotateImage>(&Value::Null);
        golden::writes_exactly_the_frame::<RotateImage>(&json!({"degrees": -33.3}));
    }

    #[test]
    fn holds_what_every_perturbation_has_to_hold() {
        pdk_sdk::testing::perturbation::<RotateImage>();
    }

    #[test]
    fn strength_grows_with_the_intensity() {
        golden::strength_grows::<RotateImage>(&Value::Null, &golden::quarters(0.0, 2.0), false);
    }

    #[test]
    fn half_a_turn_puts_the_last_pixel_behind_the_first() {
        let mut src = FrameBuf::new(8, 6);
        src.as_mut().set_pixel(7, 5, [10, 200, 30]);
        let turned = golden::perturb::<RotateImage>(&Value::Null, src.as_ref(), 4.0, &Key::default(), 0);
        assert_eq!(turned.as_ref().pixel(1, 1), [10, 200, 30]);
        assert_eq!(turned.data().iter().filter(|&&v| v != 0).count(), 3);
    }
}
