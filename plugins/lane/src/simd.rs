//! Code that is compiled several times: for every processor, and for those with AVX2 or AVX-512, chosen at run time.
//!
//! The first is plain Rust and the standard: tests compare the others with it. All do the same single operations in the same
//! order, so the bytes are the same.

/// Pixels that are worked on at a time. Rows of values are as long as whole blocks, so that no block is cut.
pub const BLOCK: usize = 8;

/// The length of a row of values for this many pixels: whole blocks.
pub fn padded(pixels: usize) -> usize {
    pixels.div_ceil(BLOCK) * BLOCK
}

#[cfg(target_arch = "x86_64")]
use pdk_sdk::ops::processor;
pub(crate) use pdk_sdk::ops::vectorised;

/// Whether the versions for AVX2 are to be used.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
pub fn has_avx2() -> bool {
    processor::has_avx2() && allowed() != Allowed::Portable
}

/// Whether the versions for AVX-512 are to be used.
#[cfg(target_arch = "x86_64")]
#[inline(always)]
pub fn has_avx512() -> bool {
    processor::has_avx512() && allowed() == Allowed::All
}

/// The versions that may be used.
#[cfg(target_arch = "x86_64")]
#[derive(Clone, Copy, PartialEq, Eq)]
enum Allowed {
    #[cfg_attr(not(test), allow(dead_code))]
    Portable,
    #[cfg_attr(not(test), allow(dead_code))]
    Avx2,
    All,
}

/// What a test allows on this thread.
#[cfg(all(test, target_arch = "x86_64"))]
fn allowed() -> Allowed {
    ALLOWED.get()
}

#[cfg(all(not(test), target_arch = "x86_64"))]
#[inline(always)]
const fn allowed() -> Allowed {
    Allowed::All
}

#[cfg(all(test, target_arch = "x86_64"))]
thread_local! {
    static ALLOWED: std::cell::Cell<Allowed> = const { std::cell::Cell::new(Allowed::All) };
}

/// The portable result of a piece of work, for comparison; if it is another one with AVX2 alone, that is a failure.
#[cfg(test)]
pub fn portably<T: PartialEq>(mut work: impl FnMut() -> T) -> T {
    #[cfg(target_arch = "x86_64")]
    {
        let [portable, narrow] = [Allowed::Portable, Allowed::Avx2].map(|allowed| {
            ALLOWED.set(allowed);
            let result = work();
            ALLOWED.set(Allowed::All);
            result
        });
        assert!(portable == narrow, "the version for AVX2 differs from the portable one");
        portable
    }
    #[cfg(not(target_arch = "x86_64"))]
    work()
}

#[cfg(target_arch = "x86_64")]
pub mod avx2 {
    //! Building blocks for AVX2.

    use std::arch::x86_64::*;

    /// The entries of a table at eight places, as four vectors: all first values, all second ones and so on. A macro, because
    /// a function for AVX2 that gives back four vectors passes them through memory if it is not inlined.
    ///
    /// The table is `&[[f32; 4]]`, or anything else that is indexed by places.
    ///
    /// # Panics
    /// If a place lies outside of the table.
    macro_rules! look_up {
        ($table:expr, $places:expr) => {{
            let (table, places): (_, __m256i) = ($table, $places);
            let mut at = [0u32; 8];
            // SAFETY: it has room for the eight places, and needs no alignment.
            unsafe { _mm256_storeu_si256(at.as_mut_ptr().cast(), places) };
            let entry = |place: u32| {
                let entry: &[f32; 4] = &table[place as usize];
                // SAFETY: an entry is four floats, and needs no alignment.
                unsafe { _mm_loadu_ps(entry.as_ptr()) }
            };
            let a = _mm256_set_m128(entry(at[4]), entry(at[0]));
            let b = _mm256_set_m128(entry(at[5]), entry(at[1]));
            let c = _mm256_set_m128(entry(at[6]), entry(at[2]));
            let d = _mm256_set_m128(entry(at[7]), entry(at[3]));
            // Transposed within each half: the first half holds places 0 to 3, the second 4 to 7.
            let (ab_low, ab_high) = (_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b));
            let (cd_low, cd_high) = (_mm256_unpacklo_ps(c, d), _mm256_unpackhi_ps(c, d));
            [
                _mm256_shuffle_ps::<0x44>(ab_low, cd_low),
                _mm256_shuffle_ps::<0xEE>(ab_low, cd_low),
                _mm256_shuffle_ps::<0x44>(ab_high, cd_high),
                _mm256_shuffle_ps::<0xEE>(ab_high, cd_high),
            ]
        }};
    }
    pub(crate) use look_up;

    /// A table of pairs in which each is looked up together with the next one.
    #[derive(Clone, Copy)]
    pub struct Pairs<'a>(&'a [f32]);

    impl<'a> Pairs<'a> {
        /// The table of these.
        pub fn new(pairs: &'a [[f32; 2]]) -> Self {
            Self(pairs.as_flattened())
        }
    }

    impl std::ops::Index<usize> for Pairs<'_> {
        type Output = [f32; 4];

        #[inline(always)]
        fn index(&self, place: usize) -> &[f32; 4] {
            let two = &self.0[place * 2..place * 2 + 4];
            // SAFETY: there are four of them, one behind the other.
            unsafe { &*two.as_ptr().cast() }
        }
    }

    /// `a + (b - a) * share`, in these steps.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub fn mix(a: __m256, b: __m256, share: __m256) -> __m256 {
        _mm256_add_ps(a, _mm256_mul_ps(_mm256_sub_ps(b, a), share))
    }

    /// The eight values of a block.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub fn load(block: &[f32; super::BLOCK]) -> __m256 {
        // SAFETY: a block has eight floats, and needs no alignment.
        unsafe { _mm256_loadu_ps(block.as_ptr()) }
    }

    /// Writes the eight values of a block.
    #[inline]
    #[target_feature(enable = "avx2")]
    pub fn store(block: &mut [f32; super::BLOCK], values: __m256) {
        // SAFETY: a block has eight floats, and needs no alignment.
        unsafe { _mm256_storeu_ps(block.as_mut_ptr(), values) };
    }
}

#[cfg(target_arch = "x86_64")]
pub mod avx512 {
    //! Building blocks for AVX-512. Values are worked on sixteen at a time; of fewer, the rest of the lanes is zero.

    use std::arch::x86_64::*;

    /// Values in a vector.
    pub const LANES: usize = 16;

    /// As [`look_up!`](super::avx2::look_up) for sixteen places. The table is `&[f32]`, and an entry begins every `$stride` values.
    ///
    /// # Panics
    /// If a place lies outside of the table.
    macro_rules! look_up {
        ($table:expr, $stride:literal, $places:expr) => {{
            let (table, places): (&[f32], __m512i) = ($table, $places);
            // One comparison for all places, so that none is checked by itself.
            let last = _mm512_set1_epi32((table.len().saturating_sub(4) / $stride) as i32);
            let beyond = _mm512_cmpgt_epu32_mask(places, last);
            assert!(beyond == 0 && table.len() >= 4, "a place lies outside of the table");
            let at = crate::simd::avx512::Places::of(places);
            // SAFETY: every place was compared with the last entry, and an entry needs no alignment.
            let entry = |i: usize| unsafe { _mm_loadu_ps(table.as_ptr().add(at.at(i) * $stride)) };
            let four = |i: usize| {
                let first = _mm512_castps128_ps512(entry(i));
                let two = _mm512_insertf32x4::<1>(first, entry(i + 4));
                _mm512_insertf32x4::<3>(_mm512_insertf32x4::<2>(two, entry(i + 8)), entry(i + 12))
            };
            let (a, b, c, d) = (four(0), four(1), four(2), four(3));
            // Transposed within each quarter: the first holds places 0 to 3, the second 4 to 7 and so on.
            let (ab_low, ab_high) = (_mm512_unpacklo_ps(a, b), _mm512_unpackhi_ps(a, b));
            let (cd_low, cd_high) = (_mm512_unpacklo_ps(c, d), _mm512_unpackhi_ps(c, d));
            [
                _mm512_shuffle_ps::<0x44>(ab_low, cd_low),
                _mm512_shuffle_ps::<0xEE>(ab_low, cd_low),
                _mm512_shuffle_ps::<0x44>(ab_high, cd_high),
                _mm512_shuffle_ps::<0xEE>(ab_high, cd_high),
            ]
        }};
    }
    pub(crate) use look_up;

    /// The places of a vector, in memory. In one line of the cache, so that they can be read before they have arrived there.
    #[repr(align(64))]
    pub struct Places([u32; LANES]);

    impl Places {
        /// Those of a vector.
        #[inline]
        #[target_feature(enable = "avx512bw,avx512dq,avx512vl,avx512vbmi")]
        pub fn of(places: __m512i) -> Self {
            let mut of = Self([0; LANES]);
            let (low, high) = of.0.split_at_mut(LANES / 2);
            // In two parts, because a processor was measured to wait for the second half of a whole vector to arrive.
            // SAFETY: there is room for eight places each, and both are aligned as such a vector is.
            unsafe {
                _mm256_store_si256(low.as_mut_ptr().cast(), _mm512_castsi512_si256(places));
                _mm256_store_si256(high.as_mut_ptr().cast(), _mm512_extracti64x4_epi64::<1>(places));
            }
            of
        }

        /// One of them. From memory, because the compiler would take it from the vector instead, which keeps the unit busy
        /// that puts entries of tables together.
        #[inline(always)]
        pub fn at(&self, i: usize) -> usize {
            // SAFETY: it is a reference.
            unsafe { std::ptr::from_ref(&self.0[i]).read_volatile() as usize }
        }
    }

    /// The lanes of this many values, of which those beyond sixteen do not count.
    #[inline(always)]
    pub fn lanes(values: usize) -> __mmask16 {
        if values >= LANES { !0 } else { (1 << values) - 1 }
    }

    /// `a + (b - a) * share`, in these steps.
    #[inline]
    #[target_feature(enable = "avx512bw,avx512dq,avx512vl,avx512vbmi")]
    pub fn mix(a: __m512, b: __m512, share: __m512) -> __m512 {
        _mm512_add_ps(a, _mm512_mul_ps(_mm512_sub_ps(b, a), share))
    }

    /// The first values, sixteen at most.
    #[inline]
    #[target_feature(enable = "avx512bw,avx512dq,avx512vl,avx512vbmi")]
    pub fn load(values: &[f32]) -> __m512 {
        // SAFETY: only lanes are read for which there are values, and these need no alignment.
        unsafe { _mm512_maskz_loadu_ps(lanes(values.len()), values.as_ptr()) }
    }

    /// Writes the lanes for which there is room and whose bits are set.
    #[inline]
    #[target_feature(enable = "avx512bw,avx512dq,avx512vl,avx512vbmi")]
    pub fn store(into: &mut [f32], of: __mmask16, values: __m512) {
        // SAFETY: only lanes are written for which there is room, and this needs no alignment.
        unsafe { _mm512_mask_storeu_ps(into.as_mut_ptr(), lanes(into.len()) & of, values) };
    }
}

#[cfg(all(test, target_arch = "x86_64"))]
mod tests {
    use super::*;

    #[test]
    fn a_wide_look_up_is_that_of_the_places_one_by_one() {
        if !has_avx512() {
            println!("skipped: this processor has no AVX-512");
            return;
        }
        #[target_feature(enable = "avx512bw,avx512dq,avx512vl,avx512vbmi")]
        fn looked_up(table: &[f32], places: &[u32; 16]) -> [[f32; 16]; 4] {
            use std::arch::x86_64::*;
            // SAFETY: there are sixteen places.
            let found = avx512::look_up!(table, 2, unsafe { _mm512_loadu_si512(places.as_ptr().cast()) });
            found.map(|values| {
                let mut block = [0.0; 16];
                avx512::store(&mut block, !0, values);
                block
            })
        }
        let table: Vec<f32> = (0..100).map(|i| i as f32).collect();
        let places = [3u32, 48, 0, 17, 17, 8, 31, 2, 1, 30, 48, 5, 9, 11, 40, 0];
        // SAFETY: the processor has AVX-512.
        let found = unsafe { looked_up(&table, &places) };
        for (k, values) in found.iter().enumerate() {
            for (value, place) in values.iter().zip(places) {
                assert_eq!(*value, table[place as usize * 2 + k]);
            }
        }
        let beyond = [49; 16];
        // SAFETY: the processor has AVX-512.
        assert!(std::panic::catch_unwind(|| unsafe { looked_up(&table, &beyond) }).is_err());
    }

    #[test]
    fn a_look_up_is_that_of_the_places_one_by_one() {
        if !has_avx2() {
            println!("skipped: this processor has no AVX2");
            return;
        }
        let table: Vec<[f32; 4]> = (0..50).map(|i| [0, 1, 2, 3].map(|k| (i * 4 + k) as f32)).collect();
        let places = [3u32, 49, 0, 17, 17, 8, 31, 2];
        #[target_feature(enable = "avx2")]
        fn looked_up(table: &[[f32; 4]], places: &[u32; 8]) -> [[f32; 8]; 4] {
            use std::arch::x86_64::*;
            // SAFETY: there are eight places.
            let found = avx2::look_up!(table, unsafe { _mm256_loadu_si256(places.as_ptr().cast()) });
            found.map(|values| {
                let mut block = [0.0; 8];
                avx2::store(&mut block, values);
                block
            })
        }
        // SAFETY: the processor has AVX2.
        let found = unsafe { looked_up(&table, &places) };
        for (k, values) in found.iter().enumerate() {
            for (value, place) in values.iter().zip(places) {
                assert_eq!(*value, table[place as usize][k]);
            }
        }
    }
}
