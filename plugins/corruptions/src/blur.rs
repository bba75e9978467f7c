//! Blurs.

use std::f64::consts::PI;

use pdk_sdk::ops::border::reflect;
use pdk_sdk::ops::float::{Edge, Image, Workspace, gaussian, moved, separable, symmetric};
use pdk_sdk::prelude::*;

use crate::suite::corruption;

/// A Gaussian is cut off at so many standard deviations.
const TRUNCATE: f64 = 4.0;

/// The weights of a Gaussian from its middle on.
pub fn weights(sigma: f64) -> Vec<f32> {
    gaussian(sigma, (TRUNCATE * sigma + 0.5) as usize)
}

/// Smooths with a Gaussian.
#[derive(Default)]
pub struct GaussianBlur {
    image: Image,
    workspace: Workspace,
}

impl Component for GaussianBlur {
    fn description() -> Description {
        corruption("gaussian_blur", "Smooths with a Gaussian kernel")
            .mathematics("v * G(sigma), cut off at 4 sigma")
            .parameter(
                Parameter::by_level("sigma", [1.0, 2.0, 3.0, 4.0, 6.0], "standard deviation of the kernel")
                    .range(0.1, 50.0)
                    .unit("px"),
            )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self::default())
    }
}

impl Perturbation for GaussianBlur {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let weights = weights(cx.number("sigma"));
        self.image.read(src);
        separable(&mut self.image, &weights, &weights, Edge::Nearest, &mut self.workspace);
        self.image.write(dst);
        Ok(())
    }
}

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

/// Copies of a moving image, each so far moved right and down, with weights that sum to 1: the half of a Gaussian along a line.
pub fn motion(
    radius: f64,
    sigma: f64,
    degrees: f64,
    (width, height): (usize, usize),
) -> Vec<([isize; 2], f32)> {
    let count = 2 * radius.round() as usize + 1;
    let density = |step: usize| libm::exp(-((step * step) as f64) / (2.0 * sigma * sigma));
    let total: f64 = (0..count).map(density).sum();
    let (right, down) = (libm::cos(degrees * PI / 180.0), libm::sin(degrees * PI / 180.0));
    let mut copies = Vec::with_capacity(count);
    for step in 0..count {
        let by = |part: f64| -(libm::ceil(step as f64 * part - 0.5) as isize);
        let (right, down) = (by(right), by(down));
        // What has moved out of the image is left out, and the image becomes darker, as in the package.
        if right.unsigned_abs() >= width || down.unsigned_abs() >= height {
            break;
        }
        copies.push(([right, down], (density(step) / total) as f32));
    }
    copies
}

/// Blurs along a line at a random angle.
#[derive(Default)]
pub struct MotionBlur {
    image: Image,
    blurred: Image,
    workspace: Workspace,
}

impl Component for MotionBlur {
    fn description() -> Description {
        corruption("motion_blur", "Blurs along a line at a random angle within 45 degrees of the horizontal")
            .mathematics("the sum of copies moved along a line, weighted by the half of a Gaussian")
            .drawn_per_sequence("the angle")
            .parameter(
                Parameter::by_level("radius", [10.0, 15.0, 15.0, 15.0, 20.0], "half the number of copies")
                    .range(0.0, 200.0)
                    .unit("px"),
            )
            .parameter(
                Parameter::by_level(
                    "sigma",
                    [3.0, 5.0, 8.0, 12.0, 15.0],
                    "standard deviation of the weights along the line",
                )
                .range(0.1, 200.0)
                .unit("px"),
            )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self::default())
    }
}

impl Perturbation for MotionBlur {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let degrees = cx.sequence_random().uniform(-45.0, 45.0);
        let copies = motion(cx.number("radius"), cx.number("sigma"), degrees, (src.width(), src.height()));
        self.image.read(src);
        moved(&self.image, &copies, &mut self.blurred, &mut self.workspace);
        self.blurred.write(dst);
        Ok(())
    }
}

/// Smooths, copies pixels from nearby, and smooths again.
#[derive(Default)]
pub struct GlassBlur {
    image: Image,
    scattered: FrameBuf,
    workspace: Workspace,
}

impl Component for GlassBlur {
    fn description() -> Description {
        corruption("glass_blur", "Smooths, gives pixels the colours of random ones nearby, and smooths again")
            .mathematics("G(sigma) * scatter(G(sigma) * v), from the lower right on, each from one that may have changed already")
            .drawn_per_sequence("where pixels come from")
            .parameter(
                Parameter::by_level("sigma", [0.7, 0.9, 1.0, 1.1, 1.5], "standard deviation of both Gaussians")
                    .range(0.1, 20.0)
                    .unit("px"),
            )
            .parameter(
                Parameter::by_level("distance", [1.0, 2.0, 2.0, 3.0, 4.0], "largest distance left and up; right and down one less")
                    .range(1.0, 100.0)
                    .unit("px"),
            )
            .parameter(Parameter::by_level("rounds", [2.0, 1.0, 3.0, 2.0, 2.0], "how often pixels are scattered").range(1.0, 20.0))
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self::default())
    }
}

impl Perturbation for GlassBlur {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let (width, height) = (src.width(), src.height());
        let Self { image, scattered, workspace } = self;
        let weights = weights(cx.number("sigma"));
        image.read(src);
        separable(image, &weights, &weights, Edge::Nearest, workspace);
        scattered.resize(width, height);
        image.write(scattered.as_mut());

        let distance = cx.integer("distance").max(1) as usize;
        let mut random = cx.sequence_random();
        for _ in 0..cx.integer("rounds").max(1) {
            for y in (distance + 1..=height.saturating_sub(distance)).rev() {
                for x in (distance + 1..=width.saturating_sub(distance)).rev() {
                    let right = random.below(2 * distance as u32) as usize;
                    let down = random.below(2 * distance as u32) as usize;
                    let colour = scattered.as_ref().pixel(x + right - distance, y + down - distance);
                    scattered.as_mut().set_pixel(x, y, colour);
                }
            }
        }
        image.read(scattered.as_ref());
        separable(image, &weights, &weights, Edge::Nearest, workspace);
        image.write(dst);
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{frame, perturbed};

    #[test]
    fn pass_the_test_kit() {
        pdk_sdk::testing::perturbation::<GaussianBlur>();
        pdk_sdk::testing::perturbation::<DefocusBlur>();
        pdk_sdk::testing::perturbation::<MotionBlur>();
        pdk_sdk::testing::perturbation::<GlassBlur>();
    }

    #[test]
    fn a_grey_frame_stays_grey() {
        let grey = frame(100, 60, 50);
        for level in [0.0, 1.5, 4.0] {
            for blurred in [
                perturbed::<GaussianBlur>(&grey, level, 1),
                perturbed::<DefocusBlur>(&grey, level, 1),
                perturbed::<MotionBlur>(&grey, level, 1),
                perturbed::<GlassBlur>(&grey, level, 1),
            ] {
                // Fractions are dropped, by glass blur twice; the softened disc of radius 10 weighs a little more than 1, as published.
                assert!(blurred.data().iter().all(|v| (98..=101).contains(v)), "{level}");
            }
        }
    }

    #[test]
    fn the_line_has_the_weights_of_half_a_gaussian() {
        let copies = motion(10.0, 3.0, 0.0, (100, 100));
        assert_eq!(copies.len(), 21);
        assert!((copies.iter().map(|(_, weight)| weight).sum::<f32>() - 1.0).abs() < 1e-5);
        assert!(
            copies
                .iter()
                .enumerate()
                .all(|(step, ([right, down], _))| (*right, *down) == (-(step as isize), 0))
        );
        assert_eq!(motion(10.0, 3.0, 0.0, (5, 5)).len(), 5);
    }
}
