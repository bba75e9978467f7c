//! Fog: a fractal field over the frame.

use pdk_sdk::ops::point::truncated;
use pdk_sdk::prelude::*;

use crate::suite::{MadeFor, corruption};

/// Adds a fractal field, and darkens so that the brightest pixel stays within range.
#[derive(Default)]
pub struct Fog {
    made_for: MadeFor,
    /// From 0 to 1, for each pixel.
    field: Vec<f32>,
    /// What is added to each value of a row.
    row: Vec<f32>,
}

impl Component for Fog {
    fn description() -> Description {
        corruption("fog", "Adds a fractal field of grey, the same one in all frames of a sequence")
            .mathematics("(v + t field) m / (m + t), m the frame's largest value; the field by midpoint displacement on a torus")
            .drawn_per_sequence("the field")
            .parameter(Parameter::by_level("thickness", [1.5, 2.0, 2.5, 2.5, 3.0], "weight of the field").range(0.0, 100.0))
            .parameter(
                Parameter::by_level("decay", [2.0, 2.0, 1.7, 1.5, 1.4], "how much weaker the field is at each finer scale")
                    .range(1.0, 10.0),
            )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self::default())
    }
}

impl Perturbation for Fog {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let (width, height) = (src.width(), src.height());
        let decay = cx.number("decay");
        if self.made_for.is_new([src.width(), src.height()], Some(*cx.key()), &[decay]) {
            let side = width.max(height).max(3).next_power_of_two();
            let plane = plane(side, decay, &mut cx.sequence_random());
            self.field.clear();
            plane.chunks_exact(side).take(height).for_each(|row| self.field.extend_from_slice(&row[..width]));
        }
        self.row.resize(3 * width, 0.0);
        let thickness = cx.number("thickness");
        let most = f64::from(src.rows().flatten().copied().max().unwrap_or(0)) / 255.0;
        let share = if most + thickness > 0.0 { (most / (most + thickness)) as f32 } else { 0.0 };
        let added = (255.0 * thickness) as f32;
        for ((from, to), field) in src.rows().zip(dst.rows_mut()).zip(self.field.chunks_exact(width)) {
            for (spread, field) in self.row.chunks_exact_mut(3).zip(field) {
                spread.fill(added * field);
            }
            for ((&from, to), field) in from.iter().zip(to).zip(&self.row) {
                *to = truncated((f32::from(from) + field) * share);
            }
        }
        Ok(())
    }
}

/// A square of midpoint displacement on a torus, from 0 to 1; `side` is a power of two.
fn plane(side: usize, decay: f64, random: &mut Random) -> Vec<f32> {
    let mut plane = vec![0.0f32; side * side];
    let wrap = side - 1;
    let mut amplitude = 100.0f64;
    let mut step = side;
    while step >= 2 {
        let half = step / 2;
        // The square of the amplitude, as published.
        let range = (amplitude * amplitude) as f32;
        let mut draw = || (random.next_u32() >> 8) as f32 * (range / (1 << 23) as f32) - range;
        for y in (0..side).step_by(step) {
            for x in (0..side).step_by(step) {
                let (right, down) = ((x + step) & wrap, (y + step) & wrap);
                let sum = plane[y * side + x]
                    + plane[down * side + x]
                    + plane[y * side + right]
                    + plane[down * side + right];
                plane[(y + half) * side + x + half] = sum / 4.0 + draw();
            }
        }
        for y in (0..side).step_by(step) {
            for x in (0..side).step_by(step) {
                let middle = |x: usize, y: usize| plane[((y + half) & wrap) * side + ((x + half) & wrap)];
                let here = plane[y * side + x];
                let above =
                    middle(x, y) + middle(x, y + side - step) + here + plane[y * side + ((x + step) & wrap)];
                let left =
                    middle(x, y) + middle(x + side - step, y) + here + plane[((y + step) & wrap) * side + x];
                plane[y * side + x + half] = above / 4.0 + draw();
                plane[(y + half) * side + x] = left / 4.0 + draw();
            }
        }
        step = half;
        amplitude /= decay;
    }
    let low = plane.iter().copied().fold(f32::INFINITY, f32::min);
    let high = plane.iter().copied().fold(f32::NEG_INFINITY, f32::max);
    let scale = if high > low { 1.0 / (high - low) } else { 0.0 };
    plane.iter_mut().for_each(|value| *value = (*value - low) * scale);
    plane
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{frame, perturbed};

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<Fog>();
        crate::allocations::on_the_first_frames_alone::<Fog>();
    }

    #[test]
    fn the_field_has_the_whole_range_and_no_seam() {
        let side = 64;
        let field = plane(side, 2.0, &mut Key([1; 32]).sequence());
        assert!(field.contains(&0.0) && field.contains(&1.0));
        let step = |a: usize, b: usize| (field[a] - field[b]).abs();
        let inside: f32 = (0..side).map(|y| step(y * side + 30, y * side + 31)).sum();
        let across: f32 = (0..side).map(|y| step(y * side + side - 1, y * side)).sum();
        assert!(across < 2.0 * inside, "{across} {inside}");
    }

    #[test]
    fn fog_hides_what_is_dark_and_stays_for_a_sequence() {
        let dark = frame(60, 90, 70);
        let mean = |frame: &FrameBuf| {
            frame.data().iter().map(|&v| f64::from(v)).sum::<f64>() / frame.data().len() as f64
        };
        let (light, dense) = (perturbed::<Fog>(&dark, 0.0, 1), perturbed::<Fog>(&dark, 4.0, 1));
        assert!(light != dense && mean(&light) > 0.0);
        assert_ne!(light, perturbed::<Fog>(&dark, 0.0, 2));
    }
}
