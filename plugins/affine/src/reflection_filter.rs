//! Reflection: a puddle or a shiny bonnet below the scene.

use pdk_sdk::ops::resize::{Source, resize_linear_from};
use pdk_sdk::prelude::*;

/// Puts the bottom of the frame, upside down, under the frame.
pub struct ReflectionFilter;

impl Component for ReflectionFilter {
    fn description() -> Description {
        Description::perturbation(
            "reflection_filter",
            "Stacks the bottom of the frame, upside down, under the frame and squeezes both to its height",
        )
        .family("affine")
        .moves_geometry()
        .mathematics("image over its bottom share, flipped, squeezed to the height")
        .source("Linear interpolation without averaging")
        .not_default()
        .parameter(
            Parameter::by_level(
                "share",
                [0.2, 0.3, 0.45, 0.6, 0.9],
                "share of the height that is reflected, rounded down to whole rows",
            )
            .range(0.0, 1.0),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for ReflectionFilter {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let height = src.height();
        let reflected = reflected(height, cx);
        let row = |y: usize| src.row(if y < height { y } else { 2 * height - 1 - y });
        resize_linear_from(Source { width: src.width(), height: height + reflected, row: &row }, dst);
        Ok(())
    }

    /// Things are squeezed upwards. What is seen below them is their mirror image, which only the way back knows.
    fn move_points(
        &mut self,
        points: &mut [[f64; 2]],
        way: Way,
        [_, height]: [usize; 2],
        cx: &Context<'_>,
    ) -> Result<()> {
        let stacked = (height + reflected(height, cx)) as f64;
        let height = height as f64;
        for [_, y] in points {
            *y = match way {
                Way::ToPerturbed => (*y + 0.5) * height / stacked - 0.5,
                Way::ToSource => {
                    let below = (*y + 0.5) * stacked / height;
                    (if below > height { 2.0 * height - below } else { below }) - 0.5
                }
            };
        }
        Ok(())
    }
}

/// The rows that are reflected.
fn reflected(height: usize, cx: &Context<'_>) -> usize {
    ((height as f64 * cx.number("share")) as usize).min(height)
}

#[cfg(test)]
mod tests {
    use pdk_sdk::prelude::*;
    use pdk_sdk::serde_json::{Value, json};

    use super::ReflectionFilter;
    use crate::golden;

    #[test]
    fn matches_the_published_outputs() {
        golden::matches_outputs::<ReflectionFilter>(0.1);
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<ReflectionFilter>(&Value::Null);
        golden::writes_exactly_the_frame::<ReflectionFilter>(&json!({"share": 1.0}));
    }

    #[test]
    fn holds_what_every_perturbation_has_to_hold() {
        pdk_sdk::testing::perturbation::<ReflectionFilter>();
    }

    #[test]
    fn strength_grows_with_the_intensity() {
        golden::strength_grows::<ReflectionFilter>(&Value::Null, &golden::quarters(0.0, 4.0), false);
    }

    #[test]
    fn a_full_reflection_is_symmetric() {
        let src = FrameBuf::from_vec((0..6 * 8 * 3).map(|i| (i * 89 % 251) as u8).collect(), 6, 8).unwrap();
        let whole = json!({"share": 1.0});
        let out = golden::perturb::<ReflectionFilter>(&whole, src.as_ref(), 0.0, &Key::default(), 0);
        for y in 0..8 {
            assert_eq!(out.as_ref().row(y), out.as_ref().row(7 - y));
        }
    }
}
