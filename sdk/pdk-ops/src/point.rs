//! Operations on each value by itself: lookup tables and linear maps.

use crate::frame::{CHANNELS, Frame, FrameMut, for_each_row};
use crate::planes::{BLOCK_BYTES, put_together, take_apart};
use crate::simd::{round_to_byte, vectorised};
use crate::table::{look_up, look_up_row};

/// Replaces each value `v` by `table[v]`.
///
/// # Panics
/// If the sizes differ.
pub fn lookup(src: Frame<'_>, dst: FrameMut<'_>, table: &[u8; 256]) {
    look_up(src, dst, table);
}

/// Replaces each value `v` by `table[v]`, with a table for each channel.
///
/// # Panics
/// If the sizes differ.
pub fn lookup_by_channel(src: Frame<'_>, dst: FrameMut<'_>, tables: &[[u8; 256]; CHANNELS]) {
    for_each_row(src, dst, |from, to| look_up_channels(from, to, tables));
}

vectorised! {
    fn look_up_channels / look_up_channels_avx2 / look_up_channels_avx512 (
        from: &[u8], to: &mut [u8], tables: &[[u8; 256]; CHANNELS],
    ) {
        for (from, to) in from.chunks(BLOCK_BYTES).zip(to.chunks_mut(BLOCK_BYTES)) {
            let mut planes = take_apart(from);
            for (plane, table) in planes.iter_mut().zip(tables) {
                let from = *plane;
                look_up_row(&from, plane, table);
            }
            put_together(&planes, to);
        }
    }
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

/// Multiplies values in place, rounded half up and clipped to 0..=255.
pub fn scale_in_place(values: &mut [u8], factor: f64) {
    let mut table = [0; 256];
    fill_table(&mut table, factor);
    let mut from = [0; 1024];
    for values in values.chunks_mut(from.len()) {
        let from = &mut from[..values.len()];
        from.copy_from_slice(values);
        look_up_row(from, values, &table);
    }
}

vectorised! {
    fn fill_table / fill_table_avx2 (table: &mut [u8; 256], factor: f64) {
        for (value, entry) in table.iter_mut().enumerate() {
            *entry = truncated_double(f64::from(value as u32) * factor + 0.5);
        }
    }
}

/// Clips a result to 0..=255 and drops its fraction; what is not a number becomes 0. Unlike `clamp` and `as`, loops over it are
/// vectorised.
#[allow(clippy::manual_clamp)] // `clamp` keeps what is not a number
#[inline(always)]
pub fn truncated(value: f32) -> u8 {
    let clipped = value.max(0.0).min(255.0);
    // SAFETY: a number from 0 to 255 fits. The checked conversion would double the time of whole kernels.
    (unsafe { clipped.to_int_unchecked::<i32>() }) as u8
}

vectorised! {
    /// [`truncated`] of each number.
    pub(crate) fn drop_fractions / drop_fractions_avx2 / drop_fractions_avx512 (from: &[f32], to: &mut [u8]) {
        for (to, &from) in to.iter_mut().zip(from) {
            *to = truncated(from);
        }
    }
}

/// As [`truncated`], in double precision.
#[allow(clippy::manual_clamp)] // `clamp` keeps what is not a number
#[inline(always)]
pub(crate) fn truncated_double(value: f64) -> u8 {
    let clipped = value.max(0.0).min(255.0);
    // SAFETY: a number from 0 to 255 fits.
    (unsafe { clipped.to_int_unchecked::<i32>() }) as u8
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::simd::with_each;
    use crate::testing::{plain, run_on, samples};

    #[test]
    fn results_are_clipped_and_lose_their_fraction() {
        for value in [f32::NAN, f32::NEG_INFINITY, -0.5, 0.0, 0.99, 1.0, 254.999, 255.0, 300.0, f32::INFINITY]
        {
            assert_eq!(truncated(value), value as u8, "{value}");
            assert_eq!(truncated_double(f64::from(value)), value as u8, "{value}");
        }
    }

    proptest! {
        #[test]
        fn lookup_matches_the_plain_version(sample in samples(), first: u8, factor in 1u8..) {
            let table: [u8; 256] = std::array::from_fn(|v| first.wrapping_add((v as u8).wrapping_mul(factor)));
            let src = sample.frame();
            let expected = plain(src, |x, y| src.pixel(x, y).map(|v| table[usize::from(v)]));
            prop_assert_eq!(run_on(&sample, |src, dst| lookup(src, dst, &table)), expected);
        }

        #[test]
        fn lookup_by_channel_matches_the_plain_version(sample in samples(), first: u8, factor in 1u8..) {
            let table = |c: u8| std::array::from_fn(|v| first.wrapping_add((v as u8).wrapping_mul(factor) ^ (91 * c)));
            let tables: [[u8; 256]; 3] = [0, 1, 2].map(table);
            let src = sample.frame();
            let expected = plain(src, |x, y| {
                let pixel = src.pixel(x, y);
                [0, 1, 2].map(|c| tables[c][usize::from(pixel[c])])
            });
            with_each(|_| {
                let found = run_on(&sample, |src, dst| lookup_by_channel(src, dst, &tables));
                assert_eq!(found, expected);
            });
        }

        #[test]
        fn scale_in_place_matches_the_plain_version(length in 0..3000usize, first: u8, factor in -3.0..300.0) {
            let values: Vec<u8> = (0..length).map(|at| first.wrapping_add((at * 7) as u8)).collect();
            let expected: Vec<u8> = values.iter().map(|&v| (f64::from(v) * factor + 0.5) as u8).collect();
            with_each(|instructions| {
                let mut values = values.clone();
                scale_in_place(&mut values, factor);
                assert_eq!(values, expected, "{instructions:?}");
            });
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
