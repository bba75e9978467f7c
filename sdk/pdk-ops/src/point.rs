//! Operations on each value by itself: lookup tables and linear maps.

use crate::frame::{Frame, FrameMut};
use crate::simd::round_to_byte;
use crate::table::look_up;

/// Replaces each value `v` by `table[v]`.
///
/// # Panics
/// If the sizes differ.
pub fn lookup(src: Frame<'_>, dst: FrameMut<'_>, table: &[u8; 256]) {
    look_up(src, dst, table);
}

/// Multiplies the distance of each value from `pivot` by `factor`: `pivot + (v - pivot) * factor`, clipped to 0..=255
/// and rounded half to even. A pivot of 0 changes brightness, one of 127.5 contrast.
///
/// # Panics
/// If the sizes differ.
pub fn scale_about(src: Frame<'_>, dst: FrameMut<'_>, pivot: f64, factor: f64) {
    let (pivot, factor) = (pivot as f32, factor as f32);
    look_up(src, dst, &std::array::from_fn(|v| round_to_byte(pivot + (v as f32 - pivot) * factor)));
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::testing::{plain, run_on, samples};

    proptest! {
        #[test]
        fn lookup_matches_the_plain_version(sample in samples(), first: u8, factor in 1u8..) {
            let table: [u8; 256] = std::array::from_fn(|v| first.wrapping_add((v as u8).wrapping_mul(factor)));
            let src = sample.frame();
            let expected = plain(src, |x, y| src.pixel(x, y).map(|v| table[usize::from(v)]));
            prop_assert_eq!(run_on(&sample, |src, dst| lookup(src, dst, &table)), expected);
        }

        #[test]
        fn scale_about_matches_the_plain_version(
            sample in samples(), pivot in 0.0..255.0, factor in -3.0..10.0,
        ) {
            let src = sample.frame();
            let expected = plain(src, |x, y| src.pixel(x, y).map(|v| {
                let value = pivot as f32 + (f32::from(v) - pivot as f32) * factor as f32;
                value.round_ties_even().clamp(0.0, 255.0) as u8
            }));
            prop_assert_eq!(run_on(&sample, |src, dst| scale_about(src, dst, pivot, factor)), expected);
        }
    }
}
