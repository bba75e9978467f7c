//! Motion blur: the camera moves while the shutter is open.

use std::f64::consts::PI;

use pdk_sdk::ops::average::{Workspace, pixel_average};
use pdk_sdk::prelude::*;

/// Averages along a line, one pixel in each row.
pub struct MotionBlur {
    neighbours: Vec<(isize, isize)>,
    workspace: Workspace,
}

impl Component for MotionBlur {
    fn description() -> Description {
        Description::perturbation("motion_blur", "Averages every pixel along a slanted line")
            .family("blur")
            .keeps_geometry().mathematics("mean of v along one cell a row of a size x size kernel, x = trunc(tan(angle) (y - c) + c)")
            .source("Average over one pixel in each row of a square kernel, along a line through its middle")
            .parameter(
                Parameter::by_level(
                    "size",
                    [2.0, 4.0, 6.0, 10.0, 15.0],
                    "height of the line, rounded to whole rows; an even one also shifts the frame by half a pixel, which between levels can outweigh the blur",
                )
                .range(1.0, 200.0)
                .unit("px"),
            )
            .parameter(
                Parameter::by_level(
                    "degrees",
                    [5.0, 12.0, 20.0, 30.0, 45.0],
                    "direction of the line, from vertical, positive from top left to bottom right",
                )
                .range(-45.0, 45.0)
                .unit("degrees"),
            )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self { neighbours: Vec::new(), workspace: Workspace::default() })
    }
}

/// The places `(right, down)` that the line covers, relative to the middle of a kernel of `size` rows and columns. An
/// even kernel has its middle right and below of the centre.
fn line(size: usize, degrees: f64, into: &mut Vec<(isize, isize)>) {
    into.clear();
    let middle = (size / 2) as isize;
    let slope = libm::tan(degrees * PI / 180.0);
    for down in -middle..size as isize - middle {
        // Columns lose their fraction towards the left edge of the kernel.
        let column = (slope * down as f64 + middle as f64) as isize;
        if (0..size as isize).contains(&column) {
            into.push((column - middle, down));
        }
    }
}

impl Perturbation for MotionBlur {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        line(cx.integer("size").max(1) as usize, cx.number("degrees"), &mut self.neighbours);
        pixel_average(src, dst, &self.neighbours, &mut self.workspace);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::{MotionBlur, line};
    use crate::golden;

    #[test]
    fn matches_the_published_outputs() {
        golden::matches_outputs::<MotionBlur>(0.1);
    }

    #[test]
    fn writes_exactly_the_frame() {
        golden::writes_exactly_the_frame::<MotionBlur>(&pdk_sdk::serde_json::Value::Null);
    }

    #[test]
    fn lines_cover_the_published_columns() {
        let columns = |size: usize, degrees: f64| {
            let mut places = Vec::new();
            line(size, degrees, &mut places);
            places.iter().map(|&(right, _)| right + (size / 2) as isize).collect::<Vec<_>>()
        };
        assert_eq!(columns(2, 5.0), [0, 1]);
        assert_eq!(columns(4, 12.0), [1, 1, 2, 2]);
        assert_eq!(columns(6, 20.0), [1, 2, 2, 3, 3, 3]);
        assert_eq!(columns(10, 30.0), [2, 2, 3, 3, 4, 5, 5, 6, 6, 7]);
        assert_eq!(columns(15, 45.0), (0..15).collect::<Vec<_>>());
        assert_eq!(columns(1, 45.0), [0]);
    }
}
