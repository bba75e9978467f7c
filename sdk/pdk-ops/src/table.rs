//! Values replaced by those of a table: the fastest way to do anything that depends on a value alone.

use crate::frame::{Frame, FrameMut, for_each_row};
#[cfg(target_arch = "x86_64")]
use crate::simd::{Instructions, instructions};

/// Replaces each value `v` by `table[v]`.
///
/// # Panics
/// If the sizes differ.
pub(crate) fn look_up(src: Frame<'_>, dst: FrameMut<'_>, table: &[u8; 256]) {
    for_each_row(src, dst, |from, to| look_up_row(from, to, table));
}

/// Replaces the values of a row.
pub(crate) fn look_up_row(from: &[u8], to: &mut [u8], table: &[u8; 256]) {
    #[cfg(target_arch = "x86_64")]
    let done = match instructions() {
        // SAFETY: the processor has what is asked for.
        Instructions::Avx512 => unsafe { look_up_avx512(from, to, table) },
        // SAFETY: as above.
        Instructions::Avx2 => unsafe { look_up_avx2(from, to, table) },
        Instructions::Portable => 0,
    };
    #[cfg(not(target_arch = "x86_64"))]
    let done = 0;
    for (to, &from) in to[done..].iter_mut().zip(&from[done..]) {
        *to = table[usize::from(from)];
    }
}

/// Does 64 values at a time, and returns how many it did: all. Two registers hold half of the table.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512bw,avx512vbmi")]
fn look_up_avx512(from: &[u8], to: &mut [u8], table: &[u8; 256]) -> usize {
    use std::arch::x86_64::*;
    let count = from.len().min(to.len());
    let (quarters, _) = table.as_chunks::<64>();
    // SAFETY: each is of 64 bytes.
    let [a, b, c, d] = [0, 1, 2, 3].map(|i| unsafe { _mm512_loadu_si512(quarters[i].as_ptr().cast()) });
    let found = |values: __m512i| {
        let lower = _mm512_permutex2var_epi8(a, values, b);
        let upper = _mm512_permutex2var_epi8(c, values, d);
        _mm512_mask_blend_epi8(_mm512_movepi8_mask(values), lower, upper)
    };
    let whole = count & !63;
    for (from, to) in from[..whole].as_chunks::<64>().0.iter().zip(to[..whole].as_chunks_mut::<64>().0) {
        // SAFETY: each is of 64 bytes.
        unsafe {
            let values = _mm512_loadu_si512(from.as_ptr().cast());
            _mm512_storeu_si512(to.as_mut_ptr().cast(), found(values));
        }
    }
    let rest: __mmask64 = (1 << (count - whole)) - 1;
    // SAFETY: only what the mask has is read and written.
    unsafe {
        let values = _mm512_maskz_loadu_epi8(rest, from.as_ptr().add(whole).cast());
        _mm512_mask_storeu_epi8(to.as_mut_ptr().add(whole).cast(), rest, found(values));
    }
    count
}

/// Does 32 values at a time, and returns how many it did. A shuffle looks up 16 entries by the lower half of a value, and gives
/// 0 for a negative one. So it is done for each 16 entries, of what is left of the value once their start is taken off, and
/// what it gives is the difference to the 16 before: all of those up to the value's own together are its entry.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn look_up_avx2(from: &[u8], to: &mut [u8], table: &[u8; 256]) -> usize {
    use std::arch::x86_64::*;
    let (rows, _) = table.as_chunks::<16>();
    let mut differences = [_mm256_setzero_si256(); 16];
    for (i, difference) in differences.iter_mut().enumerate() {
        // SAFETY: each row is of 16 bytes.
        let [row, before] = unsafe {
            [i, i.saturating_sub(1)]
                .map(|i| _mm256_broadcastsi128_si256(_mm_loadu_si128(rows[i].as_ptr().cast())))
        };
        // Both halves of the table begin anew.
        *difference = if i % 8 == 0 { row } else { _mm256_xor_si256(row, before) };
    }
    let sixteen = _mm256_set1_epi8(16);
    let top = _mm256_set1_epi8(-128);
    let chunks = from.as_chunks::<32>().0.iter().zip(to.as_chunks_mut::<32>().0);
    let count = 32 * chunks.len();
    for (from, to) in chunks {
        // SAFETY: it is of 32 bytes.
        let values = unsafe { _mm256_loadu_si256(from.as_ptr().cast()) };
        let mut left = [values, _mm256_xor_si256(values, top)];
        let mut found =
            [_mm256_shuffle_epi8(differences[0], left[0]), _mm256_shuffle_epi8(differences[8], left[1])];
        for i in 1..8 {
            for half in 0..2 {
                left[half] = _mm256_subs_epi8(left[half], sixteen);
                let next = _mm256_shuffle_epi8(differences[8 * half + i], left[half]);
                found[half] = _mm256_xor_si256(found[half], next);
            }
        }
        // SAFETY: it is of 32 bytes.
        unsafe { _mm256_storeu_si256(to.as_mut_ptr().cast(), _mm256_xor_si256(found[0], found[1])) };
    }
    count
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;
    use crate::simd::with_each;

    proptest! {
        #[test]
        fn every_value_is_replaced_by_its_entry(
            table in prop::collection::vec(any::<u8>(), 256), length in 0usize..400, start: u8,
        ) {
            let table: [u8; 256] = table.try_into().unwrap();
            let from: Vec<u8> = (0..length).map(|i| start.wrapping_add(i as u8)).collect();
            let expected: Vec<u8> = from.iter().map(|&v| table[usize::from(v)]).collect();
            with_each(|instructions| {
                let mut to = vec![0xa5; length + 1];
                look_up_row(&from, &mut to[..length], &table);
                assert_eq!(to[..length], expected, "{instructions:?}");
                assert_eq!(to[length], 0xa5, "{instructions:?} wrote beside the row");
            });
        }
    }
}
