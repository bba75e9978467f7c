//! Poisson noise: few photons.

use pdk_sdk::ops::poisson::{PoissonTable, poisson_noise};
use pdk_sdk::prelude::*;

/// Replaces every value by a photon count. The tables of the last expected count are kept.
pub struct PoissonNoise {
    table: Option<PoissonTable>,
}

impl Component for PoissonNoise {
    fn description() -> Description {
        Description::perturbation(
            "poisson_noise",
            "Replaces every value by a random photon count around it, anew in every frame",
        )
        .family("noise")
        .keeps_geometry().mathematics("255 clip(Poisson(k v/255) / k) for each value").drawn_per_frame("the photon counts")
        .source("Hendrycks and Dietterich, Benchmarking neural network robustness to common corruptions and perturbations (2019)")
        .parameter(
            Parameter::by_level("k", [120.0, 105.0, 87.0, 55.0, 30.0], "photons that a white pixel counts on average")
                .range(1.0, 500.0)
                .unit("photons"),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self { table: None })
    }
}

impl Perturbation for PoissonNoise {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let count = cx.number("k");
        let table = self.table.get_or_insert_with(|| PoissonTable::new(count));
        table.set_count(count);
        poisson_noise(src, dst, table, &mut cx.frame_random());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::PoissonNoise;
    use crate::golden;

    #[test]
    fn matches_the_published_statistics() {
        golden::matches_statistics::<PoissonNoise>();
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<PoissonNoise>(&pdk_sdk::serde_json::Value::Null);
    }

    #[test]
    fn draws_anew_for_every_frame() {
        golden::draws_anew_for_every_frame::<PoissonNoise>();
    }
}
