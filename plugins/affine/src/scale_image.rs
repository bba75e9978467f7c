//! Scale: a lens with too short a focal length.

use pdk_sdk::ops::resize::resize_linear;
use pdk_sdk::ops::warp::Affine;
use pdk_sdk::prelude::*;

/// Shrinks the frame and puts it in the middle of a black one.
pub struct ScaleImage;

impl Component for ScaleImage {
    fn description() -> Description {
        Description::perturbation("scale_image", "Shrinks the frame and puts it in the middle of black")
            .family("affine")
            .moves_geometry()
            .mathematics("image shrunk by factor, centred on black")
            .source("Linear interpolation without averaging")
            .parameter(
                Parameter::by_level(
                    "factor",
                    [0.96, 0.9, 0.8, 0.68, 0.5],
                    "factor of width and height, which are rounded down to whole pixels",
                )
                .range(0.01, 1.0),
            )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for ScaleImage {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let Middle { left, top, width, height } = Middle::of([src.width(), src.height()], cx);
        for (y, row) in dst.rows_mut().enumerate() {
            if (top..top + height).contains(&y) {
                row[..left * 3].fill(0);
                row[(left + width) * 3..].fill(0);
            } else {
                row.fill(0);
            }
        }
        let stride = dst.stride();
        let middle = &mut dst.data_mut()[top * stride + left * 3..];
        resize_linear(src, FrameMut::with_stride(middle, width, height, stride).map_err(Error::new)?);
        Ok(())
    }

    fn move_points(
        &mut self,
        points: &mut [[f64; 2]],
        way: Way,
        size: [usize; 2],
        cx: &Context<'_>,
    ) -> Result<()> {
        let Middle { left, top, width, height } = Middle::of(size, cx);
        // The edges of the frame come to lie on those of the middle, half a pixel outside of the centres of its first and last pixels.
        let along = |from: usize, start: usize, to: usize| {
            let scale = to as f64 / from as f64;
            (scale, start as f64 + 0.5 * scale - 0.5)
        };
        let ((across, x), (down, y)) = (along(size[0], left, width), along(size[1], top, height));
        way.along(&Affine([across, 0.0, x, 0.0, down, y]), points);
        Ok(())
    }
}

/// The part of the frame that the shrunk one covers, in pixels.
struct Middle {
    left: usize,
    top: usize,
    width: usize,
    height: usize,
}

impl Middle {
    fn of([width, height]: [usize; 2], cx: &Context<'_>) -> Self {
        let factor = cx.number("factor");
        let scaled = |length: usize| ((length as f64 * factor) as usize).max(1);
        let (inner, lower) = (scaled(width), scaled(height));
        Self { left: (width - inner) / 2, top: (height - lower) / 2, width: inner, height: lower }
    }
}

#[cfg(test)]
mod tests {
    use pdk_sdk::serde_json::{Value, json};

    use super::ScaleImage;
    use crate::golden;

    #[test]
    fn matches_the_published_outputs() {
        golden::matches_outputs::<ScaleImage>(0.1);
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<ScaleImage>(&Value::Null);
        golden::writes_exactly_the_frame::<ScaleImage>(&json!({"factor": 1.0}));
        golden::writes_exactly_the_frame::<ScaleImage>(&json!({"factor": 0.01}));
    }

    #[test]
    fn holds_what_every_perturbation_has_to_hold() {
        pdk_sdk::testing::perturbation::<ScaleImage>();
    }

    #[test]
    fn strength_grows_with_the_intensity() {
        golden::strength_grows::<ScaleImage>(&Value::Null, &golden::quarters(0.0, 4.0), false);
    }
}
