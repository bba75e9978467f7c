//! Blocks of pixels.

use std::ops::Range;

use pdk_sdk::prelude::*;

use crate::suite::{MadeFor, corruption};

/// Shrinks, and enlarges to blocks.
#[derive(Default)]
pub struct Pixelate {
    made_for: MadeFor,
    /// For each column and each row of blocks the pixels whose centres it covers.
    spans: [Vec<Range<usize>>; 2],
    means: Vec<Vec<u8>>,
    /// For each column and each row of the result its block.
    nearest: [Vec<usize>; 2],
    narrow: FrameBuf,
    small: Vec<u8>,
    sums: Vec<u32>,
    /// A row of the result.
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
        let Self {
            spans: [columns, rows], means, nearest: [across, down], narrow, small, sums, wide, ..
        } = self;
        // Rows first, rounded in between, as Pillow does.
        for (from, to) in src.rows().zip(narrow.as_mut().rows_mut()) {
            for (span, to) in columns.iter().zip(to.as_chunks_mut::<3>().0) {
                let sum = from[span.start * 3..span.end * 3]
                    .as_chunks::<3>()
                    .0
                    .iter()
                    .fold([0; 3], |sum, pixel| {
                        [0, 1, 2].map(|channel| sum[channel] + u32::from(pixel[channel]))
                    });
                *to = sum.map(|sum| means[span.len()][sum as usize]);
            }
        }
        let mut shown = None;
        for (&block, to) in down.iter().zip(dst.rows_mut()) {
            // Rows of a block are all the same.
            if shown != Some(block) {
                let span = rows[block].clone();
                let means = &means[span.len()];
                sums.fill(0);
                for y in span {
                    let row = narrow.as_ref().row(y);
                    sums.iter_mut().zip(row).for_each(|(sum, &value)| *sum += u32::from(value));
                }
                small.iter_mut().zip(&*sums).for_each(|(to, &sum)| *to = means[sum as usize]);
                for (&x, to) in across.iter().zip(wide.as_chunks_mut::<3>().0) {
                    *to = [small[3 * x], small[3 * x + 1], small[3 * x + 2]];
                }
                shown = Some(block);
            }
            to.copy_from_slice(wide);
        }
        Ok(())
    }
}

impl Pixelate {
    fn prepare(&mut self, sizes: [usize; 2], factor: f64) {
        let blocks = sizes.map(|length| ((length as f64 * factor) as usize).max(1));
        self.spans = [0, 1].map(|axis| spans(sizes[axis], blocks[axis]));
        self.nearest = [0, 1].map(|axis| nearest(blocks[axis], sizes[axis]));
        self.means = means(self.spans.iter().flatten().map(|span| span.len()).max().unwrap_or(1));
        self.narrow.resize(blocks[0], sizes[1]);
        self.small.resize(3 * blocks[0], 0);
        self.sums.resize(3 * blocks[0], 0);
        self.wide.resize(3 * sizes[0], 0);
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

/// For each count of bytes up to `most`, and each sum of them, their mean, rounded half up.
fn means(most: usize) -> Vec<Vec<u8>> {
    let of = |count: usize| (0..=255 * count).map(|sum| ((2 * sum + count) / (2 * count)) as u8).collect();
    std::iter::once(Vec::new()).chain((1..=most).map(of)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{perturbed, stays_grey};

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<Pixelate>();
        crate::allocations::on_the_first_frames_alone::<Pixelate>();
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
}
