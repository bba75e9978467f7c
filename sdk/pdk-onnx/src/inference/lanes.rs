//! Eight numbers at a time, or a pair of eight, with a multiply-add that rounds once, on every processor.
//!
//! The order of additions and where they are rounded is all that a sum of products depends on. Both are the same here for every
//! processor: those with the instructions of x86-64-v3 or of aarch64 have a fused multiply-add, and for others it is computed.
//!
//! Sums of integers are exact. A factor of them has 32 bits like a sum, in which two integers of 16 bits lie side by side, and a
//! multiply-add adds both products.

use super::integers;

/// The number of lanes.
pub const LANES: usize = 8;

/// What lanes hold: 32-bit floats, or 32-bit integers.
pub trait Number: Copy + Default + Send + 'static {
    /// Those for processors with AVX2 and FMA.
    #[cfg(target_arch = "x86_64")]
    type Avx: Lanes<Self>;

    /// Those for processors with AVX-512.
    #[cfg(target_arch = "x86_64")]
    type Avx512: Lanes<Self>;

    /// Those for processors with AVX-512 and its instructions for products of integers, if these are used.
    #[cfg(target_arch = "x86_64")]
    type Vnni: Lanes<Self>;

    /// Whether they are.
    #[cfg(target_arch = "x86_64")]
    const HAS_VNNI: bool;

    /// What a multiply-add computes in a lane.
    fn multiply_add(a: Self, b: Self, sum: Self) -> Self;

    /// The number if it is above 0, else 0, as `Relu` has it. What is not a number stays so.
    fn cut(self) -> Self;
}

impl Number for f32 {
    #[cfg(target_arch = "x86_64")]
    type Avx = avx::Avx;
    #[cfg(target_arch = "x86_64")]
    type Avx512 = avx::Avx512;
    #[cfg(target_arch = "x86_64")]
    type Vnni = avx::Avx512;
    #[cfg(target_arch = "x86_64")]
    const HAS_VNNI: bool = false;

    #[inline(always)]
    fn multiply_add(a: Self, b: Self, sum: Self) -> Self {
        multiply_add(a, b, sum)
    }

    #[inline(always)]
    fn cut(self) -> Self {
        if self <= 0.0 { 0.0 } else { self }
    }
}

impl Number for i32 {
    #[cfg(target_arch = "x86_64")]
    type Avx = integers::Avx;
    #[cfg(target_arch = "x86_64")]
    type Avx512 = integers::Avx512;
    #[cfg(target_arch = "x86_64")]
    type Vnni = integers::Vnni;
    #[cfg(target_arch = "x86_64")]
    const HAS_VNNI: bool = true;

    #[inline(always)]
    fn multiply_add(a: Self, b: Self, sum: Self) -> Self {
        integers::multiply_add(a, b, sum)
    }

    #[inline(always)]
    fn cut(self) -> Self {
        self.max(0)
    }
}

/// Sixteen numbers.
pub trait Pair<N = f32>: Copy {
    /// The same number in each lane.
    fn splat(value: N) -> Self;

    /// Sixteen numbers that lie side by side.
    ///
    /// # Safety
    /// They have to be readable from `place` on.
    unsafe fn load(place: *const N) -> Self;

    /// `self * factor + sum`, rounded once; of integers, the sum of both products and of `sum`.
    fn multiply_add(self, factor: Self, sum: Self) -> Self;

    /// The numbers.
    fn to_array(self) -> [N; 2 * LANES];
}

impl<N: Number, L: Lanes<N>> Pair<N> for [L; 2] {
    #[inline(always)]
    fn splat(value: N) -> Self {
        [L::splat(value); 2]
    }

    #[inline(always)]
    unsafe fn load(place: *const N) -> Self {
        // SAFETY: the caller says that sixteen numbers are there.
        unsafe { [L::load(place), L::load(place.add(LANES))] }
    }

    #[inline(always)]
    fn multiply_add(self, factor: Self, sum: Self) -> Self {
        let ([a, b], [c, d], [e, f]) = (self, factor, sum);
        [a.multiply_add(c, e), b.multiply_add(d, f)]
    }

    #[inline(always)]
    fn to_array(self) -> [N; 2 * LANES] {
        let mut array = [N::default(); 2 * LANES];
        array.as_chunks_mut().0.iter_mut().zip(self).for_each(|(into, lanes)| *into = lanes.to_array());
        array
    }
}

/// Eight numbers.
pub trait Lanes<N = f32>: Copy {
    /// Sixteen numbers.
    type Pair: Pair<N>;

    /// The same number in each lane.
    fn splat(value: N) -> Self;

    /// Eight numbers that lie side by side.
    ///
    /// # Safety
    /// They have to be readable from `place` on.
    unsafe fn load(place: *const N) -> Self;

    /// `self * factor + sum`, rounded once; of integers, the sum of both products and of `sum`.
    fn multiply_add(self, factor: Self, sum: Self) -> Self;

    /// The numbers.
    fn to_array(self) -> [N; LANES];
}

/// For processors without vector instructions that are used here.
#[derive(Clone, Copy)]
pub struct Portable<N = f32>([N; LANES]);

impl<N: Number> Lanes<N> for Portable<N> {
    type Pair = [Self; 2];

    #[inline(always)]
    fn splat(value: N) -> Self {
        Self([value; LANES])
    }

    #[inline(always)]
    unsafe fn load(place: *const N) -> Self {
        // SAFETY: the caller says that eight numbers are there; they need not be aligned.
        Self(unsafe { place.cast::<[N; LANES]>().read_unaligned() })
    }

    #[inline(always)]
    fn multiply_add(self, factor: Self, sum: Self) -> Self {
        let mut result = sum;
        for ((result, a), b) in result.0.iter_mut().zip(self.0).zip(factor.0) {
            *result = N::multiply_add(a, b, *result);
        }
        result
    }

    #[inline(always)]
    fn to_array(self) -> [N; LANES] {
        self.0
    }
}

/// `a b + c`, rounded once (IEEE 754, 5.4.1).
#[inline(always)]
pub fn multiply_add(a: f32, b: f32, c: f32) -> f32 {
    // An instruction that every processor of the architecture has.
    #[cfg(target_arch = "aarch64")]
    return a.mul_add(b, c);
    #[cfg(not(target_arch = "aarch64"))]
    computed(a, b, c)
}

/// The same from 64-bit operations. The product of two 32-bit floats is exact in 64 bits. The sum with the third is rounded to odd: if
/// something of it was lost, its last bit is set, so that rounding to 32 bits sees that the sum is not a tie (Boldo and Melquiond, Emulation
/// of FMA and Correctly Rounded Sums, 2008).
#[cfg(any(test, not(target_arch = "aarch64")))]
#[inline(always)]
fn computed(a: f32, b: f32, c: f32) -> f32 {
    let (product, addend) = (f64::from(a) * f64::from(b), f64::from(c));
    let sum = product + addend;
    // What the sum has lost, exactly (Knuth's TwoSum).
    let part = sum - product;
    let lost = (product - (sum - part)) + (addend - part);
    let bits = sum.to_bits();
    // Not for what is not a number, or infinite.
    let to_odd = lost.abs() > 0.0 && bits & 1 == 0;
    let outwards = (lost > 0.0) == (sum > 0.0);
    let odd = match (to_odd, outwards) {
        (false, _) => bits,
        (true, true) => bits + 1,
        (true, false) => bits - 1,
    };
    f64::from_bits(odd) as f32
}

#[cfg(target_arch = "x86_64")]
mod avx {
    use std::arch::x86_64::*;

    use super::{LANES, Lanes, Pair};

    /// A register of AVX. Only code for processors with AVX2 and FMA makes one.
    #[derive(Clone, Copy)]
    pub struct Avx(__m256);

    impl Lanes for Avx {
        type Pair = [Self; 2];

        #[inline(always)]
        fn splat(value: f32) -> Self {
            // SAFETY: only code for processors with AVX2 and FMA gets here, see the type.
            Self(unsafe { _mm256_set1_ps(value) })
        }

        #[inline(always)]
        unsafe fn load(place: *const f32) -> Self {
            // SAFETY: as above, and the caller says that eight numbers are there.
            Self(unsafe { _mm256_loadu_ps(place) })
        }

        #[inline(always)]
        fn multiply_add(self, factor: Self, sum: Self) -> Self {
            // SAFETY: as above.
            Self(unsafe { _mm256_fmadd_ps(self.0, factor.0, sum.0) })
        }

        #[inline(always)]
        fn to_array(self) -> [f32; LANES] {
            let mut array = [0.0; LANES];
            // SAFETY: as above, and the array has room for eight numbers.
            unsafe { _mm256_storeu_ps(array.as_mut_ptr(), self.0) };
            array
        }
    }

    /// The same, with registers of AVX-512 for pairs. Only code for processors with AVX-512 makes one.
    #[derive(Clone, Copy)]
    pub struct Avx512(Avx);

    impl Lanes for Avx512 {
        type Pair = Wide;

        #[inline(always)]
        fn splat(value: f32) -> Self {
            Self(Avx::splat(value))
        }

        #[inline(always)]
        unsafe fn load(place: *const f32) -> Self {
            // SAFETY: the caller says that eight numbers are there.
            Self(unsafe { Avx::load(place) })
        }

        #[inline(always)]
        fn multiply_add(self, factor: Self, sum: Self) -> Self {
            Self(self.0.multiply_add(factor.0, sum.0))
        }

        #[inline(always)]
        fn to_array(self) -> [f32; LANES] {
            self.0.to_array()
        }
    }

    /// A register of AVX-512.
    #[derive(Clone, Copy)]
    pub struct Wide(__m512);

    impl Pair for Wide {
        #[inline(always)]
        fn splat(value: f32) -> Self {
            // SAFETY: only code for processors with AVX-512 gets here, see the type.
            Self(unsafe { _mm512_set1_ps(value) })
        }

        #[inline(always)]
        unsafe fn load(place: *const f32) -> Self {
            // SAFETY: as above, and the caller says that sixteen numbers are there.
            Self(unsafe { _mm512_loadu_ps(place) })
        }

        #[inline(always)]
        fn multiply_add(self, factor: Self, sum: Self) -> Self {
            // SAFETY: as above.
            Self(unsafe { _mm512_fmadd_ps(self.0, factor.0, sum.0) })
        }

        #[inline(always)]
        fn to_array(self) -> [f32; 2 * LANES] {
            let mut array = [0.0; 2 * LANES];
            // SAFETY: as above, and the array has room for sixteen numbers.
            unsafe { _mm512_storeu_ps(array.as_mut_ptr(), self.0) };
            array
        }
    }
}
/// Work that is written once for every kind of lanes.
pub trait Work<N: Number = f32> {
    /// Does it.
    fn with<L: Lanes<N>>(self);
}

/// What processors have, from the least to the most.
#[cfg(test)]
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    Portable,
    Avx,
    Avx512,
    Vnni,
}

#[cfg(test)]
thread_local! {
    /// What this thread may use of its processor.
    static LEVEL: std::cell::Cell<Level> = const { std::cell::Cell::new(Level::Vnni) };
}

/// Computes something as processors with no more than this do.
#[cfg(test)]
pub fn limited<T>(level: Level, compute: impl FnOnce() -> T) -> T {
    LEVEL.set(level);
    let result = compute();
    LEVEL.set(Level::Vnni);
    result
}

/// Computes something as processors without vector instructions do.
#[cfg(test)]
pub fn portably<T>(compute: impl FnOnce() -> T) -> T {
    limited(Level::Portable, compute)
}

/// Does work with the best lanes of this processor.
pub fn dispatch<N: Number>(work: impl Work<N>) {
    #[cfg(test)]
    if LEVEL.get() == Level::Portable {
        return work.with::<Portable<N>>();
    }
    #[cfg(target_arch = "x86_64")]
    if is_x86_feature_detected!("avx2") && is_x86_feature_detected!("fma") {
        // SAFETY: the processor has both.
        unsafe { with_avx(work) };
        return;
    }
    work.with::<Portable<N>>();
}

/// Whether a pair is one register on this processor, which then also computes with twice as many 64-bit floats at a time.
pub fn has_wide_lanes() -> bool {
    #[cfg(test)]
    if LEVEL.get() < Level::Avx512 {
        return false;
    }
    #[cfg(target_arch = "x86_64")]
    return is_x86_feature_detected!("avx512f")
        && is_x86_feature_detected!("avx512bw")
        && is_x86_feature_detected!("avx2")
        && is_x86_feature_detected!("fma");
    #[cfg(not(target_arch = "x86_64"))]
    false
}

/// Does work with the best lanes of this processor, if it is faster with registers of sixteen.
pub fn dispatch_wide<N: Number>(work: impl Work<N>) {
    #[cfg(test)]
    match LEVEL.get() {
        Level::Portable | Level::Avx => return dispatch(work),
        #[cfg(target_arch = "x86_64")]
        Level::Avx512 if has_wide_lanes() => {
            // SAFETY: the processor has the four extensions.
            unsafe { with_avx512(work) };
            return;
        }
        _ => {}
    }
    #[cfg(target_arch = "x86_64")]
    if N::HAS_VNNI
        && has_wide_lanes()
        && is_x86_feature_detected!("avx512vl")
        && is_x86_feature_detected!("avx512vnni")
    {
        // SAFETY: the processor has the six extensions.
        unsafe { with_vnni(work) };
        return;
    }
    #[cfg(target_arch = "x86_64")]
    if has_wide_lanes() {
        // SAFETY: the processor has the four extensions.
        unsafe { with_avx512(work) };
        return;
    }
    dispatch(work);
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512bw,avx512vl,avx512vnni,avx2,fma")]
fn with_vnni<N: Number>(work: impl Work<N>) {
    work.with::<N::Vnni>();
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx512f,avx512bw,avx2,fma")]
fn with_avx512<N: Number>(work: impl Work<N>) {
    work.with::<N::Avx512>();
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2,fma")]
fn with_avx<N: Number>(work: impl Work<N>) {
    work.with::<N::Avx>();
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::numbers;

    #[test]
    fn a_multiply_add_is_rounded_once_whatever_the_numbers() {
        let special = [
            0.0,
            -0.0,
            1.0,
            -1.0,
            f32::MIN_POSITIVE,
            f32::from_bits(1),
            -f32::from_bits(3),
            f32::MAX,
            f32::MIN,
            f32::INFINITY,
            f32::NEG_INFINITY,
            f32::NAN,
            1.0 + f32::EPSILON,
            16_777_217.0,
            1e-38,
            3e38,
            1e-20,
        ];
        let check = |a: f32, b: f32, c: f32| {
            let (found, expected) = (computed(a, b, c), a.mul_add(b, c));
            let same = found.to_bits() == expected.to_bits() || found.is_nan() && expected.is_nan();
            assert!(same, "{a:e} * {b:e} + {c:e} = {expected:e}, not {found:e}");
        };
        for a in special {
            for b in special {
                special.into_iter().for_each(|c| check(a, b, c));
            }
        }
        // Random bits meet every exponent; random numbers near each other meet cancellation.
        let mut state = 1u64;
        let mut next = || {
            state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
            (state >> 32) as u32
        };
        for _ in 0..200_000 {
            let [a, b, c] = [next(), next(), next()].map(f32::from_bits);
            check(a, b, c);
            // A sum close to half of the last place.
            check(a, b, -(a * b));
        }
        for three in numbers(5, 300_000).chunks_exact(3) {
            let [a, b, c] = [three[0], three[1], three[2]].map(|value| value as f32);
            check(a, b, c);
            check(a, b, -a * b + c * 1e-7);
        }
    }
}
