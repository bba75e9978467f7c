//! Resizing without linear interpolation: averages over areas, and nearest pixels.

use crate::frame::{CHANNELS, Frame, FrameMut};
use crate::simd::{round_to_byte, vectorised};

/// What [`resize_area`] keeps between calls.
#[derive(Debug, Clone, Default)]
pub struct Workspace {
    columns: Spans,
    rows: Spans,
    /// A weighted sum of rows.
    sum: Vec<f32>,
}

/// For each output position the stretch of input pixels that it covers.
#[derive(Debug, Clone, Default)]
struct Spans {
    /// Lengths of input and output.
    of: (usize, usize),
    /// The first pixel that each position covers, and where its shares end.
    spans: Vec<(usize, usize)>,
    /// The share of each position's stretch that falls on each of its pixels.
    shares: Vec<f32>,
}

impl Spans {
    fn set(&mut self, from: usize, to: usize) {
        if self.of == (from, to) {
            return;
        }
        self.of = (from, to);
        self.spans.clear();
        self.shares.clear();
        // In units of which a pixel of the input has `to` and one of the output has `from`.
        for position in 0..to {
            let (start, end) = (position * from, (position + 1) * from);
            let first = start / to;
            for pixel in first..end.div_ceil(to) {
                let covered = end.min((pixel + 1) * to) - start.max(pixel * to);
                self.shares.push((covered as f64 / from as f64) as f32);
            }
            self.spans.push((first, self.shares.len()));
        }
    }

    /// The first pixel and the shares of each position.
    fn iter(&self) -> impl Iterator<Item = (usize, &[f32])> {
        let mut start = 0;
        self.spans.iter().map(move |&(first, end)| {
            let shares = &self.shares[start..end];
            start = end;
            (first, shares)
        })
    }
}

/// Resizes `src` to the size of `dst`: each pixel becomes the mean of the area that it covers, rounded half to even.
/// Enlarging gives blocks with mixed pixels between them.
pub fn resize_area(src: Frame<'_>, mut dst: FrameMut<'_>, workspace: &mut Workspace) {
    let Workspace { columns, rows, sum } = workspace;
    columns.set(src.width(), dst.width());
    rows.set(src.height(), dst.height());
    sum.resize(src.width() * CHANNELS, 0.0);
    for ((first, shares), out) in rows.iter().zip(dst.rows_mut()) {
        sum.fill(0.0);
        for (row, &share) in (first..).zip(shares) {
            add_row(src.row(row), sum, share);
        }
        for ((first, shares), out) in columns.iter().zip(out.chunks_exact_mut(CHANNELS)) {
            let mut total = [0.0f32; CHANNELS];
            for (pixel, share) in sum[first * CHANNELS..].chunks_exact(CHANNELS).zip(shares) {
                for (total, value) in total.iter_mut().zip(pixel) {
                    *total += value * share;
                }
            }
            for (out, total) in out.iter_mut().zip(total) {
                *out = round_to_byte(total);
            }
        }
    }
}

vectorised! {
    fn add_row / add_row_avx2 (row: &[u8], sum: &mut [f32], share: f32) {
        for (sum, &value) in sum.iter_mut().zip(row) {
            *sum += f32::from(value) * share;
        }
    }
}

/// Resizes `src` to the size of `dst` by repeating or leaving out pixels: each becomes the one that its centre falls on,
/// at `(position + 1/2) * from / to`.
pub fn resize_nearest(src: Frame<'_>, mut dst: FrameMut<'_>) {
    let (width, height, stride) = (dst.width(), dst.height(), dst.stride());
    let nearest = |position: usize, from: usize, to: usize| (2 * position + 1) * from / (2 * to);
    let source = |y: usize| nearest(y, src.height(), height);
    for y in 0..height {
        if y > 0 && source(y) == source(y - 1) {
            let previous = (y - 1) * stride;
            dst.data_mut().copy_within(previous..previous + width * CHANNELS, y * stride);
            continue;
        }
        let row = src.row(source(y));
        for (x, out) in dst.row_mut(y).chunks_exact_mut(CHANNELS).enumerate() {
            let from = nearest(x, src.width(), width) * CHANNELS;
            out.copy_from_slice(&row[from..from + CHANNELS]);
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::FrameBuf;
    use crate::testing::{run, samples};

    proptest! {
        #[test]
        fn area_matches_the_mean_of_a_finer_grid(sample in samples(), width in 1usize..40, height in 1usize..20) {
            // On a grid that both sizes divide, every area is a whole number of cells.
            let src = sample.frame();
            let mut workspace = Workspace::default();
            let result = run(width, height, |dst| resize_area(src, dst, &mut workspace));
            for y in 0..height {
                for x in 0..width {
                    let mut sums = [0u64; 3];
                    for row in y * src.height()..(y + 1) * src.height() {
                        for column in x * src.width()..(x + 1) * src.width() {
                            let pixel = src.pixel(column / width, row / height);
                            (0..3).for_each(|c| sums[c] += u64::from(pixel[c]));
                        }
                    }
                    let cells = (src.width() * src.height()) as f64;
                    for (actual, sum) in result.as_ref().pixel(x, y).into_iter().zip(sums) {
                        let difference = f64::from(actual) - sum as f64 / cells;
                        prop_assert!(difference.abs() < 0.501, "{} at {} {}", difference, x, y);
                    }
                }
            }
        }

        #[test]
        fn nearest_matches_the_plain_version(sample in samples(), width in 1usize..90, height in 1usize..40) {
            let src = sample.frame();
            let result = run(width, height, |dst| resize_nearest(src, dst));
            for y in 0..height {
                for x in 0..width {
                    let place = |i: usize, from: usize, to: usize| {
                        ((i as f64 + 0.5) * from as f64 / to as f64 + 1e-9) as usize
                    };
                    let expected = src.pixel(place(x, src.width(), width), place(y, src.height(), height));
                    prop_assert_eq!(result.as_ref().pixel(x, y), expected);
                }
            }
        }
    }

    #[test]
    fn a_constant_frame_stays_constant() {
        let src = FrameBuf::from_vec(vec![255; 37 * 23 * 3], 37, 23).unwrap();
        for (width, height) in [(1, 1), (36, 22), (5, 9), (50, 60)] {
            let mut dst = FrameBuf::new(width, height);
            resize_area(src.as_ref(), dst.as_mut(), &mut Workspace::default());
            assert!(dst.data().iter().all(|&v| v == 255), "{width}x{height}");
        }
    }
}
