//! Noise that is drawn for each value by itself.
//!
//! Random bytes come row by row, in blocks, so that they depend on the size of the frame but not on its stride.

use std::sync::OnceLock;

use crate::frame::{CHANNELS, Frame, FrameMut};
use crate::point::truncated;
use crate::simd::{round_to_byte, vectorised};
use pdk_seed::{Random, normal_quantile};

/// The number of values that are done at a time.
const BLOCK: usize = 1024;
/// Normal numbers are fixed-point numbers with 12 fractional bits.
pub(crate) const NORMAL_SCALE: f32 = 1.0 / 4096.0;

/// The lower half of the 65536 numbers that divide the standard normal distribution into equally likely parts: the quantiles of
/// `(i + 0.5) / 65536`, in steps of 1/4096. The least is -4.33. The upper half is the same with the other sign; without it, far more of
/// the table lies in the fastest cache.
fn lower_normals() -> &'static [i16; 32768] {
    static TABLE: OnceLock<Box<[i16; 32768]>> = OnceLock::new();
    TABLE.get_or_init(|| {
        let mut table = Box::new([0i16; 32768]);
        for (i, entry) in table.iter_mut().enumerate() {
            *entry = (normal_quantile((i as f64 + 0.5) / 65536.0) * 4096.0).round() as i16;
        }
        table
    })
}

/// All of the 65536 numbers, one after the other.
pub(crate) fn normals() -> impl Iterator<Item = i16> {
    let lower = lower_normals();
    lower.iter().copied().chain(lower.iter().rev().map(|normal| -normal))
}

/// Adds normal noise with a standard deviation of `sigma` times 255 to each value; clipped, rounded half to even.
///
/// # Panics
/// If the sizes differ.
pub fn gaussian_noise(src: Frame<'_>, dst: FrameMut<'_>, sigma: f64, random: &mut Random) {
    let scale = (sigma * 255.0) as f32 * NORMAL_SCALE;
    each_block(src, dst, random, |from, normal, to| add_normal(from, normal, to, scale));
}

/// As [`gaussian_noise`], with the fraction dropped.
///
/// # Panics
/// If the sizes differ.
pub fn gaussian_noise_truncated(src: Frame<'_>, dst: FrameMut<'_>, sigma: f64, random: &mut Random) {
    let scale = (sigma * 255.0) as f32 * NORMAL_SCALE;
    each_block(src, dst, random, |from, normal, to| add_normal_truncated(from, normal, to, scale));
}

/// Multiplies each value by a normal number with mean 1 and standard deviation `sigma`; clipped, the fraction dropped.
///
/// # Panics
/// If the sizes differ.
pub fn speckle_noise(src: Frame<'_>, dst: FrameMut<'_>, sigma: f64, random: &mut Random) {
    let scale = sigma as f32 * NORMAL_SCALE;
    each_block(src, dst, random, |from, normal, to| multiply_normal(from, normal, to, scale));
}

/// Calls `apply` with a block of values, a normal number for each, and where the results go.
pub(crate) fn each_block(
    src: Frame<'_>,
    mut dst: FrameMut<'_>,
    random: &mut Random,
    mut apply: impl FnMut(&[u8], &[i16], &mut [u8]),
) {
    assert!(src.same_size(&dst.as_ref()), "noise between frames of different size");
    let table = lower_normals();
    let mut bytes = [0u8; 2 * BLOCK];
    let mut places = [0u16; BLOCK];
    let mut normal = [0i16; BLOCK];
    for y in 0..src.height() {
        for (from, to) in src.row(y).chunks(BLOCK).zip(dst.row_mut(y).chunks_mut(BLOCK)) {
            let bytes = &mut bytes[..2 * from.len()];
            random.fill(bytes);
            fold(bytes, &mut places);
            let normal = &mut normal[..from.len()];
            for (normal, &place) in normal.iter_mut().zip(&places) {
                // Every place lies in the table; the remainder tells the compiler so.
                *normal = table[usize::from(place) % table.len()];
            }
            unfold(bytes, normal);
            apply(from, normal, to);
        }
    }
}

vectorised! {
    /// The place in the lower half for each two bytes.
    fn fold / fold_avx2 / fold_avx512 (bytes: &[u8], places: &mut [u16]) {
        for (place, pair) in places.iter_mut().zip(bytes.as_chunks().0) {
            let number = u16::from_le_bytes(*pair);
            *place = number ^ (number as i16 >> 15) as u16;
        }
    }
}

vectorised! {
    /// Gives those of the upper half their sign.
    fn unfold / unfold_avx2 / unfold_avx512 (bytes: &[u8], normal: &mut [i16]) {
        for (normal, pair) in normal.iter_mut().zip(bytes.as_chunks().0) {
            let sign = i16::from_le_bytes(*pair) >> 15;
            *normal = (*normal ^ sign) - sign;
        }
    }
}

vectorised! {
    fn add_normal / add_normal_avx2 / add_normal_avx512 (
        from: &[u8], normal: &[i16], to: &mut [u8], scale: f32,
    ) {
        for ((to, &from), &normal) in to.iter_mut().zip(from).zip(normal) {
            *to = round_to_byte(f32::from(from) + f32::from(normal) * scale);
        }
    }
}

vectorised! {
    fn add_normal_truncated / add_normal_truncated_avx2 / add_normal_truncated_avx512 (
        from: &[u8], normal: &[i16], to: &mut [u8], scale: f32,
    ) {
        for ((to, &from), &normal) in to.iter_mut().zip(from).zip(normal) {
            *to = truncated(f32::from(from) + f32::from(normal) * scale);
        }
    }
}

vectorised! {
    fn multiply_normal / multiply_normal_avx2 / multiply_normal_avx512 (
        from: &[u8], normal: &[i16], to: &mut [u8], scale: f32,
    ) {
        for ((to, &from), &normal) in to.iter_mut().zip(from).zip(normal) {
            *to = truncated(f32::from(from) * (1.0 + f32::from(normal) * scale));
        }
    }
}

/// Which values [`impulse_noise`] hits.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Impulses {
    /// Single values of the red and green channels, never in the last row or column.
    Published,
    /// Whole pixels, anywhere.
    WholePixels,
}

/// Sets random values to 255, then as many to 0. With `Published`, `ceil(fraction * width * height * 3 / 2)` single
/// values each; with `WholePixels`, `ceil(fraction * width * height / 2)` pixels each. A place may be drawn twice, so a
/// little less than `fraction` of the image changes. If `Published` leaves no row or column, the only one is used.
///
/// # Panics
/// If the sizes differ or `fraction` is not within 0..=1.
pub fn impulse_noise(
    src: Frame<'_>,
    mut dst: FrameMut<'_>,
    fraction: f64,
    impulses: Impulses,
    random: &mut Random,
) {
    assert!((0.0..=1.0).contains(&fraction), "impulse_noise takes a fraction of 0 to 1, not {fraction}");
    dst.copy_from(src);
    let (width, height, stride) = (src.width(), src.height(), dst.stride());
    let pixels = (width * height) as f64;
    let data = dst.data_mut();
    for value in [255, 0] {
        match impulses {
            Impulses::Published => {
                let (columns, rows) = ((width - 1).max(1) as u32, (height - 1).max(1) as u32);
                for _ in 0..(fraction * pixels * 3.0 / 2.0).ceil() as u64 {
                    let (y, x) = (random.below(rows) as usize, random.below(columns * 2) as usize);
                    data[y * stride + (x >> 1) * CHANNELS + (x & 1)] = value;
                }
            }
            Impulses::WholePixels => {
                for _ in 0..(fraction * pixels / 2.0).ceil() as u64 {
                    let (y, x) = (random.below(height as u32) as usize, random.below(width as u32) as usize);
                    let start = y * stride + x * CHANNELS;
                    data[start..start + CHANNELS].fill(value);
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::frame::FrameBuf;
    use crate::simd::with_each;
    use crate::testing::{run_on, samples};
    use pdk_seed::Key;

    #[test]
    fn the_normal_numbers_have_the_moments_of_a_normal_distribution() {
        let moment =
            |power: i32| normals().map(|z| (f64::from(z) / 4096.0).powi(power)).sum::<f64>() / 65536.0;
        assert_eq!(moment(1), 0.0);
        assert_eq!(moment(3), 0.0);
        assert!((moment(2) - 1.0).abs() < 1e-4, "{}", moment(2));
        assert!((moment(4) - 3.0).abs() < 5e-3, "{}", moment(4));
    }

    #[test]
    fn the_same_frame_is_the_same_on_every_machine() {
        // Pins table, stream and arithmetic together. A change here needs a new version of the perturbations.
        let src = FrameBuf::from_vec((0..=255).cycle().take(90).collect(), 10, 3).unwrap();
        let mut dst = FrameBuf::new(10, 3);
        gaussian_noise(src.as_ref(), dst.as_mut(), 0.1, &mut Key([1; 32]).frame(0));
        let gaussian = dst.data()[80..].to_vec();
        speckle_noise(src.as_ref(), dst.as_mut(), 0.1, &mut Key([1; 32]).frame(0));
        let speckle = dst.data()[80..].to_vec();
        impulse_noise(src.as_ref(), dst.as_mut(), 0.3, Impulses::Published, &mut Key([1; 32]).frame(0));
        let impulse = dst.data()[..10].to_vec();
        assert_eq!(gaussian, [66, 85, 68, 135, 71, 100, 87, 77, 126, 56]);
        assert_eq!(speckle, [75, 82, 77, 99, 79, 89, 86, 83, 101, 77]);
        assert_eq!(impulse, [0, 1, 2, 3, 0, 5, 0, 0, 8, 9]);
    }

    /// Draws and applies one number at a time.
    fn plain(src: Frame<'_>, random: &mut Random, apply: impl Fn(f32, f32) -> f32) -> FrameBuf {
        let mut out = src.to_buf();
        for y in 0..src.height() {
            let mut bytes = vec![0; src.width() * CHANNELS * 2];
            random.fill(&mut bytes);
            for (to, pair) in out.as_mut().row_mut(y).iter_mut().zip(bytes.chunks(2)) {
                let place = f64::from(u16::from_le_bytes([pair[0], pair[1]]));
                let normal = (normal_quantile((place + 0.5) / 65536.0) * 4096.0).round() / 4096.0;
                *to = apply(f32::from(*to), normal as f32) as u8;
            }
        }
        out
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]

        #[test]
        fn gaussian_noise_matches_the_plain_version(sample in samples(), sigma in 0.0..1.0, key: [u8; 32]) {
            let scale = (sigma * 255.0) as f32;
            let expected = plain(sample.frame(), &mut Key(key).frame(1), |v, z| {
                (v + z * scale).round_ties_even().clamp(0.0, 255.0)
            });
            let result = run_on(&sample, |src, dst| gaussian_noise(src, dst, sigma, &mut Key(key).frame(1)));
            prop_assert_eq!(result, expected);
        }

        #[test]
        fn speckle_noise_matches_the_plain_version(sample in samples(), sigma in 0.0..1.0, key: [u8; 32]) {
            let expected = plain(sample.frame(), &mut Key(key).frame(1), |v, z| {
                (v * (1.0 + z * sigma as f32)).clamp(0.0, 255.0).floor()
            });
            let result = run_on(&sample, |src, dst| speckle_noise(src, dst, sigma, &mut Key(key).frame(1)));
            prop_assert_eq!(result, expected);
        }

        #[test]
        fn impulse_noise_writes_extremes_only(sample in samples(), fraction in 0.0..=1.0, whole: bool) {
            let impulses = if whole { Impulses::WholePixels } else { Impulses::Published };
            let result = run_on(&sample, |src, dst| {
                impulse_noise(src, dst, fraction, impulses, &mut Key([2; 32]).frame(1));
            });
            let src = sample.frame().to_buf();
            prop_assert!(src.data().iter().zip(result.data()).all(|(a, b)| a == b || [0, 255].contains(b)));
        }
    }

    #[test]
    fn rows_longer_than_a_block_match_the_plain_version() {
        let src = FrameBuf::from_vec((0..=255).cycle().take(1500 * 3 * 2).collect(), 1500, 2).unwrap();
        let expected = plain(src.as_ref(), &mut Key([4; 32]).frame(3), |v, z| {
            (v + z * 0.2 * 255.0).round_ties_even().clamp(0.0, 255.0)
        });
        with_each(|instructions| {
            let mut dst = FrameBuf::new(1500, 2);
            gaussian_noise(src.as_ref(), dst.as_mut(), 0.2, &mut Key([4; 32]).frame(3));
            assert!(dst == expected, "{instructions:?}");
        });
    }

    #[test]
    fn rows_longer_than_a_block_are_done_to_the_end() {
        let src = FrameBuf::from_vec(vec![128; 1500 * 3 * 2], 1500, 2).unwrap();
        let mut dst = FrameBuf::new(1500, 2);
        gaussian_noise(src.as_ref(), dst.as_mut(), 0.2, &mut Key([1; 32]).frame(0));
        for block in dst.data().chunks(100) {
            let mean = block.iter().map(|&v| f64::from(v)).sum::<f64>() / block.len() as f64;
            assert!((mean - 128.0).abs() < 25.0 && block.iter().any(|&v| v != 128), "{mean}");
        }
    }
}
