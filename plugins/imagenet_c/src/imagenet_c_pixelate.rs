//! Blocks of pixels.

use std::ops::Range;

use pdk_sdk::prelude::*;

use crate::simd::vectorised;
use crate::suite::{MadeFor, corruption};

/// Shrinks, and enlarges to blocks. Pixels have a fourth byte between the two, so that they are read and written as words.
#[derive(Default)]
pub struct Pixelate {
    made_for: MadeFor,
    /// For each column and each row of blocks the pixels whose centres it covers.
    spans: [Vec<Range<usize>>; 2],
    /// For each column and each row of the result its block.
    nearest: [Vec<usize>; 2],
    /// A row of the frame, followed by the byte that the last pixel is read with.
    row: Vec<u8>,
    /// The same with a pixel for each column of blocks.
    means: Vec<[u32; 4]>,
    /// Rows of the frame with a pixel for each column of blocks.
    narrow: Vec<[u8; 4]>,
    /// A row of blocks.
    small: Vec<[u8; 4]>,
    /// A row of the result, followed by the byte that the last pixel is written with.
    wide: Vec<u8>,
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
    fn apply(&mut self, src: Frame<'_>, mut dst: FrameMut<'_>, cx: &Context<'_>) -> Result<()> {
        let sizes = [src.width(), src.height()];
        let factor = cx.number("factor");
        if self.made_for.is_new(sizes, None, &[factor]) {
            self.prepare(sizes, factor);
        }
        let Self { spans: [columns, rows], nearest: [across, down], row, means, narrow, small, wide, .. } =
            self;
        let mut shown = None;
        for (&block, to) in down.iter().zip(dst.rows_mut()) {
            // Rows of a block are all the same.
            if shown != Some(block) {
                let span = rows[block].clone();
                narrow.resize(span.len() * columns.len(), [0; 4]);
                // Rows first, rounded in between, as Pillow does.
                for (y, narrow) in span.zip(narrow.chunks_exact_mut(columns.len())) {
                    row[..to.len()].copy_from_slice(src.row(y));
                    average_columns(row, columns, means);
                    shorten(means.as_flattened(), narrow.as_flattened_mut());
                }
                average_rows(narrow.as_flattened(), small.as_flattened_mut());
                for (place, &x) in across.iter().enumerate() {
                    wide[3 * place..][..4].copy_from_slice(&small[x]);
                }
                shown = Some(block);
            }
            to.copy_from_slice(&wide[..to.len()]);
        }
        Ok(())
    }
}

impl Pixelate {
    fn prepare(&mut self, sizes: [usize; 2], factor: f64) {
        let blocks = sizes.map(|length| ((length as f64 * factor) as usize).max(1));
        self.spans = [0, 1].map(|axis| spans(sizes[axis], blocks[axis]));
        self.nearest = [0, 1].map(|axis| nearest(blocks[axis], sizes[axis]));
        self.row.resize(3 * sizes[0] + 1, 0);
        self.means.resize(blocks[0], [0; 4]);
        let most = self.spans[1].iter().map(|span| span.len()).max().unwrap_or(1);
        self.narrow.reserve(blocks[0] * most);
        self.small.resize(blocks[0], [0; 4]);
        self.wide.resize(3 * sizes[0] + 1, 0);
    }
}

/// Divides a sum of bytes by their number, rounding half up, with a multiplication.
#[derive(Debug, Clone, Copy)]
struct Divisor {
    count: u32,
    /// A little more than 2^24 / (2 `count`); 0 for numbers for which the result would not be exact.
    reciprocal: u32,
}

impl Divisor {
    /// Up to here the multiplication is exact: the reciprocal is too large by less than 2^-24, which times the largest sum, doubled and
    /// with `count` added, 511 `count`, stays below 1 / (2 `count`). The product stays below 2^32.
    const MOST: usize = 128;

    fn new(count: usize) -> Self {
        let reciprocal = if count <= Self::MOST { (1 << 24) / (2 * count as u32) + 1 } else { 0 };
        Self { count: count as u32, reciprocal }
    }

    #[inline(always)]
    fn quick(self, sum: u32) -> u8 {
        ((2 * sum + self.count).wrapping_mul(self.reciprocal) >> 24) as u8
    }

    /// The same for any number.
    #[inline(always)]
    fn any(self, sum: u32) -> u8 {
        ((2 * u64::from(sum) + u64::from(self.count)) / (2 * u64::from(self.count))) as u8
    }

    #[inline(always)]
    fn divide(self, sum: u32) -> u8 {
        if self.reciprocal > 0 { self.quick(sum) } else { self.any(sum) }
    }
}

vectorised! {
    // The mean of each span of pixels of a row. Means are not bytes yet, because four of them would be one word for the compiler, which it
    // computes with byte by byte.
    fn average_columns / average_columns_avx2 (row: &[u8], spans: &[Range<usize>], means: &mut [[u32; 4]]) {
        for (span, means) in spans.iter().zip(means) {
            // Most are short, and loops over them would take longer than the additions.
            match span.len() {
                1 => *means = mean_of::<1>(row, span.start),
                2 => *means = mean_of::<2>(row, span.start),
                3 => *means = mean_of::<3>(row, span.start),
                4 => *means = mean_of::<4>(row, span.start),
                count => {
                    let mut sums = [0; 4];
                    for pixel in span.clone() {
                        for (sum, &value) in sums.iter_mut().zip(&row[3 * pixel..][..4]) {
                            *sum += u32::from(value);
                        }
                    }
                    let divisor = Divisor::new(count);
                    *means = sums.map(|sum| u32::from(divisor.divide(sum)));
                }
            }
        }
    }
}

/// The mean of a fixed number of pixels, up to 8: 16 fractional bits are enough for these.
#[inline(always)]
fn mean_of<const COUNT: usize>(row: &[u8], first: usize) -> [u32; 4] {
    let pixels = &row[3 * first..][..3 * COUNT + 1];
    let reciprocal = (1 << 16) / (2 * COUNT as u32) + 1;
    let mut means = [0; 4];
    for (channel, mean) in means.iter_mut().enumerate() {
        let sum = (0..COUNT).map(|pixel| u32::from(pixels[3 * pixel + channel])).sum::<u32>();
        *mean = ((2 * sum + COUNT as u32) * reciprocal) >> 16;
    }
    means
}

vectorised! {
    fn shorten / shorten_avx2 / shorten_avx512 (from: &[u32], to: &mut [u8]) {
        for (to, &from) in to.iter_mut().zip(from) {
            *to = from as u8;
        }
    }
}

/// Values of a row that are averaged at a time.
const CHUNK: usize = 256;

vectorised! {
    // The mean of each column of values; there are as many rows as fit.
    fn average_rows / average_rows_avx2 / average_rows_avx512 (rows: &[u8], means: &mut [u8]) {
        let length = means.len();
        let divisor = Divisor::new(rows.len() / length);
        for (chunk, means) in means.chunks_mut(CHUNK).enumerate() {
            let mut sums = [0; CHUNK];
            for row in rows.chunks_exact(length) {
                for (sum, &value) in sums.iter_mut().zip(&row[chunk * CHUNK..][..means.len()]) {
                    *sum += u32::from(value);
                }
            }
            if divisor.reciprocal > 0 {
                means.iter_mut().zip(&sums).for_each(|(to, &sum)| *to = divisor.quick(sum));
            } else {
                means.iter_mut().zip(&sums).for_each(|(to, &sum)| *to = divisor.any(sum));
            }
        }
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
fn spans(from: usize, to: usize) -> Vec<Range<usize>> {
    let scale = from as f64 / to as f64;
    let span = |block: usize| {
        let middle = (block as f64 + 0.5) * scale;
        let start = (middle - scale / 2.0 + 0.5).max(0.0) as usize;
        let end = ((middle + scale / 2.0 + 0.5) as usize).min(from);
        start.min(from - 1)..end.max(start.min(from - 1) + 1)
    };
    (0..to).map(span).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::simd::with_each;
    use crate::testing::{perturbed, stays_grey};
    use pdk_sdk::serde_json::json;
    use pdk_sdk::testing::{Trial, sample_frame};

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<Pixelate>();
        crate::allocations::on_the_first_frames_alone::<Pixelate>();
    }

    #[test]
    fn keeps_nothing_that_does_not_fit() {
        crate::testing::keeps_nothing_that_does_not_fit::<Pixelate>();
    }

    #[test]
    fn a_grey_frame_stays_grey() {
        stays_grey::<Pixelate>(&[0.0, 4.0], 100..=100);
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
    fn a_multiplication_divides_exactly() {
        for count in 1..=Divisor::MOST {
            let divisor = Divisor::new(count);
            for sum in 0..=255 * count as u32 {
                assert_eq!(divisor.quick(sum), divisor.any(sum), "{sum} / {count}");
            }
        }
        let row: Vec<u8> = (0..3 * 4000).map(|place| (place * place / 7 + place % 5) as u8).collect();
        for first in 0..3900 {
            let wanted = |count: usize| {
                let sum = |c: usize| (0..count).map(|x| u32::from(row[3 * (first + x) + c])).sum();
                [0, 1, 2].map(|channel| u32::from(Divisor::new(count).any(sum(channel))))
            };
            let found = [
                mean_of::<1>(&row, first),
                mean_of::<2>(&row, first),
                mean_of::<3>(&row, first),
                mean_of::<4>(&row, first),
            ];
            for (count, found) in (1..).zip(found) {
                assert_eq!(found[..3], wanted(count), "{count} from {first}");
            }
        }
    }

    /// Pixel by pixel.
    fn plain(src: &FrameBuf, factor: f64) -> FrameBuf {
        let sizes = [src.width(), src.height()];
        let blocks = sizes.map(|length| ((length as f64 * factor) as usize).max(1));
        let [columns, rows] = [0, 1].map(|axis| spans(sizes[axis], blocks[axis]));
        let [across, down] = [0, 1].map(|axis| nearest(blocks[axis], sizes[axis]));
        let of = |values: &mut dyn Iterator<Item = u8>, count: usize| {
            Divisor::new(count).any(values.map(u32::from).sum())
        };
        let mut dst = FrameBuf::new(sizes[0], sizes[1]);
        for (y, &block) in down.iter().enumerate() {
            for (x, &column) in across.iter().enumerate() {
                let (columns, rows) = (columns[column].clone(), rows[block].clone());
                let value = |channel: usize| {
                    let row = |y: usize| {
                        let values = columns.clone().map(|x| src.as_ref().pixel(x, y)[channel]);
                        of(&mut { values }, columns.len())
                    };
                    of(&mut rows.clone().map(row), rows.len())
                };
                dst.as_mut().set_pixel(x, y, [0, 1, 2].map(value));
            }
        }
        dst
    }

    #[test]
    fn matches_the_plain_version() {
        for (width, height) in [(1, 1), (5, 3), (64, 48), (107, 61), (300, 2)] {
            let src = sample_frame(width, height);
            for factor in [0.01, 0.05, 0.25, 0.3, 0.4, 0.5, 0.6, 0.97, 1.0] {
                let wanted = plain(&src, factor);
                with_each(|instructions| {
                    let mut trial =
                        Trial::<Pixelate>::new(&json!({ "factor": factor }), 0.0, Key([1; 32])).unwrap();
                    let found = trial.frame(&src, 0, 0.0).unwrap();
                    assert!(found == wanted, "{width}x{height} by {factor} with {instructions:?}");
                });
            }
        }
    }
}
