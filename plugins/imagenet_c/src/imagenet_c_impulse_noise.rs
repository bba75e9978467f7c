//! Impulses: black and white values.

use pdk_sdk::prelude::*;

use crate::suite::corruption;

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{frame, perturbed};

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<ImpulseNoise>();
    }

    #[test]
    fn the_share_of_values_is_hit_half_of_them_white() {
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
}
