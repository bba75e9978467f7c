//! Defocus: a disc with soft edges.

use pdk_sdk::ops::border::reflect;
use pdk_sdk::ops::float::{Edge, Image, Workspace, gaussian, symmetric};
use pdk_sdk::prelude::*;

use crate::suite::corruption;

/// Averages over a disc.
#[derive(Default)]
pub struct DefocusBlur {
    image: Image,
    blurred: Image,
    workspace: Workspace,
}

impl Component for DefocusBlur {
    fn description() -> Description {
        corruption("defocus_blur", "Averages every pixel over a disc with soft edges")
            .mathematics("v * (disc(radius) * G(edge))")
            .parameter(
                Parameter::by_level("radius", [3.0, 4.0, 6.0, 8.0, 10.0], "radius of the disc")
                    .range(0.0, 60.0)
                    .unit("px"),
            )
            .parameter(
                Parameter::by_level(
                    "edge",
                    [0.1, 0.5, 0.5, 0.5, 0.5],
                    "standard deviation of what softens its edge",
                )
                .range(0.01, 5.0)
                .unit("px"),
            )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self::default())
    }
}

impl Perturbation for DefocusBlur {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        self.image.read(src);
        let disc = disc(cx.number("radius"), cx.number("edge"));
        symmetric(&self.image, &disc, Edge::Mirrored, &mut self.blurred, &mut self.workspace);
        self.blurred.write(dst);
        Ok(())
    }
}

/// The weights of a disc from its middle on, softened by a Gaussian of 3 or, for large ones, 5 values.
fn disc(radius: f64, edge: f64) -> Vec<Vec<f32>> {
    let (reach, soft) = if radius <= 8.0 { (8, 1) } else { (radius.ceil() as usize, 2) };
    let size = 2 * reach + 1;
    let inside = |x: usize, y: usize| {
        let (x, y) = (x as f64 - reach as f64, y as f64 - reach as f64);
        x * x + y * y <= radius * radius
    };
    let count = (0..size * size).filter(|place| inside(place % size, place / size)).count() as f64;
    let around = gaussian(edge, soft);
    let softened = |x: usize, y: usize| {
        let mut sum = 0.0;
        for down in -(soft as isize)..=soft as isize {
            for right in -(soft as isize)..=soft as isize {
                let weight = around[right.unsigned_abs()] * around[down.unsigned_abs()];
                if inside(reflect(x as isize + right, size), reflect(y as isize + down, size)) {
                    sum += f64::from(weight) / count;
                }
            }
        }
        sum as f32
    };
    (reach..size).map(|y| (reach..size).map(|x| softened(x, y)).collect()).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::stays_grey;

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<DefocusBlur>();
    }

    #[test]
    fn a_grey_frame_stays_grey() {
        stays_grey::<DefocusBlur>(&[0.0, 1.5, 4.0], 98..=101);
    }
}
