//! Weighted sums of two frames.

use crate::frame::{Frame, FrameMut};
use crate::simd::vectorised;

/// Weights are fixed-point numbers with this many fractional bits, so that a product with a weight of one still
/// fits the 16-bit multiplications that processors do fastest.
const WEIGHT_BITS: u32 = 14;
const ONE: i16 = 1 << WEIGHT_BITS;

/// A weight as a fixed-point number, clipped to 0..=1.
fn fixed_weight(weight: f64) -> i16 {
    (weight.clamp(0.0, 1.0) * f64::from(ONE)).round() as i16
}

/// Two values weighted and rounded, half up.
#[inline(always)]
pub(crate) fn blend_values(a: u8, b: u8, weight: i16) -> u8 {
    let sum = i32::from(a) * i32::from(weight) + i32::from(b) * i32::from(ONE - weight);
    ((sum + (1 << (WEIGHT_BITS - 1))) >> WEIGHT_BITS) as u8
}

/// `weight * a + (1 - weight) * b`, rounded. The weight is clipped to 0..=1 and exact to 1/32768, which moves a
/// result by less than a hundredth of a grey level before rounding.
///
/// # Panics
/// Where the sizes differ.
pub fn blend(a: Frame<'_>, weight: f64, b: Frame<'_>, mut dst: FrameMut<'_>) {
    assert!(a.same_size(&b) && a.same_size(&dst.as_ref()), "blend of frames of different size");
    let weight = fixed_weight(weight);
    if let (Some(a), Some(b), Some(dst)) = (a.contiguous(), b.contiguous(), dst.contiguous_mut()) {
        return blend_row(a, b, dst, weight);
    }
    for y in 0..a.height() {
        blend_row(a.row(y), b.row(y), dst.row_mut(y), weight);
    }
}

vectorised! {
    fn blend_row / blend_row_portable / blend_row_avx2 (a: &[u8], b: &[u8], dst: &mut [u8], weight: i16) {
        for ((dst, &a), &b) in dst.iter_mut().zip(a).zip(b) {
            *dst = blend_values(a, b, weight);
        }
    }
}

/// Blends the frame with its own grey: `weight * grey + (1 - weight) * src`, rounded.
///
/// # Panics
/// Where the sizes differ.
pub fn blend_with_grey(src: Frame<'_>, dst: FrameMut<'_>, weight: f64) {
    let weight = fixed_weight(weight);
    crate::frame::for_each_row(src, dst, |from, to| blend_with_grey_row(from, to, weight));
}

vectorised! {
    fn blend_with_grey_row / blend_with_grey_row_portable / blend_with_grey_row_avx2 (
        from: &[u8], to: &mut [u8], weight: i16,
    ) {
        for (to, from) in to.chunks_exact_mut(3).zip(from.chunks_exact(3)) {
            let grey = crate::color::grey(from[0], from[1], from[2]);
            to[0] = blend_values(grey, from[0], weight);
            to[1] = blend_values(grey, from[1], weight);
            to[2] = blend_values(grey, from[2], weight);
        }
    }
}
