//! More or less saturation.

use pdk_sdk::ops::float_hsv::{Change, change_hsv};
use pdk_sdk::prelude::*;

use crate::suite::corruption;

/// Multiplies the saturation and adds to it.
pub struct Saturate;

impl Component for Saturate {
    fn description() -> Description {
        corruption(
            "saturate",
            "Makes colours paler or more vivid; what is added to the saturation of grey makes it red",
        )
        .mathematics("HSV: S = clip(factor S + added)")
        .parameter(
            Parameter::by_level("factor", [0.3, 0.1, 2.0, 5.0, 20.0], "what saturation is multiplied by")
                .range(0.0, 100.0),
        )
        .parameter(
            Parameter::by_level("added", [0.0, 0.0, 0.0, 0.1, 0.2], "what is added then").range(-1.0, 1.0),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for Saturate {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let change = Change {
            saturation_factor: cx.number("factor"),
            saturation_added: cx.number("added"),
            ..Change::NONE
        };
        change_hsv(src, dst, change);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::changes_pixel;

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<Saturate>();
    }

    #[test]
    fn colours_keep_their_hue() {
        changes_pixel::<Saturate>([200, 100, 0], 0.0, [200, 170, 140]);
        changes_pixel::<Saturate>([10, 100, 200], 2.0, [0, 94, 200]);
        changes_pixel::<Saturate>([200, 150, 100], 2.0, [200, 100, 0]);
        // What grey becomes where something is added.
        changes_pixel::<Saturate>([100; 3], 4.0, [100, 80, 80]);
    }
}
