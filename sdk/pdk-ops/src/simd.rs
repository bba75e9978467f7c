//! One body, compiled several times: for the baseline of the target, and on x86-64 for AVX2 and, if it pays, AVX-512, chosen at run time.
//!
//! The bodies are ordinary Rust that the compiler vectorises. They use integers, or single floating-point
//! operations that are never fused, so all versions give the same bytes.

#[cfg(target_arch = "x86_64")]
use crate::processor;

/// A set of instructions, the wider the greater.
#[cfg(any(test, target_arch = "x86_64"))]
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Instructions {
    /// Those of every processor of the target.
    Portable,
    /// AVX2.
    Avx2,
    /// AVX-512 as [`processor::has_avx512`] means it.
    Avx512,
}

/// What the image kernels use of this processor, for people: they give the same bytes with each.
pub fn instructions_in_use() -> &'static str {
    #[cfg(target_arch = "x86_64")]
    return match instructions() {
        Instructions::Portable => "x86-64",
        Instructions::Avx2 => "AVX2",
        Instructions::Avx512 => "AVX-512",
    };
    #[cfg(not(target_arch = "x86_64"))]
    return std::env::consts::ARCH;
}

/// The widest instructions that the processor has.
#[cfg(target_arch = "x86_64")]
#[inline]
pub(crate) fn instructions() -> Instructions {
    let widest = match processor::has_avx2() {
        true if processor::has_avx512() => Instructions::Avx512,
        true => Instructions::Avx2,
        false => Instructions::Portable,
    };
    #[cfg(test)]
    let widest = widest.min(ALLOWED.get());
    widest
}

#[cfg(test)]
thread_local! {
    /// The widest instructions that a test allows on this thread.
    static ALLOWED: std::cell::Cell<Instructions> = const { std::cell::Cell::new(Instructions::Avx512) };
}

/// Does a test's work once with each set of instructions, of those that the processor has.
#[cfg(test)]
pub(crate) fn with_each(mut work: impl FnMut(Instructions)) {
    for allowed in [Instructions::Avx512, Instructions::Avx2, Instructions::Portable] {
        ALLOWED.set(allowed);
        work(allowed);
    }
    ALLOWED.set(Instructions::Avx512);
}

/// Whether functions are to use their AVX2 twins.
#[cfg(target_arch = "x86_64")]
#[inline]
pub(crate) fn has_avx2() -> bool {
    instructions() >= Instructions::Avx2
}

/// Whether functions are to use their AVX-512 twins, those that have one.
#[cfg(target_arch = "x86_64")]
#[inline]
pub(crate) fn has_avx512() -> bool {
    instructions() >= Instructions::Avx512
}

/// Defines a function that is compiled for AVX2 as well, and chooses at run time: `fn NAME / NAME_FOR_AVX2 (arguments) { body }`; with
/// `fn NAME / NAME_FOR_AVX2 / NAME_FOR_AVX512 (arguments) { body }` also for AVX-512, which is for those that it makes faster:
/// many are held up by something else, and some are slower with wide registers.
///
/// The body is ordinary Rust, so all do the same single operations in the same order, and the bytes are the same. A crate that uses the
/// macro has a function `simd::has_avx2`, and `simd::has_avx512` for the second form, which its tests can make false; they cannot make it
/// use what the processor does not have.
#[macro_export]
#[allow(clippy::crate_in_macro_def)] // Each crate has its own switch for its tests.
macro_rules! vectorised {
    ($(#[$attribute:meta])* $visibility:vis fn $name:ident / $avx2:ident $(/ $avx512:ident)?
     ($($argument:ident: $type:ty),* $(,)?) $body:block) => {
        $(#[$attribute])*
        #[allow(clippy::too_many_arguments)]
        #[inline]
        $visibility fn $name($($argument: $type),*) {
            #[inline(always)]
            #[allow(clippy::too_many_arguments)]
            fn portable($($argument: $type),*) $body

            #[cfg(target_arch = "x86_64")]
            #[target_feature(enable = "avx2")]
            #[allow(clippy::too_many_arguments)]
            fn $avx2($($argument: $type),*) {
                portable($($argument),*)
            }

            $crate::wide_twin!($($avx512)? ($($argument: $type),*));
            #[cfg(target_arch = "x86_64")]
            if $crate::processor::has_avx2() && crate::simd::has_avx2() {
                // SAFETY: the processor has AVX2, which is all that this version asks for.
                return unsafe { $avx2($($argument),*) };
            }
            portable($($argument),*)
        }
    };
}
pub(crate) use vectorised;

/// The part of [`vectorised!`] for AVX-512: nothing if there is no name.
#[macro_export]
#[doc(hidden)]
#[allow(clippy::crate_in_macro_def)]
macro_rules! wide_twin {
    (($($argument:ident: $type:ty),*)) => {};
    ($avx512:ident ($($argument:ident: $type:ty),*)) => {
        #[cfg(target_arch = "x86_64")]
        #[target_feature(enable = "avx512bw,avx512dq,avx512vl,avx512vbmi")]
        #[allow(clippy::too_many_arguments)]
        fn $avx512($($argument: $type),*) {
            portable($($argument),*)
        }

        #[cfg(target_arch = "x86_64")]
        if $crate::processor::has_avx512() && crate::simd::has_avx512() {
            // SAFETY: the processor has all that this version asks for.
            return unsafe { $avx512($($argument),*) };
        }
    };
}

/// Adding this to a number in `0.0..=255.0` leaves the number, rounded half to even, in the lowest byte.
const ROUNDING: f32 = 8_388_608.0;

/// Rounds half to even what is known to lie in `-0.5..255.5`.
#[inline(always)]
pub(crate) fn round_inside_byte(value: f32) -> u8 {
    (value + ROUNDING).to_bits() as u8
}

/// Clips to `0.0..=255.0` and rounds half to even; what is not a number becomes 0.
#[allow(clippy::manual_clamp)] // `clamp` keeps what is not a number
#[inline(always)]
pub(crate) fn round_to_byte(value: f32) -> u8 {
    round_inside_byte(value.max(0.0).min(255.0))
}

/// Adding this to a number of magnitude below 2^21 leaves the number, rounded half to even, in the lower bits.
const WHOLE: f32 = 12_582_912.0;

/// Makes rounding drop fractions. What lies within 1/4096 below a whole number counts as that number, so that products
/// that are whole but for rounding stay whole.
const DOWN: f32 = 1.0 / 4096.0 - 0.5;

/// Drops the fraction of a number in `0.0..=2.0^21`.
#[inline(always)]
pub(crate) fn whole_part(value: f32) -> f32 {
    value + DOWN + WHOLE - WHOLE
}

/// Drops the fraction of a number in `0.0..256.0`.
#[inline(always)]
pub(crate) fn whole_byte(value: f32) -> u8 {
    (value + DOWN + WHOLE).to_bits() as u8
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    #[test]
    fn rounds_half_to_even_and_clips() {
        for (value, byte) in [
            (f32::NAN, 0),
            (-3.0, 0),
            (0.5, 0),
            (1.5, 2),
            (2.5, 2),
            (2.51, 3),
            (254.5, 254),
            (255.0, 255),
            (1e9, 255),
        ] {
            assert_eq!(round_to_byte(value), byte, "{value}");
        }
    }

    #[test]
    fn drops_fractions() {
        for (value, whole) in
            [(0.0, 0.0), (0.99, 0.0), (1.0, 1.0), (2.0, 2.0), (2.9999, 3.0), (254.5, 254.0), (255.0, 255.0)]
        {
            assert_eq!(whole_part(value), whole, "{value}");
            assert_eq!(f32::from(whole_byte(value)), whole, "{value}");
        }
    }

    proptest! {
        // The room below a whole number is 1/4096, and half as much may be rounding.
        #[test]
        fn drops_the_fraction_of_any_number(value in 0.0..256.0_f32) {
            let byte = f32::from(whole_byte(value.min(255.5)));
            let value = value.min(255.5);
            prop_assert!(byte <= value + 1.5 / 4096.0, "{value} became {byte}");
            prop_assert!(byte > value - 1.0, "{value} became {byte}");
            prop_assert_eq!(byte, whole_part(value));
        }

        #[test]
        fn takes_what_lies_barely_below_a_whole_number_for_it(whole in 1..=255_u8) {
            let whole = f32::from(whole);
            prop_assert_eq!(f32::from(whole_byte(whole - 1.0 / 8192.0)), whole);
            prop_assert_eq!(f32::from(whole_byte(whole - 1.0 / 2048.0)), whole - 1.0);
        }
    }
}
