//! Grey-world white balance.

use crate::frame::{CHANNELS, Frame, FrameMut, for_each_row};
use crate::simd::{round_inside_byte, vectorised, whole_part};

/// Pixels whose bytes are worked on together: their length in bytes is a whole number of vectors and of pixels.
const BLOCK: usize = 16 * CHANNELS;

/// Sums of 8-bit values stay below 2^16 for this many of them.
const BLOCKS_PER_SUM: usize = 257;

/// The sum of the values of each channel.
pub fn channel_sums(src: Frame<'_>) -> [u64; 3] {
    let mut sums = [0; 3];
    match src.contiguous() {
        Some(all) => add_channels(all, &mut sums),
        None => src.rows().for_each(|row| add_channels(row, &mut sums)),
    }
    sums
}

vectorised! {
    fn add_channels / add_channels_avx2 / add_channels_avx512 (row: &[u8], sums: &mut [u64; 3]) {
        for part in row.chunks(BLOCK * BLOCKS_PER_SUM) {
            let mut partial = [0u16; BLOCK];
            let blocks = part.chunks_exact(BLOCK);
            let rest = blocks.remainder();
            for block in blocks {
                for (sum, &value) in partial.iter_mut().zip(block) {
                    *sum += u16::from(value);
                }
            }
            for (i, &sum) in partial.iter().enumerate() {
                sums[i % CHANNELS] += u64::from(sum);
            }
            for (i, &value) in rest.iter().enumerate() {
                sums[i % CHANNELS] += u64::from(value);
            }
        }
    }
}

/// What each channel is multiplied with so that all three have the mean of their means. A channel without any light
/// stays as it is.
fn gains(src: Frame<'_>) -> [f32; 3] {
    let sums = channel_sums(src).map(|sum| sum as f64);
    let mean = (sums[0] + sums[1] + sums[2]) / 3.0;
    sums.map(|sum| if sum > 0.0 { (mean / sum) as f32 } else { 1.0 })
}

/// Blends the frame with its grey-world correction, `weight * corrected + (1 - weight) * src`, rounded half to even. In
/// the correction each channel is multiplied by the mean of the three channel means over its own mean, clipped to 255,
/// and loses its fraction. The weight is clipped to 0..=1.
///
/// # Panics
/// If the sizes differ.
pub fn blend_with_grey_world(src: Frame<'_>, dst: FrameMut<'_>, weight: f64) {
    let weight = weight.clamp(0.0, 1.0);
    let gains = gains(src);
    let gains = std::array::from_fn(|i| gains[i % CHANNELS]);
    let (weight, rest) = (weight as f32, (1.0 - weight) as f32);
    for_each_row(src, dst, |from, to| correct_row(from, to, &gains, weight, rest));
}

vectorised! {
    fn correct_row / correct_row_avx2 / correct_row_avx512 (
        from: &[u8], to: &mut [u8], gains: &[f32; BLOCK], weight: f32, rest: f32,
    ) {
        for (from, to) in from.chunks(BLOCK).zip(to.chunks_mut(BLOCK)) {
            for ((to, &from), &gain) in to.iter_mut().zip(from).zip(gains) {
                let value = f32::from(from);
                *to = round_inside_byte(whole_part((value * gain).min(255.0)) * weight + value * rest);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::frame::FrameBuf;
    use crate::testing::{plain, run_on, samples};

    proptest! {
        #[test]
        fn matches_the_plain_version(sample in samples(), weight in 0.0..=1.0f64) {
            let src = sample.frame();
            let mut sums = [0.0f64; 3];
            for y in 0..src.height() {
                for x in 0..src.width() {
                    (0..3).for_each(|c| sums[c] += f64::from(src.pixel(x, y)[c]));
                }
            }
            let mean = sums.iter().sum::<f64>() / 3.0;
            let (share, rest) = (weight as f32, (1.0 - weight) as f32);
            let expected = plain(src, |x, y| {
                let pixel = src.pixel(x, y).map(f32::from);
                [0, 1, 2].map(|c| {
                    let gain = if sums[c] == 0.0 { 1.0 } else { (mean / sums[c]) as f32 };
                    // What lies within 1/4096 below a whole number counts as that number.
                    let corrected = ((pixel[c] * gain).min(255.0) + (1.0 / 4096.0 - 0.5)).round_ties_even();
                    (corrected * share + pixel[c] * rest).round_ties_even() as u8
                })
            });
            prop_assert_eq!(run_on(&sample, |src, dst| blend_with_grey_world(src, dst, weight)), expected);
        }
    }

    #[test]
    fn sums_of_bright_frames_do_not_overflow() {
        let src = FrameBuf::from_vec(vec![255; 1000 * 70 * 3], 1000, 70).unwrap();
        assert_eq!(channel_sums(src.as_ref()), [255 * 70_000; 3]);
    }

    #[test]
    fn a_fully_corrected_frame_has_equal_means_and_black_stays_black() {
        let pixels: Vec<u8> = (0..600).map(|i| [40 + i % 30, 90 + i % 20, 0][i % 3] as u8).collect();
        let src = FrameBuf::from_vec(pixels, 20, 10).unwrap();
        let mut dst = FrameBuf::new(20, 10);
        blend_with_grey_world(src.as_ref(), dst.as_mut(), 1.0);
        let [red, green, blue] = channel_sums(dst.as_ref());
        assert!(red.abs_diff(green) <= 200, "{red} {green}");
        assert_eq!(blue, 0);
    }
}
