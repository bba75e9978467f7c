//! Lanes of 32-bit integers, whose factors are two integers of 16 bits side by side.
//!
//! All of it is exact as long as sums fit 32 bits; beyond, they wrap.

/// Two factors as one number: the first in the low bits. Only their low 16 bits are kept.
#[inline(always)]
pub fn paired(first: i32, second: i32) -> i32 {
    (first & 0xffff) | (second << 16)
}

/// The sum of both products of two pairs, and of a number.
#[inline(always)]
pub fn multiply_add(a: i32, b: i32, sum: i32) -> i32 {
    let product = |a: i32, b: i32| i32::from(a as i16).wrapping_mul(i32::from(b as i16));
    sum.wrapping_add(product(a, b)).wrapping_add(product(a >> 16, b >> 16))
}

#[cfg(target_arch = "x86_64")]
mod avx {
    use std::arch::x86_64::*;

    use super::super::lanes::{LANES, Lanes, Pair};

    /// A register of AVX, or of AVX-512, with its multiply-add.
    macro_rules! register {
        (
            $(#[$note:meta])* $name:ident: $of:ident $pairs:tt, $register:ident, $count:expr, $splat:ident, $load:ident, $store:ident,
            |$a:ident, $b:ident, $sum:ident| $multiply_add:expr
        ) => {
            $(#[$note])*
            #[derive(Clone, Copy)]
            pub struct $name($register);

            impl $of<i32> for $name {
                register!(pairs $pairs);

                #[inline(always)]
                fn splat(value: i32) -> Self {
                    // SAFETY: only code for processors that have the extensions gets here, see the type.
                    Self(unsafe { $splat(value) })
                }

                #[inline(always)]
                unsafe fn load(place: *const i32) -> Self {
                    // SAFETY: as above, and the caller says that as many numbers are there.
                    Self(unsafe { $load(place.cast()) })
                }

                #[inline(always)]
                fn multiply_add(self, factor: Self, sum: Self) -> Self {
                    let ($a, $b, $sum) = (self.0, factor.0, sum.0);
                    // SAFETY: as above.
                    Self(unsafe { $multiply_add })
                }

                #[inline(always)]
                fn to_array(self) -> [i32; $count] {
                    let mut array = [0; $count];
                    // SAFETY: as above, and the array has room for as many numbers.
                    unsafe { $store(array.as_mut_ptr().cast(), self.0) };
                    array
                }
            }
        };
        (pairs ()) => {};
        (pairs ($pair:ty)) => {
            type Pair = $pair;
        };
    }

    register! {
        /// Only code for processors with AVX2 makes one.
        Avx: Lanes ([Self; 2]), __m256i, LANES, _mm256_set1_epi32, _mm256_loadu_si256, _mm256_storeu_si256,
        |a, b, sum| _mm256_add_epi32(_mm256_madd_epi16(a, b), sum)
    }

    register! {
        /// Its pair is a register of AVX-512. Only code for processors with AVX2 and AVX-512BW makes one.
        Avx512: Lanes (Wide), __m256i, LANES, _mm256_set1_epi32, _mm256_loadu_si256, _mm256_storeu_si256,
        |a, b, sum| _mm256_add_epi32(_mm256_madd_epi16(a, b), sum)
    }

    register! {
        /// A pair of [`Avx512`].
        Wide: Pair (), __m512i, 2 * LANES, _mm512_set1_epi32, _mm512_loadu_si512, _mm512_storeu_si512,
        |a, b, sum| _mm512_add_epi32(_mm512_madd_epi16(a, b), sum)
    }

    register! {
        /// Products and their sum are one instruction. Only code for processors with AVX-512VL and AVX-512 VNNI makes one.
        Vnni: Lanes (WideVnni), __m256i, LANES, _mm256_set1_epi32, _mm256_loadu_si256, _mm256_storeu_si256,
        |a, b, sum| _mm256_dpwssd_epi32(sum, a, b)
    }

    register! {
        /// A pair of [`Vnni`].
        WideVnni: Pair (), __m512i, 2 * LANES, _mm512_set1_epi32, _mm512_loadu_si512, _mm512_storeu_si512,
        |a, b, sum| _mm512_dpwssd_epi32(sum, a, b)
    }
}
#[cfg(target_arch = "x86_64")]
pub use avx::{Avx, Avx512, Vnni};
