//! Blocks of pixels.

use pdk_sdk::prelude::*;

use crate::suite::corruption;

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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{perturbed, stays_grey};

    #[test]
    fn passes_the_test_kit() {
        pdk_sdk::testing::perturbation::<Pixelate>();
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
