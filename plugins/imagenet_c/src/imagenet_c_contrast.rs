//! Less contrast.

use pdk_sdk::ops::point::lookup_by_channel;
use pdk_sdk::ops::white_balance::channel_sums;
use pdk_sdk::prelude::*;

use crate::suite::corruption;

/// Takes contrast away.
pub struct Contrast;

impl Component for Contrast {
    fn description() -> Description {
        corruption("contrast", "Draws the values of each channel together about their mean")
            .mathematics("factor (v - mean) + mean, for each channel")
            .parameter(
                Parameter::by_level("factor", [0.4, 0.3, 0.2, 0.1, 0.05], "what is left of the contrast")
                    .range(0.0, 10.0),
            )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for Contrast {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let (factor, count) = (cx.number("factor"), (src.width() * src.height()) as f64);
        let tables = channel_sums(src).map(|sum| {
            let mean = sum as f64 / count / 255.0;
            let drawn =
                |value: usize| ((value as f64 / 255.0 - mean) * factor + mean).clamp(0.0, 1.0) * 255.0;
            std::array::from_fn::<u8, 256, _>(|value| drawn(value) as u8)
        });
        lookup_by_channel(src, dst, &tables);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{frame, perturbed};

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<Contrast>();
    }

    #[test]
    fn contrast_draws_together_about_the_mean() {
        let src = FrameBuf::from_vec([[0, 0, 0], [200, 100, 50]].concat(), 2, 1).unwrap();
        let drawn = perturbed::<Contrast>(&src, 0.0, 1);
        assert_eq!(drawn.data(), [60, 30, 15, 140, 70, 35]);
        assert_eq!(perturbed::<Contrast>(&frame(77, 9, 9), 4.0, 1).data()[0], 77);
    }
}
