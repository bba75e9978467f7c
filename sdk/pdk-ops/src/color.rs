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
/// Where the sizes differ.
pub fn grayscale(src: Frame<'_>, dst: FrameMut<'_>) {
    for_each_row(src, dst, grayscale_row);
}

vectorised! {
    fn grayscale_row / grayscale_row_portable / grayscale_row_avx2 (from: &[u8], to: &mut [u8]) {
        for (to, from) in to.chunks_exact_mut(3).zip(from.chunks_exact(3)) {
            let value = grey(from[0], from[1], from[2]);
            to[0] = value;
            to[1] = value;
            to[2] = value;
        }
    }
}
