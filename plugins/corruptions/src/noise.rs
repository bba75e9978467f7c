//! Noise, drawn anew for every frame.

use pdk_sdk::ops::noise::{gaussian_noise_truncated, speckle_noise};
use pdk_sdk::ops::poisson::{PoissonTable, poisson_noise};
use pdk_sdk::prelude::*;

use crate::suite::corruption;

/// Adds normally distributed noise.
pub struct GaussianNoise;

impl Component for GaussianNoise {
    fn description() -> Description {
        corruption("gaussian_noise", "Adds normally distributed noise to every value, anew in every frame")
            .mathematics("255 clip(v/255 + n), n ~ N(0, sigma) for each value")
            .drawn_per_frame("the noise")
            .parameter(
                Parameter::by_level(
                    "sigma",
                    [0.08, 0.12, 0.18, 0.26, 0.38],
                    "standard deviation of the noise",
                )
                .range(0.0, 1.0)
                .unit("of full scale"),
            )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for GaussianNoise {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        gaussian_noise_truncated(src, dst, cx.number("sigma"), &mut cx.frame_random());
        Ok(())
    }
}

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

/// Sets values to 0 and 255.
pub struct ImpulseNoise {
    bytes: Vec<u8>,
}

impl Component for ImpulseNoise {
    fn description() -> Description {
        corruption("impulse_noise", "Sets random values to 0 or 255, anew in every frame")
            .mathematics("0 or 255 with p/2 each, else v, for each value")
            .drawn_per_frame("which values, and to what")
            .parameter(
                Parameter::by_level(
                    "share",
                    [0.03, 0.06, 0.09, 0.17, 0.27],
                    "share of the values that are hit",
                )
                .range(0.0, 1.0),
            )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self { bytes: Vec::new() })
    }
}

impl Perturbation for ImpulseNoise {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        // In parts of 65536: half of those that are hit become black.
        let hit = (cx.number("share") * 65536.0).round() as u32;
        let mut random = cx.frame_random();
        for (from, to) in src.rows().zip(dst.rows_mut()) {
            self.bytes.resize(2 * from.len(), 0);
            random.fill(&mut self.bytes);
            for ((&from, to), drawn) in from.iter().zip(to).zip(self.bytes.chunks_exact(2)) {
                let drawn = u32::from(u16::from_le_bytes([drawn[0], drawn[1]]));
                let impulse = if drawn & 1 == 0 { 0 } else { 255 };
                *to = if drawn < hit { impulse } else { from };
            }
        }
        Ok(())
    }
}

/// Multiplies values by normally distributed numbers.
pub struct SpeckleNoise;

impl Component for SpeckleNoise {
    fn description() -> Description {
        corruption(
            "speckle_noise",
            "Multiplies every value by a normally distributed number around 1, anew in every frame",
        )
        .mathematics("255 clip(v/255 (1 + n)), n ~ N(0, sigma) for each value")
        .drawn_per_frame("the noise")
        .parameter(
            Parameter::by_level("sigma", [0.15, 0.2, 0.35, 0.45, 0.6], "standard deviation of the factors")
                .range(0.0, 1.0),
        )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self)
    }
}

impl Perturbation for SpeckleNoise {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        speckle_noise(src, dst, cx.number("sigma"), &mut cx.frame_random());
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{frame, perturbed};

    #[test]
    fn pass_the_test_kit() {
        pdk_sdk::testing::perturbation::<GaussianNoise>();
        pdk_sdk::testing::perturbation::<ShotNoise>();
        pdk_sdk::testing::perturbation::<ImpulseNoise>();
        pdk_sdk::testing::perturbation::<SpeckleNoise>();
    }

    #[test]
    fn so_many_values_are_hit_half_of_them_white() {
        let grey = frame(128, 200, 200);
        for (level, share) in [(0.0, 0.03), (4.0, 0.27)] {
            let hit = perturbed::<ImpulseNoise>(&grey, level, 1);
            let count = |value: u8| hit.data().iter().filter(|&&v| v == value).count() as f64 / 120_000.0;
            assert!(
                (count(0) - share / 2.0).abs() < 0.01 && (count(255) - share / 2.0).abs() < 0.01,
                "{level}"
            );
            assert_eq!(count(0) + count(255) + count(128), 1.0);
        }
    }

    #[test]
    fn noise_has_its_mean_and_deviation() {
        let grey = frame(128, 200, 200);
        let moments = |frame: &FrameBuf| {
            let values: Vec<f64> = frame.data().iter().map(|&v| f64::from(v)).collect();
            let mean = values.iter().sum::<f64>() / values.len() as f64;
            let variance = values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / values.len() as f64;
            (mean, variance.sqrt())
        };
        // The dropped fraction takes half a level of the mean.
        let (mean, deviation) = moments(&perturbed::<GaussianNoise>(&grey, 0.0, 1));
        assert!((mean - 127.5).abs() < 0.3 && (deviation - 0.08 * 255.0).abs() < 0.3, "{mean} {deviation}");
        let (mean, deviation) = moments(&perturbed::<ShotNoise>(&grey, 0.0, 1));
        let wanted = 255.0 * (128.0f64 / 255.0 / 60.0).sqrt();
        assert!(
            (mean - 127.6).abs() < 0.5 && (deviation - wanted).abs() < 0.5,
            "{mean} {deviation} {wanted}"
        );
        let (mean, deviation) = moments(&perturbed::<SpeckleNoise>(&grey, 0.0, 1));
        assert!((mean - 127.5).abs() < 0.5 && (deviation - 0.15 * 128.0).abs() < 0.5, "{mean} {deviation}");
    }
}
