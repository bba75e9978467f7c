//! The error function and the share of a normal distribution, in 64-bit floats.

use std::f64::consts::FRAC_1_SQRT_2;

use super::exponential::{exp, exp_less_one, polynomial};

/// From here on, the complement of the error function is 0 for 32-bit floats.
const FAR: f64 = 11.0;

/// The negative logarithm of the complement of the error function, from 0 to [`FAR`].
///
/// It is `t^2 + t s(t)` with a slowly falling `s`, which is a polynomial of `t / (t + 5)` here: the one of 15th degree whose largest
/// difference, times `t` above 1, is smallest (by the algorithm of Remez). That difference is 2^-37, and so is the relative
/// error of the complement.
#[inline(always)]
fn negative_log(t: f64) -> f64 {
    let place = t / (t + 5.0);
    let square = place * place;
    let fourth = square * square;
    // Four short sums, which a processor computes at the same time.
    let a = polynomial!(fourth; 162.027_291_352_072_24, -2.234_784_369_314_676, -1.412_480_941_532_947, 1.128_379_167_091_020_6);
    let b = polynomial!(fourth; -107.834_621_131_342_16, -23.026_824_512_169_405, -1.116_187_547_446_983_8, -1.816_901_137_769_021);
    let c = polynomial!(fourth; 41.882_417_830_571_23, 86.855_110_511_913_82, 3.194_007_565_954_433, 0.752_414_049_640_432_6);
    let d = polynomial!(fourth; -7.323_953_296_195_07, -152.468_448_076_934_52, 0.470_095_692_376_264_14, 0.930_662_656_980_518_6);
    let slow = (a + b * place) + (c + d * place) * square;
    t * (t + slow)
}

/// The distance from 0, at most [`FAR`].
#[inline(always)]
fn bounded(x: f64) -> f64 {
    let t = x.abs();
    if t > FAR { FAR } else { t }
}

/// The error function.
#[inline(always)]
pub fn erf(x: f64) -> f64 {
    (-exp_less_one(-negative_log(bounded(x)))).copysign(x)
}

/// The share of a normal distribution with mean 0 and deviation 1 that lies below `x`.
#[inline(always)]
pub fn normal_share(x: f64) -> f64 {
    let t = bounded(x * FRAC_1_SQRT_2);
    let beyond = 0.5 * exp(-negative_log(t));
    let beyond = if t >= FAR { 0.0 } else { beyond };
    if x < 0.0 { beyond } else { 1.0 - beyond }
}
