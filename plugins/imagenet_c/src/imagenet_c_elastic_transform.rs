//! Random, smooth displacements.

use pdk_sdk::ops::displacement::Displacement;
use pdk_sdk::ops::float::{Edge, Image, Workspace, gaussian, separable};
use pdk_sdk::ops::point::truncated;
use pdk_sdk::prelude::*;

use crate::suite::{MadeFor, corruption};

/// Displaces every pixel at random, smoothly.
#[derive(Default)]
pub struct ElasticTransform {
    image: Image,
    made_for: MadeFor,
    right: Image,
    down: Image,
    workspace: Workspace,
}

/// The largest displacement before smoothing, and the standard deviation of the smoothing, as shares of the size.
const DISPLACED: f64 = 0.005;
const SMOOTHED: f64 = 0.01;
/// A Gaussian is cut off at this many standard deviations.
const TRUNCATE: f64 = 3.0;

impl Component for ElasticTransform {
    fn description() -> Description {
        corruption("elastic_transform", "Displaces every pixel at random, smoothly, in the same way in all frames of a sequence")
            .mathematics("v(x + alpha G dx, y + alpha G dy), dx and dy uniform within 0.005 of the height, G with 0.01 of each side")
            .drawn_per_sequence("the displacements")
            .moves_geometry()
            .parameter(
                Parameter::by_level("alpha", [12.5, 16.25, 21.25, 25.0, 30.0], "what displacements are multiplied by")
                    .range(0.0, 1000.0),
            )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self::default())
    }
}

impl Perturbation for ElasticTransform {
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let (width, height) = (src.width(), src.height());
        self.prepare([width, height], cx);
        self.image.read(src);
        let alpha = cx.number("alpha") as f32;
        for (y, to) in dst.rows_mut().enumerate() {
            let moved = self.right.row(y).iter().zip(self.down.row(y));
            for ((x, to), (right, down)) in to.chunks_exact_mut(3).enumerate().zip(moved) {
                let (left, share_x) = whole(x as f32 + alpha * right);
                let (top, share_y) = whole(y as f32 + alpha * down);
                let columns = [0, 1].map(|next| mirrored(left + next, width) * 3);
                let rows = [0, 1].map(|next| self.image.row(mirrored(top + next, height)));
                for (channel, to) in to.iter_mut().enumerate() {
                    let between = |row: &[f32]| {
                        let (a, b) = (row[columns[0] + channel], row[columns[1] + channel]);
                        a + (b - a) * share_x
                    };
                    let (above, below) = (between(rows[0]), between(rows[1]));
                    *to = truncated(above + (below - above) * share_y);
                }
            }
        }
        Ok(())
    }

    fn move_points(
        &mut self,
        points: &mut [[f64; 2]],
        way: Way,
        [width, height]: [usize; 2],
        cx: &Context<'_>,
    ) -> Result<()> {
        self.prepare([width, height], cx);
        let alpha = cx.number("alpha") as f32;
        let mut sources = Vec::with_capacity(width * height);
        for y in 0..height {
            let moved = self.right.row(y).iter().zip(self.down.row(y)).enumerate();
            sources
                .extend(moved.map(|(x, (right, down))| [x as f32 + alpha * right, y as f32 + alpha * down]));
        }
        let displaced = Displacement::new(width, height, sources);
        points.iter_mut().for_each(|point| {
            *point = match way {
                Way::ToPerturbed => displaced.to_perturbed(*point),
                Way::ToSource => displaced.to_source(*point),
            };
        });
        Ok(())
    }
}

/// The whole part of a number, which goes down also below 0, and the rest.
fn whole(value: f32) -> (isize, f32) {
    let cut = value as isize;
    let whole = if value < cut as f32 { cut - 1 } else { cut };
    (whole, value - whole as f32)
}

/// A place in a row that goes on mirrored.
fn mirrored(index: isize, length: usize) -> usize {
    match usize::try_from(index) {
        Ok(inside) if inside < length => inside,
        _ => Edge::Symmetric.place(index, length),
    }
}

impl ElasticTransform {
    /// Draws, unless it was drawn for such frames already.
    fn prepare(&mut self, [width, height]: [usize; 2], cx: &Context<'_>) {
        if self.made_for.is_new([width, height], Some(*cx.key()), &[]) {
            self.draw(width, height, &mut cx.sequence_random());
        }
    }

    /// The displacements, which `alpha` multiplies.
    fn draw(&mut self, width: usize, height: usize, random: &mut Random) {
        let kernel = |length: usize| {
            let sigma = SMOOTHED * length as f64;
            gaussian(sigma, (TRUNCATE * sigma + 0.5) as usize)
        };
        let most = DISPLACED * height as f64;
        for field in [&mut self.right, &mut self.down] {
            field.resize(width, height, 1);
            field.values.iter_mut().for_each(|value| *value = random.uniform(-most, most) as f32);
            separable(field, &kernel(height), &kernel(width), Edge::Symmetric, &mut self.workspace);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{perturbed, stays_grey};

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<ElasticTransform>();
    }

    #[test]
    fn a_grey_frame_stays_grey() {
        stays_grey::<ElasticTransform>(&[0.0, 4.0], 99..=100);
    }

    #[test]
    fn displacements_stay_for_a_sequence_and_grow_with_the_level() {
        let src = pdk_sdk::testing::sample_frame(100, 80);
        let [weak, strong, other] =
            [(0.0, 1), (4.0, 1), (0.0, 2)].map(|(l, key)| perturbed::<ElasticTransform>(&src, l, key));
        let difference = |a: &FrameBuf| {
            let pairs = a.data().iter().zip(src.data());
            pairs.map(|(a, b)| f64::from(a.abs_diff(*b))).sum::<f64>()
        };
        assert!(difference(&weak) < difference(&strong));
        assert_ne!(weak, other);
    }
}
