//! Operations on each value by itself: lookup tables and linear maps.

use crate::frame::{Frame, FrameMut, for_each_row};
use crate::simd::{round_to_byte, vectorised};

/// Replaces each value `v` by `table[v]`.
///
/// # Panics
/// Where the sizes differ.
pub fn lookup(src: Frame<'_>, dst: FrameMut<'_>, table: &[u8; 256]) {
    for_each_row(src, dst, |from, to| {
        for (to, &from) in to.iter_mut().zip(from) {
            *to = table[usize::from(from)];
        }
    });
}

/// Replaces each value `v` by `gain * v + offset`, clipped to 0..=255 and rounded half to even.
///
/// # Panics
/// Where the sizes differ.
pub fn linear(src: Frame<'_>, dst: FrameMut<'_>, gain: f32, offset: f32) {
    for_each_row(src, dst, |from, to| linear_row(from, to, gain, offset));
}

vectorised! {
    fn linear_row / linear_row_portable / linear_row_avx2 (
        from: &[u8], to: &mut [u8], gain: f32, offset: f32,
    ) {
        for (to, &from) in to.iter_mut().zip(from) {
            *to = round_to_byte(f32::from(from) * gain + offset);
        }
    }
}

/// Multiplies the distance of each value from the middle grey, 127.5, by `factor`; clipped and rounded half to even.
///
/// # Panics
/// Where the sizes differ.
pub fn contrast(src: Frame<'_>, dst: FrameMut<'_>, factor: f64) {
    linear(src, dst, factor as f32, (127.5 * (1.0 - factor)) as f32);
}
