//! Mixing a frame with another, or with a colour, where a mask says so.
//!
//! The mask has a share for each value: 0 leaves the value as it is, 255 replaces it. All sums are whole numbers and
//! rounded once, so a mask of 0 and one of 255 give exactly one frame or the other.

use crate::frame::{CHANNELS, Frame, FrameMut};
use crate::simd::vectorised;

/// `(mask * other + (255 - mask) * src) / 255` for each value, rounded.
///
/// # Panics
/// If the sizes differ.
pub fn blend_through(src: Frame<'_>, other: Frame<'_>, mask: Frame<'_>, mut dst: FrameMut<'_>) {
    assert!(
        src.same_size(&other) && src.same_size(&mask) && src.same_size(&dst.as_ref()),
        "blend_through between frames of different size"
    );
    for y in 0..src.height() {
        blend_row(src.row(y), other.row(y), mask.row(y), dst.row_mut(y));
    }
}

/// As [`blend_through`] with a frame of one colour. `row` is a workspace.
///
/// # Panics
/// If the sizes differ.
pub fn tint(src: Frame<'_>, rgb: [u8; 3], mask: Frame<'_>, mut dst: FrameMut<'_>, row: &mut Vec<u8>) {
    assert!(src.same_size(&mask) && src.same_size(&dst.as_ref()), "tint between frames of different size");
    row.resize(src.width() * CHANNELS, 0);
    row.chunks_exact_mut(CHANNELS).for_each(|pixel| pixel.copy_from_slice(&rgb));
    for y in 0..src.height() {
        blend_row(src.row(y), row, mask.row(y), dst.row_mut(y));
    }
}

vectorised! {
    fn blend_row / blend_row_avx2 / blend_row_avx512 (src: &[u8], other: &[u8], mask: &[u8], dst: &mut [u8]) {
        for ((dst, &src), (&other, &mask)) in dst.iter_mut().zip(src).zip(other.iter().zip(mask)) {
            // At most 255 * 255, and with what is added for rounding still below 2^16.
            let sum = u16::from(mask) * u16::from(other) + u16::from(255 - mask) * u16::from(src) + 128;
            // Divides by 255; exact for all sums that can occur.
            *dst = ((sum + (sum >> 8)) >> 8) as u8;
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::frame::FrameBuf;
    use crate::testing::{pairs, plain, run_on};

    fn mixed(a: u8, b: u8, mask: u8) -> u8 {
        let sum = u32::from(mask) * u32::from(b) + (255 - u32::from(mask)) * u32::from(a);
        ((sum + 127) / 255) as u8
    }

    proptest! {
        #[test]
        fn matches_the_plain_version((first, second) in pairs(), rgb in any::<[u8; 3]>()) {
            let (src, other) = (first.frame(), second.frame());
            let mask = plain(src, |x, y| src.pixel(src.width() - 1 - x, y).map(|v| v.wrapping_mul(7)));
            let mask = mask.as_ref();
            let through = plain(src, |x, y| {
                let (a, b, m) = (src.pixel(x, y), other.pixel(x, y), mask.pixel(x, y));
                [0, 1, 2].map(|c| mixed(a[c], b[c], m[c]))
            });
            prop_assert_eq!(run_on(&first, |src, dst| blend_through(src, other, mask, dst)), through);
            let tinted = plain(src, |x, y| {
                let (a, m) = (src.pixel(x, y), mask.pixel(x, y));
                [0, 1, 2].map(|c| mixed(a[c], rgb[c], m[c]))
            });
            let mut row = Vec::new();
            prop_assert_eq!(run_on(&first, |src, dst| tint(src, rgb, mask, dst, &mut row)), tinted);
        }
    }

    #[test]
    fn all_values_are_rounded_to_the_nearest() {
        let ramp = FrameBuf::from_vec((0..=255).flat_map(|v| [v; 3]).collect(), 256, 1).unwrap();
        for other in 0..=255 {
            for mask in 0..=255 {
                let (mut dst, mut row) = (FrameBuf::new(256, 1), Vec::new());
                let share = FrameBuf::from_vec(vec![mask; 256 * 3], 256, 1).unwrap();
                tint(ramp.as_ref(), [other; 3], share.as_ref(), dst.as_mut(), &mut row);
                for (value, &found) in dst.data().iter().step_by(3).enumerate() {
                    assert_eq!(found, mixed(value as u8, other, mask), "{value} {other} {mask}");
                }
            }
        }
    }
}
