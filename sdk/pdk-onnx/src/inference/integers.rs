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

    /// A register of AVX. Only code for processors with AVX2 makes one.
    #[derive(Clone, Copy)]
    pub struct Avx(__m256i);

    impl Lanes<i32> for Avx {
        type Pair = [Self; 2];

        #[inline(always)]
        fn splat(value: i32) -> Self {
            // SAFETY: only code for processors with AVX2 gets here, see the type.
            Self(unsafe { _mm256_set1_epi32(value) })
        }

        #[inline(always)]
        unsafe fn load(place: *const i32) -> Self {
            // SAFETY: as above, and the caller says that eight numbers are there.
            Self(unsafe { _mm256_loadu_si256(place.cast()) })
        }

        #[inline(always)]
        fn multiply_add(self, factor: Self, sum: Self) -> Self {
            // SAFETY: as above.
            Self(unsafe { _mm256_add_epi32(_mm256_madd_epi16(self.0, factor.0), sum.0) })
        }

        #[inline(always)]
        fn to_array(self) -> [i32; LANES] {
            let mut array = [0; LANES];
            // SAFETY: as above, and the array has room for eight numbers.
            unsafe { _mm256_storeu_si256(array.as_mut_ptr().cast(), self.0) };
            array
        }
    }

    /// A register of AVX-512. Only code for processors with AVX-512F and AVX-512BW makes one.
    #[derive(Clone, Copy)]
    pub struct Wide(__m512i);

    /// The same; a multiply-add is one instruction of AVX-512 VNNI, which such a processor has too.
    #[derive(Clone, Copy)]
    pub struct Dot(__m512i);

    /// The multiply-add of a register.
    ///
    /// # Safety
    /// The processor has to have the extensions that the type of the register names.
    trait MultiplyAdd {
        unsafe fn compute(a: __m512i, b: __m512i, sum: __m512i) -> __m512i;
    }

    impl MultiplyAdd for Wide {
        #[inline(always)]
        unsafe fn compute(a: __m512i, b: __m512i, sum: __m512i) -> __m512i {
            // SAFETY: the caller says that the processor has AVX-512F and AVX-512BW.
            unsafe { _mm512_add_epi32(_mm512_madd_epi16(a, b), sum) }
        }
    }

    impl MultiplyAdd for Dot {
        #[inline(always)]
        unsafe fn compute(a: __m512i, b: __m512i, sum: __m512i) -> __m512i {
            // SAFETY: the caller says that the processor has AVX-512 VNNI.
            unsafe { _mm512_dpwssd_epi32(sum, a, b) }
        }
    }

    /// Registers of AVX-512 as pairs, and of AVX as what they are pairs of.
    macro_rules! wide {
        ($lanes:ident, $register:ident, $note:literal) => {
            #[doc = $note]
            #[derive(Clone, Copy)]
            pub struct $lanes(Avx);

            impl Lanes<i32> for $lanes {
                type Pair = $register;

                #[inline(always)]
                fn splat(value: i32) -> Self {
                    Self(Avx::splat(value))
                }

                #[inline(always)]
                unsafe fn load(place: *const i32) -> Self {
                    // SAFETY: the caller says that eight numbers are there.
                    Self(unsafe { Avx::load(place) })
                }

                #[inline(always)]
                fn multiply_add(self, factor: Self, sum: Self) -> Self {
                    Self(self.0.multiply_add(factor.0, sum.0))
                }

                #[inline(always)]
                fn to_array(self) -> [i32; LANES] {
                    self.0.to_array()
                }
            }

            impl Pair<i32> for $register {
                #[inline(always)]
                fn splat(value: i32) -> Self {
                    // SAFETY: only code for processors with AVX-512 gets here, see the type.
                    Self(unsafe { _mm512_set1_epi32(value) })
                }

                #[inline(always)]
                unsafe fn load(place: *const i32) -> Self {
                    // SAFETY: as above, and the caller says that sixteen numbers are there.
                    Self(unsafe { _mm512_loadu_si512(place.cast()) })
                }

                #[inline(always)]
                fn multiply_add(self, factor: Self, sum: Self) -> Self {
                    // SAFETY: as above.
                    Self(unsafe { <$register as MultiplyAdd>::compute(self.0, factor.0, sum.0) })
                }

                #[inline(always)]
                fn to_array(self) -> [i32; 2 * LANES] {
                    let mut array = [0; 2 * LANES];
                    // SAFETY: as above, and the array has room for sixteen numbers.
                    unsafe { _mm512_storeu_si512(array.as_mut_ptr().cast(), self.0) };
                    array
                }
            }
        };
    }
    wide!(Avx512, Wide, "Lanes whose pairs are registers of AVX-512.");
    wide!(Vnni, Dot, "Lanes whose pairs are registers of AVX-512 VNNI.");
}
#[cfg(target_arch = "x86_64")]
pub use avx::{Avx, Avx512, Vnni};
