//! Gaussian blur in 8-bit fixed point.
//!
//! The kernel's weights are whole numbers that sum to 256, so both passes are exact and only the final division by
//! 65536 rounds. The vertical pass comes first, because its sums fit 16 bits; the horizontal pass then works on the
//! upper and the lower byte of those sums one after the other, which fits 16 bits again. Kernels of up to 7 pixels need less.

use crate::border::reflect;
use crate::frame::{CHANNELS, Frame, FrameMut};
use crate::simd::vectorised;
use crate::small_gaussian::{sum_down, sum_right};

/// The standard deviation in pixels that belongs to a kernel of `size`: `0.3 * ((size - 1) / 2 - 1) + 0.8`.
pub fn sigma_of_kernel(size: usize) -> f64 {
    0.3 * ((size as f64 - 1.0) * 0.5 - 1.0) + 0.8
}

/// What [`gaussian_blur`] keeps between calls.
#[derive(Debug, Clone, Default)]
pub struct Workspace {
    /// The kernel size that `weights` belong to.
    size: usize,
    /// The centre's weight, then those at distance 1, 2, ...
    weights: Vec<u16>,
    /// Upper and lower bytes of a row of vertical sums, with a mirrored border at both ends.
    upper: Vec<u16>,
    lower: Vec<u16>,
    /// Sums over a row.
    sum: Vec<u16>,
    lower_sum: Vec<u16>,
}

/// The weights of a kernel of odd `size`, from the centre to one end. All of them, both sides counted, sum to 256.
///
/// Sizes up to 7 have fixed weights; larger ones are rounded from the end to the centre, each handing its rounding
/// error on to the next, and the centre takes what is left.
fn weights(size: usize, into: &mut Vec<u16>) {
    into.clear();
    match size {
        1 => return into.push(256),
        3 => return into.extend([128, 64]),
        5 => return into.extend([96, 64, 16]),
        7 => return into.extend([72, 56, 28, 8]),
        _ => {}
    }
    let radius = size / 2;
    let sigma = sigma_of_kernel(size);
    let density = |x: usize| libm::exp(-((x * x) as f64) / (2.0 * sigma * sigma));
    let total = (1..=radius).map(|x| 2.0 * density(x)).sum::<f64>() + 1.0;
    into.resize(radius + 1, 0);
    let (mut error, mut used) = (0.0, 0);
    for x in (1..=radius).rev() {
        let wanted = 256.0 * density(x) / total + error;
        let weight = wanted.round_ties_even();
        error = wanted - weight;
        into[x] = weight as u16;
        used += 2 * into[x];
    }
    into[0] = 256 - used;
}

/// Blurs with a Gaussian kernel of `kernel_size` pixels (an even size counts as the next odd one) whose standard
/// deviation is [`sigma_of_kernel`]; mirrored at the edges without repeating them.
///
/// # Panics
/// If the sizes of the frames differ.
pub fn gaussian_blur(src: Frame<'_>, mut dst: FrameMut<'_>, kernel_size: usize, workspace: &mut Workspace) {
    assert!(src.same_size(&dst.as_ref()), "gaussian_blur between frames of different size");
    workspace.prepare::<CHANNELS>(src.width(), kernel_size);
    for y in 0..src.height() {
        blur_row::<CHANNELS>(|row| src.row(row), src.height(), y, dst.row_mut(y), workspace);
    }
}

/// Blurs a single channel as [`gaussian_blur`] does a frame. Rows are `width` bytes and follow each other without gaps.
///
/// # Panics
/// If the lengths differ or are not a whole number of rows.
pub fn gaussian_blur_plane(
    src: &[u8],
    dst: &mut [u8],
    width: usize,
    kernel_size: usize,
    workspace: &mut Workspace,
) {
    assert!(src.len() == dst.len(), "gaussian_blur_plane between planes of different size");
    assert!(width > 0 && src.len().is_multiple_of(width), "gaussian_blur_plane takes whole rows");
    workspace.prepare::<1>(width, kernel_size);
    for (y, out) in dst.chunks_exact_mut(width).enumerate() {
        blur_row::<1>(|row| &src[row * width..(row + 1) * width], src.len() / width, y, out, workspace);
    }
}

impl Workspace {
    /// Makes room for rows of `width` pixels with `N` channels, and the weights.
    fn prepare<const N: usize>(&mut self, width: usize, kernel_size: usize) {
        let size = kernel_size | 1;
        if self.size != size {
            weights(size, &mut self.weights);
            // Weights far from the centre may have been rounded to nothing.
            let used = self.weights.iter().rposition(|&w| w != 0).unwrap_or(0) + 1;
            self.weights.truncate(used);
            self.size = size;
        }
        let border = (self.weights.len() - 1) * N;
        for buffer in [&mut self.upper, &mut self.lower] {
            buffer.resize(width * N + 2 * border, 0);
        }
        for buffer in [&mut self.sum, &mut self.lower_sum] {
            buffer.resize(width * N, 0);
        }
    }
}

/// Row `y` of a blurred image of `height` rows with `N` channels, whose rows `row_of` gives.
fn blur_row<'a, const N: usize>(
    row_of: impl Fn(usize) -> &'a [u8],
    height: usize,
    y: usize,
    out: &mut [u8],
    workspace: &mut Workspace,
) {
    let Workspace { size, weights, upper, lower, sum, lower_sum } = workspace;
    let radius = weights.len() - 1;
    let (values, border) = (out.len(), radius * N);
    if (3..=7).contains(size) {
        let mut rows: [&[u8]; 7] = [&[]; 7];
        let downs = y as isize - radius as isize..;
        rows.iter_mut().zip(downs).take(*size).for_each(|(row, down)| *row = row_of(reflect(down, height)));
        sum_down(&rows[..*size], &mut upper[border..border + values]);
        mirror_ends::<N>(upper, values / N, radius);
        return sum_right(upper, *size, N, out);
    }
    scale_bytes(row_of(y), sum, weights[0]);
    for (near, far, shares) in pairs(weights) {
        let row = |down: isize| row_of(reflect(y as isize + down, height));
        let (near, far) = (near as isize, far as isize);
        add_bytes(row(-near), row(near), row(-far), row(far), sum, shares);
    }
    split(sum, &mut upper[border..border + values], &mut lower[border..border + values]);
    for buffer in [&mut *upper, &mut *lower] {
        mirror_ends::<N>(buffer, values / N, radius);
    }
    for (padded, sum) in [(&*upper, &mut *sum), (&*lower, &mut *lower_sum)] {
        scale_words(&padded[border..border + values], sum, weights[0]);
        for (near, far, shares) in pairs(weights) {
            let left = |distance: usize| &padded[border - distance * N..][..values];
            let right = |distance: usize| &padded[border + distance * N..][..values];
            add_words(left(near), right(near), left(far), right(far), sum, shares);
        }
    }
    finish(sum, lower_sum, out);
}

/// The distances from the centre two by two, with their weights: sums are then read and written half as often. Where
/// the number of distances is odd, the last one comes twice, the second time with no weight.
fn pairs(weights: &[u16]) -> impl Iterator<Item = (usize, usize, [u16; 2])> + '_ {
    (1..weights.len()).step_by(2).map(|near| match weights.get(near + 1) {
        Some(&far) => (near, near + 1, [weights[near], far]),
        None => (near, near, [weights[near], 0]),
    })
}

/// Fills `radius` pixels of `N` channels at both ends of a row of `width` pixels with the mirrored row.
fn mirror_ends<const N: usize>(padded: &mut [u16], width: usize, radius: usize) {
    for distance in 1..=radius {
        let left = reflect(-(distance as isize), width);
        let right = reflect((width + distance - 1) as isize, width);
        for (to, from) in [(radius - distance, left), (radius + width + distance - 1, right)] {
            let from = (radius + from) * N;
            padded.copy_within(from..from + N, to * N);
        }
    }
}

vectorised! {
    fn scale_bytes / scale_bytes_avx2 / scale_bytes_avx512 (row: &[u8], sum: &mut [u16], weight: u16) {
        for (sum, &value) in sum.iter_mut().zip(row) {
            *sum = u16::from(value) * weight;
        }
    }
}

vectorised! {
    fn add_bytes / add_bytes_avx2 / add_bytes_avx512 (
        a: &[u8], b: &[u8], c: &[u8], d: &[u8], sum: &mut [u16], weights: [u16; 2],
    ) {
        for ((sum, (&a, &b)), (&c, &d)) in sum.iter_mut().zip(a.iter().zip(b)).zip(c.iter().zip(d)) {
            let near = (u16::from(a) + u16::from(b)).wrapping_mul(weights[0]);
            let far = (u16::from(c) + u16::from(d)).wrapping_mul(weights[1]);
            *sum = sum.wrapping_add(near).wrapping_add(far);
        }
    }
}

vectorised! {
    fn split / split_avx2 / split_avx512 (sum: &[u16], upper: &mut [u16], lower: &mut [u16]) {
        for ((&sum, upper), lower) in sum.iter().zip(upper).zip(lower) {
            *upper = sum >> 8;
            *lower = sum & 255;
        }
    }
}

vectorised! {
    fn scale_words / scale_words_avx2 / scale_words_avx512 (row: &[u16], sum: &mut [u16], weight: u16) {
        for (sum, &value) in sum.iter_mut().zip(row) {
            *sum = value.wrapping_mul(weight);
        }
    }
}

vectorised! {
    fn add_words / add_words_avx2 / add_words_avx512 (
        a: &[u16], b: &[u16], c: &[u16], d: &[u16], sum: &mut [u16], weights: [u16; 2],
    ) {
        for ((sum, (&a, &b)), (&c, &d)) in sum.iter_mut().zip(a.iter().zip(b)).zip(c.iter().zip(d)) {
            let near = a.wrapping_add(b).wrapping_mul(weights[0]);
            let far = c.wrapping_add(d).wrapping_mul(weights[1]);
            *sum = sum.wrapping_add(near).wrapping_add(far);
        }
    }
}

vectorised! {
    // (256 * upper + lower + 32768) >> 16 without leaving 16 bits: 256 * upper + lower is at most 256 * 65280.
    fn finish / finish_avx2 / finish_avx512 (upper: &[u16], lower: &[u16], dst: &mut [u8]) {
        for ((dst, &upper), &lower) in dst.iter_mut().zip(upper).zip(lower) {
            *dst = (upper.wrapping_add(lower >> 8).wrapping_add(128) >> 8) as u8;
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::testing::{plain, run_on, samples};

    #[test]
    fn weights_sum_to_256_at_every_size() {
        let mut half = Vec::new();
        for size in (1..200).step_by(2) {
            weights(size, &mut half);
            let total: u32 = half.iter().map(|&w| u32::from(w)).sum();
            assert_eq!(2 * total - u32::from(half[0]), 256, "size {size}");
        }
    }

    #[test]
    fn weights_follow_the_gaussian() {
        let mut half = Vec::new();
        for size in [9, 15, 25, 41, 99] {
            weights(size, &mut half);
            let sigma = sigma_of_kernel(size);
            let density: Vec<f64> =
                (0..half.len()).map(|x| libm::exp(-((x * x) as f64) / (2.0 * sigma * sigma))).collect();
            let total = 2.0 * density.iter().sum::<f64>() - 1.0;
            for (x, (&weight, density)) in half.iter().zip(&density).enumerate() {
                // The centre takes what rounding leaves on both sides.
                let tolerance = if x == 0 { 2.0 } else { 1.0 };
                assert!(
                    (f64::from(weight) - 256.0 * density / total).abs() <= tolerance,
                    "{size} {x} {weight}"
                );
            }
        }
    }

    proptest! {
        #[test]
        fn matches_the_plain_version(sample in samples(), size in 1usize..60) {
            let mut half = Vec::new();
            weights(size | 1, &mut half);
            let radius = half.len() as isize - 1;
            let src = sample.frame();
            let expected = plain(src, |x, y| {
                let mut sums = [32768u32; 3];
                for down in -radius..=radius {
                    for right in -radius..=radius {
                        let weight = u32::from(half[down.unsigned_abs()]) * u32::from(half[right.unsigned_abs()]);
                        let row = reflect(y as isize + down, src.height());
                        let pixel = src.pixel(reflect(x as isize + right, src.width()), row);
                        (0..3).for_each(|c| sums[c] += weight * u32::from(pixel[c]));
                    }
                }
                sums.map(|sum| (sum >> 16) as u8)
            });
            let mut workspace = Workspace::default();
            prop_assert_eq!(run_on(&sample, |src, dst| gaussian_blur(src, dst, size, &mut workspace)), expected);
        }

        #[test]
        fn a_plane_is_blurred_as_a_channel_of_a_frame(sample in samples(), size in 1usize..60) {
            let src = sample.frame();
            let mut workspace = Workspace::default();
            let blurred = run_on(&sample, |src, dst| gaussian_blur(src, dst, size, &mut workspace));
            let plane = |frame: Frame<'_>| frame.to_buf().data().iter().skip(1).step_by(3).copied().collect::<Vec<_>>();
            let mut result = vec![0; src.width() * src.height()];
            gaussian_blur_plane(&plane(src), &mut result, src.width(), size, &mut workspace);
            prop_assert_eq!(result, plane(blurred.as_ref()));
        }
    }

    #[test]
    fn a_workspace_serves_frames_and_kernels_of_any_size_in_turn() {
        let mut kept = Workspace::default();
        for (width, height, size) in [(40, 30, 41), (7, 3, 3), (40, 30, 25), (90, 2, 25), (1, 1, 99)] {
            let bytes: Vec<u8> = (0..width * height * 3).map(|i| (i * 37 % 251) as u8).collect();
            let src = Frame::new(&bytes, width, height).unwrap();
            let (mut first, mut second) = (src.to_buf(), src.to_buf());
            gaussian_blur(src, first.as_mut(), size, &mut kept);
            gaussian_blur(src, second.as_mut(), size, &mut Workspace::default());
            assert_eq!(first, second);
        }
    }
}
