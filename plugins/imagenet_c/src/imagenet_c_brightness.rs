//! More brightness.

use pdk_sdk::ops::float_hsv::{Change, change_hsv};
use pdk_sdk::prelude::*;

use crate::suite::corruption;

/// Adds to the brightness.
pub struct Brightness;

impl Component for Brightness {
    fn description() -> Description {
        corruption("brightness", "Adds to the brightness of every pixel, keeping its hue and saturation")
            .mathematics("HSV: V = clip(V + added)")
            .parameter(
                Parameter::by_level("added", [0.1, 0.2, 0.3, 0.4, 0.5], "what is added, of full scale")
                    .range(-1.0, 1.0),
            )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for Brightness {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        change_hsv(src, dst, Change { value_added: cx.number("added"), ..Change::NONE });
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::changes_pixel;

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<Brightness>();
        crate::allocations::on_the_first_frames_alone::<Brightness>();
    }

    #[test]
    fn colours_keep_their_hue() {
        changes_pixel::<Brightness>([100, 50, 0], 0.0, [125, 62, 0]);
        changes_pixel::<Brightness>([0, 0, 0], 0.0, [25; 3]);
        changes_pixel::<Brightness>([200, 100, 50], 4.0, [255, 127, 63]);
    }
}
