//! Occlusion: what changes when a patch covers a part of the frame.

use pdk_sdk::prelude::*;

use super::grid::{Grid, sign_parameter};
use super::method::{Map, Method, blend, fill, fill_parameter, pixels};
use super::viewer::{Viewer, parameters};

/// Occlusion as a component.
pub type Occlusion = Map<Patches>;

/// A patch at every place.
pub struct Patches {
    patch: f64,
    fill: String,
}

impl Method for Patches {
    fn description() -> Description {
        let description = Description::saliency(
            "occlusion",
            "By how much the output changes when a patch covers each part, without gradients",
        )
        .family("no gradient")
        .gradient_free()
        .source("Zeiler and Fergus, \"Visualizing and Understanding Convolutional Networks\" (2014)")
        .mathematics("`map = mean(f(x) - f(x covered))` over all patches that cover a pixel");
        parameters(description)
            .parameter(sign_parameter())
            .parameter(
                Parameter::number("patch", 0.2, "side of the patch, as a share of the shorter side of the model's image; it moves by half of that")
                    .range(0.01, 1.0),
            )
            .parameter(fill_parameter())
    }

    fn new(_: &mut Viewer, config: &Config) -> Result<Self> {
        Ok(Self { patch: config.number("patch"), fill: config.text("fill").to_owned() })
    }

    fn cells(&self, viewer: &Viewer) -> [usize; 2] {
        let (width, height) = viewer.size();
        [height, width]
    }

    fn grid(&mut self, viewer: &mut Viewer, frame: Frame<'_>, _: &MapContext<'_>) -> Result<Grid> {
        let (width, height) = viewer.size();
        let color = fill(frame, &self.fill);
        let side = ((self.patch * width.min(height) as f64).round() as usize).max(1);
        let base = viewer.answer(frame)?;
        let mut masked = FrameBuf::new(width, height);
        let mut grid = pixels(viewer);
        let mut covered = vec![0.0; width * height];
        let mut shares = vec![1.0f32; width * height];
        for top in starts(height, side) {
            for left in starts(width, side) {
                let rows = top..(top + side).min(height);
                let columns = left..(left + side).min(width);
                for y in rows.clone() {
                    shares[y * width..][columns.clone()].fill(0.0);
                }
                blend(frame, color, &shares, masked.as_mut());
                let change = base - viewer.answer(masked.as_ref())?;
                for y in rows {
                    for x in columns.clone() {
                        let at = y * width + x;
                        (grid.values[at], covered[at], shares[at]) =
                            (grid.values[at] + change, covered[at] + 1.0, 1.0);
                    }
                }
            }
        }
        grid.values.iter_mut().zip(&covered).for_each(|(sum, count)| *sum /= count);
        Ok(grid)
    }
}

/// Where patches begin along an axis: every half side, the last one at the end.
fn starts(length: usize, side: usize) -> Vec<usize> {
    let last = length.saturating_sub(side);
    let mut starts: Vec<_> = (0..last).step_by((side / 2).max(1)).collect();
    starts.push(last);
    starts
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn patches_cover_every_pixel() {
        for (length, side) in [(10, 4), (7, 1), (3, 5), (120, 24), (1, 1)] {
            let mut covered = vec![false; length];
            for start in starts(length, side) {
                covered[start..(start + side).min(length)].fill(true);
            }
            assert!(covered.into_iter().all(|covered| covered), "{length} {side}");
        }
        assert_eq!(starts(10, 4), [0, 2, 4, 6]);
    }
}
