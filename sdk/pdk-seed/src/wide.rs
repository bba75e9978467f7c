//! Many blocks of ChaCha8 at a time, in the registers of processors that have wide ones.
//!
//! The generator is a counter: each block of 64 bytes follows from the key, the stream and the block's number alone. So blocks can be
//! computed in any order and number, and the bytes are those of [`ChaCha8Rng`](rand_chacha::ChaCha8Rng), which tests compare.
//! Bernstein, "ChaCha, a variant of Salsa20" (2008).

/// The bytes of a block.
pub const BLOCK: usize = 64;
/// The bytes of the blocks that are computed at a time.
pub const GROUP: usize = 16 * BLOCK;

/// What all blocks of a stream have in common: the words that each of them starts with, but for its number at 12 and 13.
#[derive(Debug, Clone, Copy)]
pub struct Stream([u32; 16]);

impl Stream {
    /// The stream of this number under a key.
    pub fn new(key: &[u8; 32], number: u64) -> Self {
        let mut words =
            [0x6170_7865, 0x3320_646e, 0x7962_2d32, 0x6b20_6574, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0];
        for (word, bytes) in words[4..12].iter_mut().zip(key.as_chunks::<4>().0) {
            *word = u32::from_le_bytes(*bytes);
        }
        (words[14], words[15]) = (number as u32, (number >> 32) as u32);
        Self(words)
    }

    /// Computes sixteen blocks from the one with this number on; false if there is no version for this processor.
    #[cfg_attr(target_arch = "x86_64", allow(unsafe_code))] // The processor is asked first.
    pub fn blocks(&self, first: u64, into: &mut [u8; GROUP]) -> bool {
        #[cfg(target_arch = "x86_64")]
        if is_x86_feature_detected!("avx512f") {
            // SAFETY: the processor has AVX-512.
            unsafe { avx512::blocks(self.0, first, into) };
            return true;
        } else if is_x86_feature_detected!("avx2") {
            // SAFETY: the processor has AVX2.
            unsafe { avx2::blocks(self.0, first, into) };
            return true;
        }
        let _ = (self.0, first, into);
        false
    }
}

/// The functions for registers with a number of 32-bit lanes, one lane for each block.
#[cfg(target_arch = "x86_64")]
macro_rules! blocks_in_lanes {
    ($feature:literal, $lanes:literal, $register:ty, $set:ident, $load:ident, $add:ident, $xor:ident,
     $low_words:ident, $high_words:ident, $low_pairs:ident, $high_pairs:ident, |$row:ident| $quarters:expr) => {
        /// Computes sixteen blocks from the one with this number on.
        #[target_feature(enable = $feature)]
        pub fn blocks(words: [u32; 16], first: u64, into: &mut [u8; GROUP]) {
            for (part, into) in into.as_chunks_mut::<{ $lanes * BLOCK }>().0.iter_mut().enumerate() {
                some(words, first.wrapping_add(part as u64 * $lanes), into);
            }
        }

        #[target_feature(enable = $feature)]
        fn some(words: [u32; 16], first: u64, into: &mut [u8; $lanes * BLOCK]) {
            let numbers: [u64; $lanes] = std::array::from_fn(|lane| first.wrapping_add(lane as u64));
            let [lower, upper] = [0, 32].map(|shift| {
                let words = numbers.map(|number| (number >> shift) as u32);
                // SAFETY: there are as many words as the register has.
                unsafe { $load(words.as_ptr().cast()) }
            });
            let mut start = words.map(|word| $set(word as i32));
            (start[12], start[13]) = (lower, upper);
            let mut state = start;
            for _ in 0..4 {
                for [a, b, c, d] in [[0, 4, 8, 12], [1, 5, 9, 13], [2, 6, 10, 14], [3, 7, 11, 15]] {
                    quarter(&mut state, a, b, c, d);
                }
                for [a, b, c, d] in [[0, 5, 10, 15], [1, 6, 11, 12], [2, 7, 8, 13], [3, 4, 9, 14]] {
                    quarter(&mut state, a, b, c, d);
                }
            }
            for (word, start) in state.iter_mut().zip(start) {
                *word = $add(*word, start);
            }
            // Four words of each block come to lie side by side: in quarter `q` of row `r` those of block `4 q + r`.
            for (place, four) in state.as_chunks::<4>().0.iter().enumerate() {
                let (a, b) = ($low_words(four[0], four[1]), $low_words(four[2], four[3]));
                let (c, d) = ($high_words(four[0], four[1]), $high_words(four[2], four[3]));
                let rows = [$low_pairs(a, b), $high_pairs(a, b), $low_pairs(c, d), $high_pairs(c, d)];
                for (row, $row) in rows.into_iter().enumerate() {
                    for (quarter, words) in $quarters.into_iter().enumerate() {
                        let at = (4 * quarter + row) * BLOCK + 16 * place;
                        let into = &mut into[at..at + 16];
                        // SAFETY: there is room for 16 bytes.
                        unsafe { _mm_storeu_si128(into.as_mut_ptr().cast(), words) };
                    }
                }
            }
        }

        /// The quarter round of the paper.
        #[inline]
        #[target_feature(enable = $feature)]
        fn quarter(state: &mut [$register; 16], a: usize, b: usize, c: usize, d: usize) {
            state[a] = $add(state[a], state[b]);
            state[d] = turned::<16, 16>($xor(state[d], state[a]));
            state[c] = $add(state[c], state[d]);
            state[b] = turned::<12, 20>($xor(state[b], state[c]));
            state[a] = $add(state[a], state[b]);
            state[d] = turned::<8, 24>($xor(state[d], state[a]));
            state[c] = $add(state[c], state[d]);
            state[b] = turned::<7, 25>($xor(state[b], state[c]));
        }
    };
}

#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)] // Registers are loaded and stored through pointers.
mod avx512 {
    use std::arch::x86_64::*;

    use super::{BLOCK, GROUP};

    blocks_in_lanes!(
        "avx512f",
        16,
        __m512i,
        _mm512_set1_epi32,
        _mm512_loadu_si512,
        _mm512_add_epi32,
        _mm512_xor_si512,
        _mm512_unpacklo_epi32,
        _mm512_unpackhi_epi32,
        _mm512_unpacklo_epi64,
        _mm512_unpackhi_epi64,
        |row| [
            _mm512_extracti32x4_epi32::<0>(row),
            _mm512_extracti32x4_epi32::<1>(row),
            _mm512_extracti32x4_epi32::<2>(row),
            _mm512_extracti32x4_epi32::<3>(row),
        ]
    );

    #[inline]
    #[target_feature(enable = "avx512f")]
    fn turned<const LEFT: i32, const RIGHT: i32>(words: __m512i) -> __m512i {
        _mm512_rol_epi32::<LEFT>(words)
    }
}

#[cfg(target_arch = "x86_64")]
#[allow(unsafe_code)] // As above.
mod avx2 {
    use std::arch::x86_64::*;

    use super::{BLOCK, GROUP};

    blocks_in_lanes!(
        "avx2",
        8,
        __m256i,
        _mm256_set1_epi32,
        _mm256_loadu_si256,
        _mm256_add_epi32,
        _mm256_xor_si256,
        _mm256_unpacklo_epi32,
        _mm256_unpackhi_epi32,
        _mm256_unpacklo_epi64,
        _mm256_unpackhi_epi64,
        |row| [_mm256_extracti128_si256::<0>(row), _mm256_extracti128_si256::<1>(row)]
    );

    #[inline]
    #[target_feature(enable = "avx2")]
    fn turned<const LEFT: i32, const RIGHT: i32>(words: __m256i) -> __m256i {
        // Turns by whole bytes are one instruction.
        let bytes = |first, second, third, fourth| {
            _mm256_shuffle_epi8(
                words,
                _mm256_broadcastsi128_si256(_mm_set_epi32(first, second, third, fourth)),
            )
        };
        match LEFT {
            16 => bytes(0x0d0c_0f0e, 0x0908_0b0a, 0x0504_0706, 0x0100_0302),
            8 => bytes(0x0e0d_0c0f, 0x0a09_080b, 0x0605_0407, 0x0201_0003),
            _ => _mm256_or_si256(_mm256_slli_epi32::<LEFT>(words), _mm256_srli_epi32::<RIGHT>(words)),
        }
    }
}

#[cfg(all(test, target_arch = "x86_64"))]
#[allow(unsafe_code)] // The processor is asked first.
mod tests {
    use rand_chacha::ChaCha8Rng;
    use rand_chacha::rand_core::{Rng, SeedableRng};

    use super::*;

    #[test]
    fn each_set_of_instructions_gives_the_blocks_of_the_generator() {
        let (has_avx512, has_avx2) = (is_x86_feature_detected!("avx512f"), is_x86_feature_detected!("avx2"));
        for (key, number, first) in [
            ([0; 32], 0, 0),
            ([7; 32], 3, 5),
            ([0xff; 32], u64::MAX, u64::from(u32::MAX) - 3),
            (std::array::from_fn(|i| i as u8 * 7), 1 << 40, u64::MAX - 3),
        ] {
            let stream = Stream::new(&key, number);
            let mut generator = ChaCha8Rng::from_seed(key);
            generator.set_stream(number);
            generator.set_word_pos(u128::from(first) * 16);
            let mut expected = [0; GROUP];
            generator.fill_bytes(&mut expected);
            let mut found = [0; GROUP];
            if has_avx512 {
                // SAFETY: the processor has AVX-512.
                unsafe { avx512::blocks(stream.0, first, &mut found) };
                assert_eq!(found, expected);
            }
            found = [0; GROUP];
            if has_avx2 {
                // SAFETY: the processor has AVX2.
                unsafe { avx2::blocks(stream.0, first, &mut found) };
                assert_eq!(found, expected);
            }
            found = [0; GROUP];
            assert_eq!(stream.blocks(first, &mut found), has_avx2);
            assert!(!has_avx2 || found == expected);
        }
    }
}
