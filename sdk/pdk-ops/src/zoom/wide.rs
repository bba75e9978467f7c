//! Columns of an enlargement four at a time, with AVX-512.
//!
//! The compiler cannot do so by itself: it does not know that four columns beside each other come from five pixels beside each other.

use std::arch::x86_64::*;

use super::{CHANNELS, LANES, MOST_READ, Tap};

/// Numbers of a row that four columns come from.
pub(super) const WINDOW: usize = MOST_READ;

/// Where four columns lie between the pixels of a row.
#[derive(Debug, Clone, Copy)]
pub(super) struct Four {
    /// Where their window begins in the row.
    start: u32,
    /// For each lane the number in the window on the left; that on the right is a pixel further.
    lefts: [u8; 4 * LANES],
    /// The lanes that are not black.
    seen: u16,
    fractions: [f32; 4],
}

impl Four {
    /// None if the columns come from pixels too far apart.
    pub(super) fn new(taps: &[Tap; 4], width: usize) -> Option<Self> {
        let mut four = Self {
            start: taps[0].first * CHANNELS as u32,
            lefts: [0; 4 * LANES],
            seen: 0,
            fractions: taps.map(|tap| tap.fraction),
        };
        for (column, tap) in taps.iter().enumerate().filter(|(_, tap)| (tap.first as usize) < width) {
            let pixel = tap.first.checked_sub(taps[0].first).filter(|pixel| *pixel <= 3)?;
            four.seen |= 0b1111 << (column * LANES);
            for lane in 0..LANES {
                four.lefts[column * LANES + lane] = (pixel as usize * CHANNELS + lane) as u8;
            }
        }
        Some(four)
    }
}

/// Adds columns of a row to the sums, as the plain version does.
///
/// # Panics
/// If a window does not lie within the row.
#[target_feature(enable = "avx512f")]
pub(super) fn add_stretched(row: &[f32], fours: &[Four], sums: &mut [f32]) {
    let pixel = _mm512_set1_epi32(CHANNELS as i32);
    let spread = _mm512_setr_epi32(0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3);
    for (sums, four) in sums.as_chunks_mut::<{ 4 * LANES }>().0.iter_mut().zip(fours) {
        let window = &row[four.start as usize..][..WINDOW];
        // SAFETY: all four have as many elements as are read, and need no alignment.
        let (window, lefts, fractions, before) = unsafe {
            (
                _mm512_loadu_ps(window.as_ptr()),
                _mm_loadu_si128(four.lefts.as_ptr().cast()),
                _mm_loadu_ps(four.fractions.as_ptr()),
                _mm512_loadu_ps(sums.as_ptr()),
            )
        };
        let lefts = _mm512_cvtepu8_epi32(lefts);
        let left = _mm512_maskz_permutexvar_ps(four.seen, lefts, window);
        let right = _mm512_maskz_permutexvar_ps(four.seen, _mm512_add_epi32(lefts, pixel), window);
        let fractions = _mm512_permutexvar_ps(spread, _mm512_castps128_ps512(fractions));
        let moved = _mm512_add_ps(left, _mm512_mul_ps(_mm512_sub_ps(right, left), fractions));
        // SAFETY: there are 16 sums.
        unsafe { _mm512_storeu_ps(sums.as_mut_ptr(), _mm512_add_ps(before, moved)) };
    }
}
