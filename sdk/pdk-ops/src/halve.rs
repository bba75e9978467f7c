//! Images of half the size: each pixel is the mean of four.

use crate::frame::CHANNELS;
#[cfg(target_arch = "x86_64")]
use crate::simd::{Instructions, instructions};

/// A row of half as many pixels from two neighbouring rows: the mean of four pixels each, rounded half up.
pub(crate) fn halve_rows(upper: &[u8], lower: &[u8], out: &mut [u8]) {
    #[cfg(target_arch = "x86_64")]
    let done = match instructions() >= Instructions::Avx2 {
        // SAFETY: the processor has AVX2.
        true => unsafe { halve_rows_avx2(upper, lower, out) },
        false => 0,
    };
    #[cfg(not(target_arch = "x86_64"))]
    let done = 0;
    let [upper, lower] = [upper, lower].map(|row| &row.as_chunks::<{ 2 * CHANNELS }>().0[done..]);
    let pixels = &mut out.as_chunks_mut::<CHANNELS>().0[done..];
    for (pixel, (upper, lower)) in pixels.iter_mut().zip(upper.iter().zip(lower)) {
        for (channel, value) in pixel.iter_mut().enumerate() {
            let of =
                |pair: &[u8; 2 * CHANNELS]| u16::from(pair[channel]) + u16::from(pair[channel + CHANNELS]);
            *value = ((of(upper) + of(lower) + 2) >> 2) as u8;
        }
    }
}

/// Does eight pixels at a time and returns how many it did; the last few are left.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn halve_rows_avx2(upper: &[u8], lower: &[u8], out: &mut [u8]) -> usize {
    use std::arch::x86_64::*;
    // Of four pixels: red of the first two, their green, their blue, then of the others.
    let pairs =
        _mm256_broadcastsi128_si256(_mm_setr_epi8(0, 3, 1, 4, 2, 5, 6, 9, 7, 10, 8, 11, -1, -1, -1, -1));
    // From two groups of six bytes, each with a gap of two, to twelve bytes.
    let close =
        _mm256_broadcastsi128_si256(_mm_setr_epi8(0, 1, 2, 3, 4, 5, 8, 9, 10, 11, 12, 13, -1, -1, -1, -1));
    let one = _mm256_set1_epi8(1);
    let two = _mm256_set1_epi16(2);
    // Reads of 16 bytes at every twelfth, and writes of 16 bytes at every twelfth.
    const READ: usize = 3 * 12 + 16;
    const WRITTEN: usize = 12 + 16;
    let mut done = 0;
    loop {
        let (from, to) = (done * 2 * CHANNELS, done * CHANNELS);
        let (Some(upper), Some(lower), Some(out)) =
            (upper.get(from..from + READ), lower.get(from..from + READ), out.get_mut(to..to + WRITTEN))
        else {
            return done;
        };
        let means = |start: usize| {
            let sums = |row: &[u8]| {
                // SAFETY: `start` is at most 24, and the row is of 52 bytes.
                let pixels = unsafe {
                    let at = |place: usize| _mm_loadu_si128(row.as_ptr().add(place).cast());
                    _mm256_setr_m128i(at(start), at(start + 12))
                };
                _mm256_maddubs_epi16(_mm256_shuffle_epi8(pixels, pairs), one)
            };
            _mm256_srli_epi16::<2>(_mm256_add_epi16(_mm256_add_epi16(sums(upper), sums(lower)), two))
        };
        let bytes = _mm256_packus_epi16(means(0), means(24));
        let bytes = _mm256_shuffle_epi8(_mm256_permute4x64_epi64::<0b11_01_10_00>(bytes), close);
        let out = out.as_mut_ptr();
        // SAFETY: there are 28 bytes.
        unsafe {
            _mm_storeu_si128(out.cast(), _mm256_castsi256_si128(bytes));
            _mm_storeu_si128(out.add(12).cast(), _mm256_extracti128_si256::<1>(bytes));
        }
        done += 8;
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::simd::with_each;

    proptest! {
        #[test]
        fn each_pixel_is_the_mean_of_four(rows in (1usize..80).prop_flat_map(|width| {
            let row = prop::collection::vec(any::<u8>(), width * 2 * CHANNELS);
            (row.clone(), row)
        })) {
            let (upper, lower) = rows;
            let mut expected = Vec::new();
            for (upper, lower) in upper.chunks(2 * CHANNELS).zip(lower.chunks(2 * CHANNELS)) {
                for channel in 0..CHANNELS {
                    let four = [upper[channel], upper[channel + 3], lower[channel], lower[channel + 3]];
                    expected.push((four.map(f64::from).iter().sum::<f64>() / 4.0 + 0.5).floor() as u8);
                }
            }
            with_each(|instructions| {
                let mut out = vec![0; expected.len()];
                halve_rows(&upper, &lower, &mut out);
                assert_eq!(out, expected, "{instructions:?}");
            });
        }
    }
}
