//! Saturation alone.

use crate::frame::{Frame, FrameMut, for_each_row};
use crate::hsv::{block_to_hsv, block_to_rgb};
use crate::planes::{BLOCK_BYTES, put_together, take_apart};
use crate::simd::{vectorised, whole_byte};

/// Multiplies the saturation in HSV by a factor; it is clipped to 255 and loses its fraction. Hue and value keep the
/// steps of 8-bit HSV. A negative factor counts as 0.
///
/// Which of two neighbouring steps a hue half way between them takes follows the published tool, whose saturation
/// filters exchange red and blue on the way to HSV and on the way back.
///
/// # Panics
/// If the sizes differ.
pub fn scale_saturation(src: Frame<'_>, dst: FrameMut<'_>, factor: f64) {
    let factor = factor.max(0.0) as f32;
    for_each_row(src, dst, |from, to| scale_saturation_row(from, to, factor));
}

vectorised! {
    fn scale_saturation_row / scale_saturation_row_avx2 / scale_saturation_row_avx512 (
        from: &[u8], to: &mut [u8], factor: f32,
    ) {
        for (from, to) in from.chunks(BLOCK_BYTES).zip(to.chunks_mut(BLOCK_BYTES)) {
            let mut planes = take_apart(from);
            planes.reverse();
            block_to_hsv(&mut planes);
            for saturation in &mut planes[1] {
                *saturation = whole_byte((f32::from(*saturation) * factor).min(255.0));
            }
            block_to_rgb(&mut planes);
            planes.reverse();
            put_together(&planes, to);
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::hsv::{hsv_to_rgb, rgb_to_hsv};
    use crate::testing::{plain, run_on, samples};

    proptest! {
        #[test]
        fn matches_the_plain_version(sample in samples(), factor in -1.0..5.0) {
            let src = sample.frame();
            let expected = plain(src, |x, y| {
                let [r, g, b] = src.pixel(x, y);
                let [h, s, v] = rgb_to_hsv([b, g, r]);
                let saturation = whole_byte((f32::from(s) * f64::max(factor, 0.0) as f32).min(255.0));
                let [b, g, r] = hsv_to_rgb([h, saturation, v]);
                [r, g, b]
            });
            prop_assert_eq!(run_on(&sample, |src, dst| scale_saturation(src, dst, factor)), expected);
        }
    }
}
