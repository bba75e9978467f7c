//! Weighted sums of frames.

use crate::color::grey;
use crate::frame::{Frame, FrameMut, for_each_row};
use crate::planes::{BLOCK_BYTES, put_together, take_apart};
use crate::point::truncated;
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
/// If the sizes differ.
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
    fn blend_row / blend_row_avx2 / blend_row_avx512 (a: &[u8], b: &[u8], dst: &mut [u8], weight: f32, rest: f32) {
        for ((dst, &a), &b) in dst.iter_mut().zip(a).zip(b) {
            *dst = blend_values(a, b, weight, rest);
        }
    }
}

/// Blends the frame with its own grey: `weight * grey + (1 - weight) * src`, rounded half to even.
///
/// # Panics
/// If the sizes differ.
pub fn blend_with_grey(src: Frame<'_>, dst: FrameMut<'_>, weight: f64) {
    let (weight, rest) = shares(weight);
    for_each_row(src, dst, |from, to| blend_with_grey_row(from, to, weight, rest));
}

vectorised! {
    fn blend_with_grey_row / blend_with_grey_row_avx2 / blend_with_grey_row_avx512 (
        from: &[u8], to: &mut [u8], weight: f32, rest: f32,
    ) {
        for (from, to) in from.chunks(BLOCK_BYTES).zip(to.chunks_mut(BLOCK_BYTES)) {
            let mut planes = take_apart(from);
            let [reds, greens, blues] = &mut planes;
            for ((r, g), b) in reds.iter_mut().zip(greens).zip(blues) {
                let middle = grey(*r, *g, *b);
                *r = blend_values(middle, *r, weight, rest);
                *g = blend_values(middle, *g, weight, rest);
                *b = blend_values(middle, *b, weight, rest);
            }
            put_together(&planes, to);
        }
    }
}

/// The sum of frames by their weights, rounded half up and clipped to 0..=255. Products are added in the order of the frames.
///
/// # Panics
/// If the sizes differ.
pub fn weighted_sum(frames: &[(Frame<'_>, f32)], mut dst: FrameMut<'_>) {
    let fit = frames.iter().all(|(frame, _)| frame.same_size(&dst.as_ref()));
    assert!(fit, "weighted_sum of frames of different size");
    for (y, to) in dst.rows_mut().enumerate() {
        weighted_sum_row(frames, y, to);
    }
}

/// Values whose sums are computed at a time: registers have room for them.
const TOGETHER: usize = 32;

vectorised! {
    fn weighted_sum_row / weighted_sum_row_avx2 / weighted_sum_row_avx512 (
        frames: &[(Frame<'_>, f32)], y: usize, to: &mut [u8],
    ) {
        let (chunks, rest) = to.as_chunks_mut::<TOGETHER>();
        let whole = chunks.len() * TOGETHER;
        for (chunk, to) in chunks.iter_mut().enumerate() {
            let mut sums = [0.5f32; TOGETHER];
            for (frame, weight) in frames {
                let from = &frame.row(y)[chunk * TOGETHER..][..TOGETHER];
                for (sum, value) in sums.iter_mut().zip(from) {
                    *sum += weight * f32::from(*value);
                }
            }
            for (to, sum) in to.iter_mut().zip(sums) {
                *to = truncated(sum);
            }
        }
        for (x, to) in rest.iter_mut().enumerate() {
            let products = frames.iter().map(|(frame, weight)| weight * f32::from(frame.row(y)[whole + x]));
            *to = truncated(products.fold(0.5, |sum, product| sum + product));
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::testing::{pairs, plain, run_on, samples};

    fn plain_blend(a: u8, weight: f64, b: u8) -> u8 {
        (f32::from(a) * weight as f32 + f32::from(b) * (1.0 - weight) as f32).round_ties_even() as u8
    }

    proptest! {
        #[test]
        fn blend_matches_the_plain_version((a, b) in pairs(), weight in 0.0..=1.0) {
            let (first, second) = (a.frame(), b.frame());
            let expected = plain(first, |x, y| {
                let (p, q) = (first.pixel(x, y), second.pixel(x, y));
                [0, 1, 2].map(|c| plain_blend(p[c], weight, q[c]))
            });
            prop_assert_eq!(run_on(&a, |src, dst| blend(src, weight, second, dst)), expected);
        }

        #[test]
        fn blend_with_grey_matches_the_plain_version(sample in samples(), weight in 0.0..=1.0) {
            let src = sample.frame();
            let expected = plain(src, |x, y| {
                let [r, g, b] = src.pixel(x, y);
                [r, g, b].map(|v| plain_blend(grey(r, g, b), weight, v))
            });
            prop_assert_eq!(run_on(&sample, |src, dst| blend_with_grey(src, dst, weight)), expected);
        }
    }

    proptest! {
        #[test]
        fn weighted_sum_matches_the_plain_version((a, b) in pairs(), weights: [f32; 3]) {
            let weights = weights.map(|weight| weight % 2.0);
            let frames = [(a.frame(), weights[0]), (b.frame(), weights[1]), (a.frame(), weights[2])];
            let expected = plain(a.frame(), |x, y| {
                [0, 1, 2].map(|c| {
                    let products = frames.map(|(frame, weight)| weight * f32::from(frame.pixel(x, y)[c]));
                    (0.5 + products[0] + products[1] + products[2]).clamp(0.0, 255.0) as u8
                })
            });
            prop_assert_eq!(run_on(&a, |_, dst| weighted_sum(&frames, dst)), expected);
        }
    }

    #[test]
    fn weights_beyond_the_ends_give_one_frame_or_the_other() {
        let (mut a, b) = (crate::FrameBuf::new(3, 2), crate::FrameBuf::new(3, 2));
        a.as_mut().data_mut().fill(255);
        for (weight, expected) in [(-0.5, 0), (0.0, 0), (0.5, 128), (1.0, 255), (7.0, 255)] {
            let mut dst = crate::FrameBuf::new(3, 2);
            blend(a.as_ref(), weight, b.as_ref(), dst.as_mut());
            assert!(dst.data().iter().all(|&v| v == expected), "{weight}: {dst:?}");
        }
    }
}
