//! Grey.

use crate::frame::{Frame, FrameMut, for_each_row};
use crate::simd::vectorised;

/// The luma of ITU-R BT.601, `0.299 R + 0.587 G + 0.114 B`, in 15-bit fixed point, rounded.
#[inline(always)]
pub fn grey(r: u8, g: u8, b: u8) -> u8 {
    ((9798 * i32::from(r) + 19235 * i32::from(g) + 3735 * i32::from(b) + (1 << 14)) >> 15) as u8
}

/// Writes each pixel's grey to all of its three channels.
///
/// # Panics
/// If the sizes differ.
pub fn grayscale(src: Frame<'_>, dst: FrameMut<'_>) {
    for_each_row(src, dst, grayscale_row);
}

vectorised! {
    fn grayscale_row / grayscale_row_avx2 (from: &[u8], to: &mut [u8]) {
        for (to, from) in to.chunks_exact_mut(3).zip(from.chunks_exact(3)) {
            let value = grey(from[0], from[1], from[2]);
            to[0] = value;
            to[1] = value;
            to[2] = value;
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::testing::{plain, run_on, samples};

    #[test]
    fn grey_is_the_luma_to_within_rounding() {
        for r in (0..=255).step_by(5) {
            for g in (0..=255).step_by(3) {
                for b in (0..=255).step_by(5) {
                    let luma = 0.299 * f64::from(r) + 0.587 * f64::from(g) + 0.114 * f64::from(b);
                    assert!((f64::from(grey(r, g, b)) - luma).abs() < 0.51, "{r} {g} {b}");
                }
            }
        }
        assert_eq!([grey(255, 255, 255), grey(0, 0, 0), grey(255, 0, 0)], [255, 0, 76]);
    }

    proptest! {
        #[test]
        fn grayscale_matches_the_plain_version(sample in samples()) {
            let src = sample.frame();
            let expected = plain(src, |x, y| {
                let [r, g, b] = src.pixel(x, y);
                [grey(r, g, b); 3]
            });
            prop_assert_eq!(run_on(&sample, grayscale), expected);
        }
    }
}
