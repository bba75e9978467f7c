//! False colours: channels exchanged, inverted or added.

use crate::frame::{CHANNELS, Frame, FrameMut, for_each_row};
use crate::simd::{round_inside_byte, vectorised};

/// What half the sum of two channels is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Sums {
    /// The sum loses its ninth bit before it is halved, so bright channels come out dark.
    Wrapped,
    /// The mean of the two channels, without its fraction.
    Means,
}

/// The effects by number. The first four permute or invert; the fifth is half the sum of neighbouring channels.
#[inline(always)]
fn effect<const NUMBER: usize>([r, g, b]: [u8; 3]) -> [u8; 3] {
    match NUMBER {
        0 => [g, b, r],
        1 => [g, r, b],
        2 => [b, g, r],
        3 => [255 - r, 255 - g, 255 - b],
        WRAPPED => [r.wrapping_add(g) >> 1, g.wrapping_add(b) >> 1, b.wrapping_add(r) >> 1],
        _ => [(r, g), (g, b), (b, r)].map(|(p, q)| ((u16::from(p) + u16::from(q)) >> 1) as u8),
    }
}

/// The fifth effect with [`Sums::Wrapped`] and with [`Sums::Means`].
const WRAPPED: usize = 4;
const MEANS: usize = 5;

/// Gives the frame false colours. `position` picks the effect: 0 is green, blue, red; 1 is green, red, blue; 2 is blue,
/// green, red; 3 is inverted; 4 is half the sum of red and green, of green and blue, of blue and red. Between two whole
/// numbers their effects are blended, rounded half to even; outside 0..=4 the nearest counts.
///
/// # Panics
/// If the sizes differ.
pub fn false_color(src: Frame<'_>, dst: FrameMut<'_>, position: f64, sums: Sums) {
    let position = position.clamp(0.0, 4.0);
    let first = position as usize;
    let share = (position - first as f64) as f32;
    for_each_row(src, dst, |from, to| match share == 0.0 {
        true => pure_row(from, to, first, sums),
        false => blended_row(from, to, first, share, sums),
    });
}

/// Computes each pixel by itself.
#[inline(always)]
fn each(from: &[u8], to: &mut [u8], pixel: impl Fn([u8; 3]) -> [u8; 3]) {
    for (to, from) in to.chunks_exact_mut(CHANNELS).zip(from.chunks_exact(CHANNELS)) {
        let [r, g, b] = pixel([from[0], from[1], from[2]]);
        to[0] = r;
        to[1] = g;
        to[2] = b;
    }
}

#[inline(always)]
fn each_blended<const FIRST: usize, const SECOND: usize>(from: &[u8], to: &mut [u8], share: f32) {
    let rest = 1.0 - share;
    let blend = |a: u8, b: u8| round_inside_byte(f32::from(a) * rest + f32::from(b) * share);
    each(from, to, |rgb| {
        let (a, b) = (effect::<FIRST>(rgb), effect::<SECOND>(rgb));
        [blend(a[0], b[0]), blend(a[1], b[1]), blend(a[2], b[2])]
    });
}

vectorised! {
    fn pure_row / pure_row_avx2 (from: &[u8], to: &mut [u8], first: usize, sums: Sums) {
        match (first, sums) {
            (0, _) => each(from, to, effect::<0>),
            (1, _) => each(from, to, effect::<1>),
            (2, _) => each(from, to, effect::<2>),
            (3, _) => each(from, to, effect::<3>),
            (_, Sums::Wrapped) => each(from, to, effect::<WRAPPED>),
            (_, Sums::Means) => each(from, to, effect::<MEANS>),
        }
    }
}

vectorised! {
    fn blended_row / blended_row_avx2 (
        from: &[u8], to: &mut [u8], first: usize, share: f32, sums: Sums,
    ) {
        match (first, sums) {
            (0, _) => each_blended::<0, 1>(from, to, share),
            (1, _) => each_blended::<1, 2>(from, to, share),
            (2, _) => each_blended::<2, 3>(from, to, share),
            (_, Sums::Wrapped) => each_blended::<3, WRAPPED>(from, to, share),
            (_, Sums::Means) => each_blended::<3, MEANS>(from, to, share),
        }
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::testing::{plain, run_on, samples};

    fn plain_effect(number: usize, sums: Sums, rgb: [u8; 3]) -> [u8; 3] {
        let [r, g, b] = rgb.map(u32::from);
        let sum = |p: u32, q: u32| if sums == Sums::Wrapped { (p + q) % 256 / 2 } else { (p + q) / 2 };
        let out = match number {
            0 => [g, b, r],
            1 => [g, r, b],
            2 => [b, g, r],
            3 => [255 - r, 255 - g, 255 - b],
            _ => [sum(r, g), sum(g, b), sum(b, r)],
        };
        out.map(|v| v as u8)
    }

    proptest! {
        #[test]
        fn matches_the_plain_version(
            sample in samples(),
            position in prop_oneof![0.0f64..=4.0, (0u8..5).prop_map(f64::from)],
            wrapped: bool,
        ) {
            let sums = if wrapped { Sums::Wrapped } else { Sums::Means };
            let src = sample.frame();
            let (first, share) = (position as usize, position.fract() as f32);
            let expected = plain(src, |x, y| {
                let a = plain_effect(first, sums, src.pixel(x, y));
                let b = plain_effect(first + 1, sums, src.pixel(x, y));
                [0, 1, 2].map(|c| {
                    (f32::from(a[c]) * (1.0 - share) + f32::from(b[c]) * share).round_ties_even() as u8
                })
            });
            prop_assert_eq!(run_on(&sample, |src, dst| false_color(src, dst, position, sums)), expected);
        }
    }
}
