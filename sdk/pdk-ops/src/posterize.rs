//! Fewer tones.

use crate::frame::{Frame, FrameMut};
use crate::simd::round_inside_byte;
use crate::table::look_up;

/// Adding and subtracting this rounds numbers of magnitude below 2^22 half to even.
const SHIFT: f32 = 12_582_912.0;

/// The smallest distance of two boundaries between tones is 1/255 of a bin; half of that keeps a value that lies on a
/// boundary on its upper side.
const TIE: f32 = 1.0 / 512.0;

/// Divides 0..=255 into `bins` bins of equal width, which need not be a whole number, and gives all values in a bin the
/// same tone: the bin's number, from 0, times `step`, rounded half to even and clipped to 255. The topmost value begins
/// a bin of its own, as in 0..=255 divided by a width of `255 / bins`.
///
/// # Panics
/// If the sizes differ.
pub fn posterize(src: Frame<'_>, dst: FrameMut<'_>, bins: f64, step: f64) {
    let (scale, step) = ((bins / 255.0) as f32, step as f32);
    let tone = |v: usize| {
        let bin = v as f32 * scale + (TIE - 0.5) + SHIFT - SHIFT;
        round_inside_byte((bin * step).min(255.0))
    };
    look_up(src, dst, &std::array::from_fn(tone));
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::testing::{plain, run_on, samples};

    proptest! {
        #[test]
        fn whole_numbers_of_bins_match_integer_arithmetic(sample in samples(), bins in 1u32..=256, step in 0u32..=255) {
            let src = sample.frame();
            let tone = |v: u8| (u32::from(v) * bins / 255 * step).min(255) as u8;
            let expected = plain(src, |x, y| src.pixel(x, y).map(tone));
            let actual = run_on(&sample, |src, dst| posterize(src, dst, bins.into(), step.into()));
            prop_assert_eq!(actual, expected);
        }
    }

    #[test]
    fn every_value_is_in_its_bin_for_every_whole_number_of_bins() {
        let src = crate::FrameBuf::from_vec((0..=255).cycle().take(768).collect(), 256, 1).unwrap();
        for bins in 1..=256u32 {
            let mut dst = crate::FrameBuf::new(256, 1);
            posterize(src.as_ref(), dst.as_mut(), bins.into(), 0.5);
            for (from, to) in src.data().iter().zip(dst.data()) {
                let expected = f64::from(u32::from(*from) * bins / 255) * 0.5;
                assert_eq!(f64::from(*to), expected.round_ties_even(), "{from} in {bins} bins");
            }
        }
    }
}
