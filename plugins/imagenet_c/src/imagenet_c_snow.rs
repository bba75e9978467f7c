//! Snow: flakes blown across a frame that is a little whiter.

use pdk_sdk::ops::float::{Image, Workspace, moved};
use pdk_sdk::ops::rgbx;
use pdk_sdk::ops::zoom::Grid;
use pdk_sdk::prelude::*;

use crate::enlarge::{self, enlarge};
use crate::line::motion;
use crate::simd::vectorised;
use crate::suite::corruption;

/// Lays streaks of snow over the frame, and the same ones upside down.
#[derive(Default)]
pub struct Snow {
    drawn: Image,
    flakes: Image,
    streaks: Image,
    workspace: Workspace,
    enlarged: enlarge::Workspace,
    /// A row of the frame, followed by the byte that the last pixel is read with.
    row: Vec<u8>,
    /// For each pixel of a row how much snow covers it, and the grey that it is whitened to.
    snow: Vec<f32>,
    white: Vec<f32>,
    /// A row of the result.
    pixels: Vec<[f32; 4]>,
    bytes: Vec<[u8; 4]>,
}

impl Component for Snow {
    fn description() -> Description {
        corruption("snow", "Lays streaks of snow over the frame and whitens it, anew in every frame")
            .mathematics("w v + (1 - w) max(v, 1.5 grey + 0.5) + streaks + streaks turned round")
            .drawn_per_frame("the flakes, and where the wind comes from")
            .parameter(
                Parameter::by_level(
                    "mean",
                    [0.1, 0.2, 0.55, 0.55, 0.55],
                    "mean of what flakes are drawn from",
                )
                .range(-5.0, 5.0),
            )
            .parameter(
                Parameter::by_level("deviation", [0.3; 5], "standard deviation of that").range(0.0, 5.0),
            )
            .parameter(
                Parameter::by_level("size", [3.0, 2.0, 4.0, 4.5, 2.5], "how much flakes are enlarged")
                    .range(1.0, 20.0),
            )
            .parameter(
                Parameter::by_level(
                    "threshold",
                    [0.5, 0.5, 0.9, 0.85, 0.85],
                    "values below it are not flakes",
                )
                .range(-5.0, 5.0),
            )
            .parameter(
                Parameter::by_level("radius", [10.0, 12.0, 12.0, 12.0, 12.0], "half the length of a streak")
                    .range(0.0, 100.0)
                    .unit("px"),
            )
            .parameter(
                Parameter::by_level("sigma", [4.0, 4.0, 8.0, 8.0, 12.0], "how far streaks fade")
                    .range(0.1, 100.0)
                    .unit("px"),
            )
            .parameter(
                Parameter::by_level("weight", [0.8, 0.7, 0.7, 0.65, 0.55], "share of the frame as it was")
                    .range(0.0, 1.0),
            )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self::default())
    }
}

impl Perturbation for Snow {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let (width, height) = (src.width(), src.height());
        let mut random = cx.frame_random();
        self.draw(width, height, cx, &mut random);
        let copies =
            motion(cx.number("radius"), cx.number("sigma"), random.uniform(-135.0, -45.0), (width, height));
        moved(&self.flakes, &copies, &mut self.streaks, &mut self.workspace);

        let weight = cx.number("weight") as f32;
        let Self { streaks, row, snow, white, pixels, bytes, .. } = self;
        row.resize(3 * width + 1, 0);
        snow.resize(width, 0.0);
        white.resize(width, 0.0);
        pixels.resize(width, [0.0; 4]);
        bytes.resize(width, [0; 4]);
        for (y, (from, to)) in src.rows().zip(dst.rows_mut()).enumerate() {
            row[..3 * width].copy_from_slice(from);
            add_turned(streaks.row(y), streaks.row(height - 1 - y), snow);
            whiten(from, white);
            cover(row, white, snow, weight, pixels);
            rgbx::truncate(pixels, bytes, to);
        }
        Ok(())
    }
}

/// Adding this to a number from 0 to 2^22, and subtracting it again, rounds it half to even.
const ROUNDING: f32 = 8_388_608.0;

/// In whole grey levels, which is where a streak ends.
#[inline(always)]
fn levels(streak: f32) -> f32 {
    streak * 255.0 + ROUNDING - ROUNDING
}

vectorised! {
    // A row of streaks, and a row of the same ones turned round.
    fn add_turned / add_turned_avx2 / add_turned_avx512 (streaks: &[f32], turned: &[f32], snow: &mut [f32]) {
        for ((snow, &streak), &turned) in snow.iter_mut().zip(streaks).zip(turned.iter().rev()) {
            *snow = levels(streak) + levels(turned);
        }
    }
}

vectorised! {
    fn whiten / whiten_avx2 (from: &[u8], white: &mut [f32]) {
        for (from, white) in from.chunks_exact(3).zip(white) {
            let [r, g, b] = [0, 1, 2].map(|channel| f32::from(from[channel]));
            *white = (0.299 * r + 0.587 * g + 0.114 * b) * 1.5 + 127.5;
        }
    }
}

vectorised! {
    fn cover / cover_avx2 (row: &[u8], white: &[f32], snow: &[f32], weight: f32, to: &mut [[f32; 4]]) {
        for (x, ((&white, &snow), to)) in white.iter().zip(snow).zip(to).enumerate() {
            for (to, &value) in to.iter_mut().zip(&row[3 * x..][..4]) {
                let value = f32::from(value);
                let whitened = weight * value + (1.0 - weight) * value.max(white);
                *to = whitened + snow;
            }
        }
    }
}

vectorised! {
    fn keep_flakes / keep_flakes_avx2 / keep_flakes_avx512 (values: &[f32], threshold: f32, flakes: &mut [f32]) {
        for (flake, &value) in flakes.iter_mut().zip(values) {
            *flake = if value < threshold { 0.0 } else { value.clamp(0.0, 1.0) };
        }
    }
}

impl Snow {
    /// Flakes from 0 to 1. Only those in the middle are drawn, since only they are enlarged.
    fn draw(&mut self, width: usize, height: usize, cx: &Context<'_>, random: &mut Random) {
        let size = cx.number("size");
        let (columns, rows) = (Grid::new(width, size), Grid::new(height, size));
        let (left, top) = ((width - columns.count()) / 2, (height - rows.count()) / 2);
        self.drawn.resize(width, height, 1);
        let (mean, deviation) = (cx.number("mean"), cx.number("deviation"));
        for y in top..top + rows.count() {
            for value in &mut self.drawn.values[y * width + left..][..columns.count()] {
                *value = (mean + deviation * random.normal()) as f32;
            }
        }
        let threshold = cx.number("threshold") as f32;
        self.flakes.resize(width, height, 1);
        let flakes = &mut self.flakes.values;
        enlarge(&self.drawn, size, &mut self.enlarged, |y, row| {
            keep_flakes(row, threshold, &mut flakes[y * width..][..width]);
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{frame, perturbed};

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<Snow>();
    }

    #[test]
    fn keeps_nothing_that_does_not_fit() {
        crate::testing::keeps_nothing_that_does_not_fit::<Snow>();
    }

    #[test]
    fn streaks_are_rounded_half_to_even() {
        for sixteenth in 0..=16 * 255 {
            let grey = sixteenth as f32 / 16.0;
            let streak = grey / 255.0;
            assert_eq!(levels(streak), (streak * 255.0).round_ties_even(), "{grey}");
        }
    }

    #[test]
    fn snow_whitens_and_has_flakes() {
        let dark = frame(40, 120, 90);
        let snowy = perturbed::<Snow>(&dark, 2.0, 1);
        let ground = 0.7 * 40.0 + 0.3 * (60.0 + 127.5);
        let least = snowy.data().iter().min().copied().unwrap();
        assert!((f64::from(least) - ground).abs() <= 1.0, "{least} {ground}");
        assert!(snowy.data().iter().filter(|&&v| f64::from(v) > ground + 40.0).count() > 300);
    }
}
