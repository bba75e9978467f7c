//! Shear: a camera mounted askew, or a rolling shutter in a bend.

use pdk_sdk::ops::warp::{Affine, Workspace, warp_affine};
use pdk_sdk::prelude::*;

/// Moves rows sideways, the lower the further.
pub struct ShearImage {
    workspace: Workspace,
}

impl Component for ShearImage {
    fn description() -> Description {
        Description::perturbation("shear_image", "Moves rows to the right, the lower the further, over black")
            .family("affine")
            .moves_geometry()
            .mathematics("x' = x + factor y")
            .source("Affine map x' = x + factor * y with linear interpolation at 1/32 px")
            .not_default()
            .parameter(
                Parameter::by_level(
                    "factor",
                    [0.12, 0.2, 0.32, 0.45, 0.6],
                    "shift to the right for each pixel of height; negative shears to the left",
                )
                .range(-10.0, 10.0)
                .unit("px/px"),
            )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self { workspace: Workspace::default() })
    }
}

impl Perturbation for ShearImage {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        warp_affine(src, dst, &Affine::shear(cx.number("factor")), &mut self.workspace);
        Ok(())
    }

    fn move_points(
        &mut self,
        points: &mut [[f64; 2]],
        way: Way,
        _size: [usize; 2],
        cx: &Context<'_>,
    ) -> Result<()> {
        way.along(&Affine::shear(cx.number("factor")), points);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::serde_json::{Value, json};

    use super::ShearImage;
    use crate::golden;

    #[test]
    fn matches_the_published_outputs() {
        golden::matches_outputs::<ShearImage>(0.1);
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<ShearImage>(&Value::Null);
        golden::writes_exactly_the_frame::<ShearImage>(&json!({"factor": -3.3}));
    }

    #[test]
    fn holds_what_every_perturbation_has_to_hold() {
        pdk_sdk::testing::perturbation::<ShearImage>();
    }

    #[test]
    fn strength_grows_with_the_intensity() {
        golden::strength_grows::<ShearImage>(&Value::Null, &golden::quarters(0.0, 4.0), false);
    }
}
