//! The natural logarithm, and functions that need it, in 64-bit floats.

use super::exponential::{exp, polynomial};

/// Half of `log((1 + s) / (1 - s))` divided by `s`, up to `s = 1/3`, from the square of `s`: the series of the inverse hyperbolic tangent, up to
/// its 26th power.
#[inline(always)]
fn slope(square: f64) -> f64 {
    let fourth = square * square;
    // Two short sums, which a processor computes at the same time.
    let even = polynomial!(
        fourth;
        1.0 / 25.0,
        1.0 / 21.0,
        1.0 / 17.0,
        1.0 / 13.0,
        1.0 / 9.0,
        1.0 / 5.0,
        1.0
    );
    let odd = polynomial!(
        fourth;
        1.0 / 27.0,
        1.0 / 23.0,
        1.0 / 19.0,
        1.0 / 15.0,
        1.0 / 11.0,
        1.0 / 7.0,
        1.0 / 3.0
    );
    even + odd * square
}

/// `log x`, with a relative error below 2^-45 for what 32-bit floats hold.
///
/// `x` is `2^n m` with a whole number `n` and `m` from the square root of 1/2 to that of 2, and `log m` a series of `(m - 1) / (m + 1)`.
#[inline(always)]
pub fn log(x: f64) -> f64 {
    // From the bits of the square root of 1/2 to those of 1.
    const LIFT: u64 = 0x3ff0_0000_0000_0000 - 0x3fe6_a09e_667f_3bcd;
    // A number of this size has no digits behind the point, and the last of its bits are the whole number.
    const WHOLE: f64 = 4_503_599_627_370_496.0;
    const HIGH: f64 = 0.693_147_180_369_123_8;
    const LOW: f64 = 1.908_214_929_270_587_7e-10;
    let exponent = x.to_bits().wrapping_add(LIFT) >> 52;
    let n = f64::from_bits(exponent | WHOLE.to_bits()) - (WHOLE + 1023.0);
    let m = f64::from_bits(x.to_bits().wrapping_sub(exponent.wrapping_sub(1023) << 52));
    let s = (m - 1.0) / (m + 1.0);
    let result = n * HIGH + (n * LOW + 2.0 * s * slope(s * s));
    let result = if x == 0.0 { f64::NEG_INFINITY } else { result };
    let result = if x == f64::INFINITY { x } else { result };
    // What is not a number is not below 0 either, and stays so.
    let result = if x < 0.0 { f64::NAN } else { result };
    if x.is_nan() { x } else { result }
}

/// `log(1 + e^x)`.
#[inline(always)]
pub fn softplus(x: f64) -> f64 {
    let z = exp(-x.abs());
    // log(1 + z) of at most 1.
    let s = z / (2.0 + z);
    let bend = 2.0 * s * slope(s * s);
    bend + if x > 0.0 { x } else { 0.0 }
}

/// `x` times the hyperbolic tangent of `log(1 + e^x)`.
#[inline(always)]
pub fn mish(x: f64) -> f64 {
    // From here on, the tangent is 1.
    let bounded = if x > 40.0 { 40.0 } else { x };
    let z = exp(bounded);
    let square = z * (z + 2.0);
    let tangent = square / (square + 2.0);
    x * if x < -150.0 { 0.0 } else { tangent }
}
