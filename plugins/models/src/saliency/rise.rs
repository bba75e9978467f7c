//! RISE: what the network answers behind many random masks.

use pdk_sdk::prelude::*;

use super::grid::{Grid, sign_parameter};
use super::method::{Map, Method, blend, fill, fill_parameter, pixels};
use super::viewer::{Viewer, parameters};

/// RISE as a component.
pub type Rise = Map<Masks>;

/// Random masks.
pub struct Masks {
    samples: usize,
    cells: usize,
    kept: f64,
    fill: String,
}

impl Method for Masks {
    fn description() -> Description {
        let description = Description::saliency("rise", "The mean output over random masks that leave each pixel, without gradients")
            .family("no gradient")
            .gradient_free()
            .source("Petsiuk et al., \"RISE: Randomized Input Sampling for Explanation of Black-box Models\" (2018)")
            .mathematics("`map = E[f(x ∘ M) | M = 1] - E[f(x ∘ M)]`, estimated over masks `M` from a coarse grid")
            .divergence("The mean over all masks is subtracted, so that a pixel without influence has the value 0 whatever the output is.")
            .drawn_per_sequence("the masks");
        parameters(description)
            .parameter(sign_parameter())
            .parameter(Parameter::integer("samples", 400, "how many masks are tried").range(1.0, 1e6))
            .parameter(
                Parameter::integer("cells", 8, "how many cells a mask has downwards and to the right")
                    .range(2.0, 64.0),
            )
            .parameter(
                Parameter::number("kept", 0.5, "the share of cells that a mask leaves").range(0.01, 0.99),
            )
            .parameter(fill_parameter())
    }

    fn new(_: &mut Viewer, config: &Config) -> Result<Self> {
        Ok(Self {
            samples: config.integer("samples") as usize,
            cells: config.integer("cells") as usize,
            kept: config.number("kept"),
            fill: config.text("fill").to_owned(),
        })
    }

    fn cells(&self, viewer: &Viewer) -> [usize; 2] {
        let (width, height) = viewer.size();
        [height, width]
    }

    fn grid(&mut self, viewer: &mut Viewer, frame: Frame<'_>, cx: &MapContext<'_>) -> Result<Grid> {
        let (width, height) = viewer.size();
        let color = fill(frame, &self.fill);
        let mut random = cx.sequence_random();
        let mut shares = vec![0.0f32; width * height];
        let mut masked = FrameBuf::new(width, height);
        let mut grid = pixels(viewer);
        let (mut left, mut total) = (vec![0.0; width * height], 0.0);
        for _ in 0..self.samples {
            self.draw(&mut random, width, height, &mut shares);
            blend(frame, color, &shares, masked.as_mut());
            let answer = viewer.answer(masked.as_ref())?;
            total += answer;
            for ((sum, left), &share) in grid.values.iter_mut().zip(&mut left).zip(&shares) {
                *sum += answer * f64::from(share);
                *left += f64::from(share);
            }
        }
        let mean = total / self.samples as f64;
        for (sum, &left) in grid.values.iter_mut().zip(&left) {
            *sum = if left > 0.0 { *sum / left - mean } else { 0.0 };
        }
        Ok(grid)
    }
}

impl Masks {
    /// Draws a mask: cells that are left or not, shifted by a part of a cell, with soft edges.
    fn draw(&self, random: &mut Random, width: usize, height: usize, shares: &mut [f32]) {
        let cells = self.cells;
        let side = cells + 2;
        let left: Vec<f64> =
            (0..side * side).map(|_| f64::from(u8::from(random.unit() < self.kept))).collect();
        let (down, right) = (random.unit(), random.unit());
        let place = |pixel: usize, length: usize, shift: f64| {
            let at = (pixel as f64 + 0.5) * cells as f64 / length as f64 + shift;
            (at as usize, at - at.floor())
        };
        for y in 0..height {
            let (row, share_down) = place(y, height, down);
            for x in 0..width {
                let (column, share) = place(x, width, right);
                let at = |row: usize, column: usize| left[row.min(side - 1) * side + column.min(side - 1)];
                let above = at(row, column) + (at(row, column + 1) - at(row, column)) * share;
                let below = at(row + 1, column) + (at(row + 1, column + 1) - at(row + 1, column)) * share;
                shares[y * width + x] = (above + (below - above) * share_down) as f32;
            }
        }
    }
}
