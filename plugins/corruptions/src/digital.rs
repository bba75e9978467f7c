//! Corruptions by digital processing.

use pdk_sdk::ops::float::{Edge, Image, Workspace, gaussian, separable};
use pdk_sdk::ops::jpeg::{self, ChannelOrder, jpeg};
use pdk_sdk::prelude::*;

use crate::suite::{MadeFor, corruption};

/// Compresses and decompresses.
#[derive(Default)]
pub struct JpegCompression {
    workspace: jpeg::Workspace,
}

impl Component for JpegCompression {
    fn description() -> Description {
        corruption("jpeg_compression", "Compresses the frame as JPEG and decompresses it again")
            .mathematics("decode(encode(v, quality)), colour at half the resolution")
            .parameter(
                Parameter::by_level("quality", [25.0, 18.0, 15.0, 10.0, 7.0], "quality, 1 for the coarsest")
                    .range(1.0, 100.0),
            )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self::default())
    }
}

impl Perturbation for JpegCompression {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        jpeg(src, dst, cx.number("quality").round(), ChannelOrder::Rgb, &mut self.workspace);
        Ok(())
    }
}

/// Shrinks, and enlarges to blocks.
#[derive(Default)]
pub struct Pixelate {
    narrow: FrameBuf,
    small: FrameBuf,
    sums: Vec<u32>,
}

impl Component for Pixelate {
    fn description() -> Description {
        corruption("pixelate", "Shrinks the frame and enlarges it to blocks")
            .mathematics("nearest(mean over the pixels whose centres a block covers)")
            .parameter(
                Parameter::by_level(
                    "factor",
                    [0.6, 0.5, 0.4, 0.3, 0.25],
                    "what width and height are shrunk by",
                )
                .range(0.01, 1.0),
            )
    }

    fn new(_config: &Config) -> Result<Self> {
        Ok(Self::default())
    }
}

impl Perturbation for Pixelate {
    fn apply(&mut self, src: Frame<'_>, dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let shrunk = |length: usize| ((length as f64 * cx.number("factor")) as usize).max(1);
        let (width, height) = (shrunk(src.width()), shrunk(src.height()));
        // Rows first, rounded in between, as Pillow does.
        let columns = spans(src.width(), width);
        let means = means(
            columns.iter().chain(&spans(src.height(), height)).map(|span| span.len()).max().unwrap_or(1),
        );
        self.narrow.resize(width, src.height());
        let mut narrow = self.narrow.as_mut();
        for (from, to) in src.rows().zip(narrow.rows_mut()) {
            for (span, to) in columns.iter().zip(to.chunks_exact_mut(3)) {
                let mut sum = [0; 3];
                for pixel in from[span.start * 3..span.end * 3].chunks_exact(3) {
                    sum.iter_mut().zip(pixel).for_each(|(sum, &value)| *sum += usize::from(value));
                }
                to.iter_mut().zip(sum).for_each(|(to, sum)| *to = means[span.len()][sum]);
            }
        }
        self.small.resize(width, height);
        let mut small = self.small.as_mut();
        self.sums.resize(width * 3, 0);
        for (span, to) in spans(src.height(), height).into_iter().zip(small.rows_mut()) {
            let means = &means[span.len()];
            self.sums.fill(0);
            for y in span {
                let row = self.narrow.as_ref().row(y);
                self.sums.iter_mut().zip(row).for_each(|(sum, &value)| *sum += u32::from(value));
            }
            to.iter_mut().zip(&self.sums).for_each(|(to, &sum)| *to = means[sum as usize]);
        }
        let mut dst = dst;
        let [across, down] =
            [(width, src.width()), (height, src.height())].map(|(from, to)| nearest(from, to));
        for (y, to) in down.into_iter().zip(dst.rows_mut()) {
            let row = self.small.as_ref().row(y);
            for (x, to) in across.iter().zip(to.chunks_exact_mut(3)) {
                to.copy_from_slice(&row[x * 3..x * 3 + 3]);
            }
        }
        Ok(())
    }
}

/// The nearest of `from` pixels for each of `to`. Places are added up as Pillow does, because many lie on the border of two pixels.
fn nearest(from: usize, to: usize) -> Vec<usize> {
    let step = from as f64 / to as f64;
    let mut place = step * 0.5;
    let mut next = || {
        let pixel = (place as usize).min(from - 1);
        place += step;
        pixel
    };
    (0..to).map(|_| next()).collect()
}

/// For each of `to` blocks the pixels whose centres it covers.
fn spans(from: usize, to: usize) -> Vec<std::ops::Range<usize>> {
    let scale = from as f64 / to as f64;
    let span = |block: usize| {
        let middle = (block as f64 + 0.5) * scale;
        let start = (middle - scale / 2.0 + 0.5).max(0.0) as usize;
        let end = ((middle + scale / 2.0 + 0.5) as usize).min(from);
        start.min(from - 1)..end.max(start.min(from - 1) + 1)
    };
    (0..to).map(span).collect()
}

/// For each count of bytes up to `most`, and each sum of them, their mean, rounded half up.
fn means(most: usize) -> Vec<Vec<u8>> {
    let of = |count: usize| (0..=255 * count).map(|sum| ((2 * sum + count) / (2 * count)) as u8).collect();
    std::iter::once(Vec::new()).chain((1..=most).map(of)).collect()
}

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
/// A Gaussian is cut off at so many standard deviations.
const TRUNCATE: f64 = 3.0;

impl Component for ElasticTransform {
    fn description() -> Description {
        corruption("elastic_transform", "Displaces every pixel at random, smoothly, in the same way in all frames of a sequence")
            .mathematics("v(x + alpha G dx, y + alpha G dy), dx and dy uniform within 0.005 of the height, G with 0.01 of each side")
            .drawn_per_sequence("the displacements")
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
        if self.made_for.is_new(&src, Some(*cx.key()), &[]) {
            self.draw(width, height, &mut cx.sequence_random());
        }
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
                    *to = (above + (below - above) * share_y).clamp(0.0, 255.0) as u8;
                }
            }
        }
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
    use crate::testing::{frame, perturbed};

    #[test]
    fn pass_the_test_kit() {
        pdk_sdk::testing::perturbation::<JpegCompression>();
        pdk_sdk::testing::perturbation::<Pixelate>();
        pdk_sdk::testing::perturbation::<ElasticTransform>();
    }

    #[test]
    fn a_grey_frame_stays_grey() {
        let grey = frame(100, 60, 50);
        for level in [0.0, 4.0] {
            assert_eq!(perturbed::<Pixelate>(&grey, level, 1), grey);
            assert_eq!(perturbed::<JpegCompression>(&grey, level, 1), grey);
            let moved = perturbed::<ElasticTransform>(&grey, level, 1);
            assert!(moved.data().iter().all(|v| (99..=100).contains(v)));
        }
    }

    #[test]
    fn blocks_are_means_of_the_pixels_whose_centres_they_cover() {
        assert_eq!(spans(10, 6), [0..2, 2..3, 3..5, 5..7, 7..8, 8..10]);
        assert_eq!(spans(8, 2), [0..4, 4..8]);
        let src = FrameBuf::from_vec((0..8).flat_map(|v| [v * 10; 3]).collect(), 8, 1).unwrap();
        let blocks = perturbed::<Pixelate>(&src, 4.0, 1);
        assert_eq!(blocks.data()[..12], [15; 12]);
        assert_eq!(blocks.data()[12..], [55; 12]);
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
