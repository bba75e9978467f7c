//! Smoke: turbulent noise that drifts, folded by more noise.

use pdk_seed::Random;

use crate::canvas::{Canvas, SIZE, smooth};
use crate::effect::Effect;
use crate::noise::Turbulence;

/// Smoke is soft: it is computed on every second pixel.
const STEP: usize = 2;

/// Drifting swathes.
pub struct Smoke {
    density: Turbulence,
    across: Turbulence,
    down: Turbulence,
    light: Turbulence,
}

impl Smoke {
    pub fn new(random: &mut Random) -> Self {
        Self {
            density: Turbulence::new([4, 4, 2], 5, random),
            across: Turbulence::new([2, 2, 2], 3, random),
            down: Turbulence::new([2, 2, 2], 3, random),
            light: Turbulence::new([4, 4, 2], 3, random),
        }
    }
}

impl Effect for Smoke {
    fn draw(&self, time: f32, canvas: &mut Canvas) {
        let (columns, rows) = (SIZE.0 / STEP + 1, SIZE.1 / STEP + 1);
        let mut field = Vec::with_capacity(columns * rows);
        for row in 0..rows {
            for column in 0..columns {
                let x = (column * STEP) as f32 / SIZE.0 as f32;
                let y = (row * STEP) as f32 / SIZE.1 as f32;
                // It drifts by one width, which is where the noise repeats.
                let at = [x - time, y * 0.75, time];
                let fold = [self.across.at(at) * 0.15, self.down.at(at) * 0.20];
                let folded = [at[0] + fold[0], at[1] + fold[1], time];
                let thick = self.density.at(folded);
                let alpha = smooth(-0.24, 0.46, thick) * 0.90;
                let shade = 0.68 + 0.22 * self.light.at([folded[0], folded[1] + 0.03, time]) + 0.08 * thick;
                field.push([alpha, shade]);
            }
        }
        canvas.shade([0.0, 0.0, SIZE.0 as f32, SIZE.1 as f32], |x, y| {
            let (x, y) = ((x - 0.5) / STEP as f32, (y - 0.5) / STEP as f32);
            let (column, row) = (x as usize, y as usize);
            let (right, down) = (x - column as f32, y - row as f32);
            let value = |i: usize| {
                let at = |c: usize, r: usize| field[r * columns + c][i];
                let upper = at(column, row) * (1.0 - right) + at(column + 1, row) * right;
                let lower = at(column, row + 1) * (1.0 - right) + at(column + 1, row + 1) * right;
                upper * (1.0 - down) + lower * down
            };
            let shade = value(1);
            ([shade, shade, shade * 1.01], value(0))
        });
    }
}
