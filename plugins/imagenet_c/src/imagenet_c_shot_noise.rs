//! Shot noise: counts of photons.

use pdk_sdk::ops::poisson::{PoissonTable, poisson_noise};
use pdk_sdk::prelude::*;

use crate::suite::corruption;

/// Replaces values by photon counts.
pub struct ShotNoise {
    table: PoissonTable,
}

impl Component for ShotNoise {
    fn description() -> Description {
        corruption(
            "shot_noise",
            "Replaces every value by a random photon count around it, anew in every frame",
        )
        .mathematics("255 clip(Poisson(k v/255) / k) for each value")
        .drawn_per_frame("the counts")
        .parameter(
            Parameter::by_level("k", [60.0, 25.0, 12.0, 5.0, 3.0], "photons that a white pixel counts")
                .range(1.0, 500.0),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self { table: PoissonTable::truncated(60.0) })
    }
}

impl Perturbation for ShotNoise {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        self.table.set_count(cx.number("k"));
        poisson_noise(src, dst, &self.table, &mut cx.frame_random());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{frame, perturbed};

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<ShotNoise>();
    }

    #[test]
    fn the_noise_has_its_mean_and_deviation() {
        let (mean, deviation) =
            crate::testing::moments(&perturbed::<ShotNoise>(&frame(128, 200, 200), 0.0, 1));
        let wanted = 255.0 * (128.0f64 / 255.0 / 60.0).sqrt();
        assert!(
            (mean - 127.6).abs() < 0.5 && (deviation - wanted).abs() < 0.5,
            "{mean} {deviation} {wanted}"
        );
    }
}
