//! The exponential in 64-bit floats, and the polynomials of which such functions consist.
//!
//! They consist of additions and multiplications in one order, none of them fused, so that every processor gives the same bits.

/// A polynomial with these factors, that of the highest power first. Compilers use no vectors for a long loop over factors.
macro_rules! polynomial {
    ($x:expr; $first:expr $(, $factor:expr)*) => {{
        let sum = $first;
        $(let sum = sum * $x + $factor;)*
        sum
    }};
}
pub(super) use polynomial;

/// `e^x`, with a relative error below 2^-45 for what is within the range of 32-bit floats.
#[inline(always)]
pub fn exp(x: f64) -> f64 {
    let (rest, power) = parts_of_exp(x);
    let result = (1.0 + rest) * power;
    if x.is_nan() { x } else { result }
}

/// `e^x - 1`, exact also near 0.
#[inline(always)]
pub fn exp_less_one(x: f64) -> f64 {
    let (rest, power) = parts_of_exp(x);
    // Near 0 the power is 1, and the rest is all.
    let result = (power - 1.0) + power * rest;
    // A sum with 0 would lose the sign of -0.
    if x.is_nan() | (x == 0.0) { x } else { result }
}

/// `e^x` as a small number, to which 1 is added, times a power of two.
///
/// `x` is `n ln 2 + r` with a whole number `n` and `r` of at most half of `ln 2`, for which the series of `e^r` is summed up to `r^11`.
#[inline(always)]
fn parts_of_exp(x: f64) -> (f64, f64) {
    // Beyond these, the result is 0 or infinite in 32 bits.
    const BOUND: f64 = 160.0;
    let bounded = if x > BOUND { BOUND } else { x };
    let bounded = if bounded < -BOUND { -BOUND } else { bounded };
    // A number of this size has no digits behind the point, and the last of its bits are the whole number.
    const WHOLE: f64 = 6_755_399_441_055_744.0;
    let shifted = bounded * std::f64::consts::LOG2_E + WHOLE;
    let n = shifted - WHOLE;
    // ln 2 as a sum of two, of which the first has so few digits that its product with `n` is exact.
    const HIGH: f64 = 0.693_147_180_369_123_8;
    const LOW: f64 = 1.908_214_929_270_587_7e-10;
    let r = (bounded - n * HIGH) - n * LOW;
    let power = f64::from_bits((shifted.to_bits().wrapping_add(1023)) << 52);
    (series(r), power)
}

/// `e^r - 1` for small `r`, in two sums that a processor computes at the same time.
#[inline(always)]
fn series(r: f64) -> f64 {
    let square = r * r;
    let odd = polynomial!(
        square;
        1.0 / 39_916_800.0,
        1.0 / 362_880.0,
        1.0 / 5_040.0,
        1.0 / 120.0,
        1.0 / 6.0,
        1.0
    );
    let even = polynomial!(
        square;
        1.0 / 3_628_800.0,
        1.0 / 40_320.0,
        1.0 / 720.0,
        1.0 / 24.0,
        1.0 / 2.0
    );
    (odd + even * r) * r
}
