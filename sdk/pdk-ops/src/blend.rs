//! Weighted sums of two frames.

use crate::color::grey;
use crate::frame::{CHANNELS, Frame, FrameMut, for_each_row};
use crate::simd::{round_inside_byte, vectorised};

/// Two values weighted, rounded half to even. `rest` is what is left of one.
#[inline(always)]
fn blend_values(a: u8, b: u8, weight: f32, rest: f32) -> u8 {
    round_inside_byte(f32::from(a) * weight + f32::from(b) * rest)
}

/// A weight, clipped to 0..=1, and what is left of one.
fn shares(weight: f64) -> (f32, f32) {
    let weight = weight.clamp(0.0, 1.0);
    (weight as f32, (1.0 - weight) as f32)
}

/// `weight * a + (1 - weight) * b`, rounded half to even. The weight is clipped to 0..=1.
///
/// # Panics
/// Where the sizes differ.
pub fn blend(a: Frame<'_>, weight: f64, b: Frame<'_>, mut dst: FrameMut<'_>) {
    assert!(a.same_size(&b) && a.same_size(&dst.as_ref()), "blend of frames of different size");
    let (weight, rest) = shares(weight);
    if let (Some(a), Some(b), Some(dst)) = (a.contiguous(), b.contiguous(), dst.contiguous_mut()) {
        return blend_row(a, b, dst, weight, rest);
    }
    for y in 0..a.height() {
        blend_row(a.row(y), b.row(y), dst.row_mut(y), weight, rest);
    }
}

vectorised! {
    fn blend_row / blend_row_portable / blend_row_avx2 (a: &[u8], b: &[u8], dst: &mut [u8], weight: f32, rest: f32) {
        for ((dst, &a), &b) in dst.iter_mut().zip(a).zip(b) {
            *dst = blend_values(a, b, weight, rest);
        }
    }
}

/// Blends the frame with its own grey: `weight * grey + (1 - weight) * src`, rounded half to even.
///
/// # Panics
/// Where the sizes differ.
pub fn blend_with_grey(src: Frame<'_>, dst: FrameMut<'_>, weight: f64) {
    let (weight, rest) = shares(weight);
    for_each_row(src, dst, |from, to| blend_with_grey_row(from, to, weight, rest));
}

vectorised! {
    fn blend_with_grey_row / blend_with_grey_row_portable / blend_with_grey_row_avx2 (
        from: &[u8], to: &mut [u8], weight: f32, rest: f32,
    ) {
        for (to, from) in to.chunks_exact_mut(CHANNELS).zip(from.chunks_exact(CHANNELS)) {
            let middle = grey(from[0], from[1], from[2]);
            to[0] = blend_values(middle, from[0], weight, rest);
            to[1] = blend_values(middle, from[1], weight, rest);
            to[2] = blend_values(middle, from[2], weight, rest);
        }
    }
}
