//! Functions of each element that are computed in 64-bit floats, many elements at a time, and rounded to 32 bits, most of which need an exponential;
//! and `Softmax`.
//!
//! They consist of additions, multiplications and divisions in one order, none of them fused, so that every processor gives the same bits.
//! The functions of `libm` are as exact, and several times slower.

use pdk_sdk::error::Result;

use super::buffer::{Buffer, Operation, single};
use super::lanes::{Lanes, Work, dispatch};
use crate::operators::softmax;
use crate::order::greater;
use crate::site::Site;

/// A function of each element.
#[derive(Clone, Copy)]
pub enum Smooth {
    /// `e^x`.
    Exp,
    /// `1 / (1 + e^-x)`.
    Sigmoid,
    /// `(e^2x - 1) / (e^2x + 1)`.
    Tanh,
    /// `x`, and `alpha (e^x - 1)` below 0.
    Elu(f64),
    /// `alpha x + beta`, from 0 to 1.
    HardSigmoid(f64, f64),
    /// `x` times `x / 6 + 1 / 2` from 0 to 1.
    HardSwish,
}

impl Smooth {
    /// The function of a node; nothing if it is another.
    pub fn new(site: &Site<'_>) -> Option<Self> {
        match site.node.op_type.as_str() {
            "Exp" => Some(Self::Exp),
            "Sigmoid" => Some(Self::Sigmoid),
            "Tanh" => Some(Self::Tanh),
            "Elu" => Some(Self::Elu(site.float("alpha", 1.0))),
            "HardSigmoid" => Some(Self::HardSigmoid(site.float("alpha", 0.2), site.float("beta", 0.5))),
            "HardSwish" => Some(Self::HardSwish),
            _ => None,
        }
    }
}

impl Operation for Smooth {
    fn run(&mut self, inputs: &[Option<&Buffer>], outputs: &mut [Buffer]) -> Result<()> {
        dispatch(Each { function: *self, input: single(inputs, 0)?, into: outputs[0].single_mut()? });
        Ok(())
    }
}

struct Each<'a> {
    function: Smooth,
    input: &'a [f32],
    into: &'a mut [f32],
}

impl Each<'_> {
    #[inline(always)]
    fn all(self, f: impl Fn(f64) -> f64) {
        self.into.iter_mut().zip(self.input).for_each(|(into, &x)| *into = f(f64::from(x)) as f32);
    }
}

impl Work for Each<'_> {
    #[inline(always)]
    fn with<L: Lanes>(self) {
        match self.function {
            Smooth::Exp => self.all(exp),
            Smooth::Sigmoid => self.all(|x| 1.0 / (1.0 + exp(-x))),
            Smooth::Tanh => self.all(tanh),
            Smooth::Elu(alpha) => self.all(|x| if x < 0.0 { alpha * exp_less_one(x) } else { x }),
            Smooth::HardSigmoid(alpha, beta) => self.all(|x| share(alpha * x + beta)),
            Smooth::HardSwish => self.all(|x| x * share(x / 6.0 + 0.5)),
        }
    }
}

/// A number from 0 to 1.
#[inline(always)]
fn share(x: f64) -> f64 {
    let x = if x < 0.0 { 0.0 } else { x };
    if x > 1.0 { 1.0 } else { x }
}

/// `e^x`, with a relative error below 2^-45 for what is within the range of 32-bit floats.
///
/// `x` is `n ln 2 + r` with a whole number `n` and `r` of at most half of `ln 2`, for which the series of `e^r` is summed up to `r^11`.
#[inline(always)]
pub fn exp(x: f64) -> f64 {
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
    let result = (1.0 + series(r)) * power;
    if x.is_nan() { x } else { result }
}

/// `e^r - 1` for small `r`.
#[inline(always)]
fn series(r: f64) -> f64 {
    const FACTORS: [f64; 11] = [
        1.0 / 39_916_800.0,
        1.0 / 3_628_800.0,
        1.0 / 362_880.0,
        1.0 / 40_320.0,
        1.0 / 5_040.0,
        1.0 / 720.0,
        1.0 / 120.0,
        1.0 / 24.0,
        1.0 / 6.0,
        1.0 / 2.0,
        1.0,
    ];
    FACTORS.into_iter().fold(0.0, |sum, factor| sum * r + factor) * r
}

/// `e^x - 1`, exact also near 0.
#[inline(always)]
fn exp_less_one(x: f64) -> f64 {
    if x.abs() < 0.3 { series(x) } else { exp(x) - 1.0 }
}

/// The hyperbolic tangent.
#[inline(always)]
fn tanh(x: f64) -> f64 {
    let twice = exp_less_one(2.0 * x.abs());
    (twice / (twice + 2.0)).copysign(x)
}

/// `Softmax`.
pub struct Softmax {
    /// The elements that sum to one, and how far they are apart.
    length: usize,
    apart: usize,
    powers: Vec<f64>,
}

impl Softmax {
    /// The node's.
    ///
    /// # Errors
    /// If it contradicts itself.
    pub fn new(site: &Site<'_>) -> Result<Self> {
        let (length, apart) = softmax::group(site)?;
        Ok(Self { length, apart, powers: vec![0.0; length] })
    }
}

impl Operation for Softmax {
    fn run(&mut self, inputs: &[Option<&Buffer>], outputs: &mut [Buffer]) -> Result<()> {
        let (input, into) = (single(inputs, 0)?, outputs[0].single_mut()?);
        let (block, apart) = (self.length * self.apart, self.apart);
        for (input, into) in input.chunks_exact(block.max(1)).zip(into.chunks_exact_mut(block.max(1))) {
            for first in 0..apart {
                let values = || input[first..].iter().step_by(apart).map(|value| f64::from(*value));
                let greatest = values().fold(f64::NEG_INFINITY, greater);
                self.powers
                    .iter_mut()
                    .zip(values())
                    .for_each(|(power, value)| *power = exp(value - greatest));
                let sum: f64 = self.powers.iter().sum();
                let shares = self.powers.iter().map(|power| (power / sum) as f32);
                into[first..].iter_mut().step_by(apart).zip(shares).for_each(|(into, share)| *into = share);
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Every float of a sweep over all of them, and special ones.
    fn compare(name: &str, f: impl Fn(f64) -> f64, reference: impl Fn(f64) -> f64) {
        let special = [
            0.0,
            -0.0,
            1e-30,
            -1e-30,
            88.7,
            88.8,
            -87.3,
            -103.9,
            -104.1,
            f32::INFINITY,
            f32::NEG_INFINITY,
            f32::NAN,
        ];
        let all = (0..=u32::MAX).step_by(9_973).map(f32::from_bits).chain(special);
        for x in all {
            let (found, expected) = (f(f64::from(x)) as f32, reference(f64::from(x)) as f32);
            let same = found == expected || found.is_nan() && expected.is_nan();
            let near = (i64::from(found.to_bits()) - i64::from(expected.to_bits())).abs() <= 1;
            assert!(same || near, "{name}({x:e}) is {expected:e}, not {found:e}");
        }
    }

    #[test]
    fn functions_are_those_of_libm_up_to_the_last_bit() {
        compare("exp", exp, libm::exp);
        compare("sigmoid", |x| 1.0 / (1.0 + exp(-x)), |x| 1.0 / (1.0 + libm::exp(-x)));
        compare("tanh", tanh, libm::tanh);
        compare(
            "expm1",
            |x| if x < 80.0 { exp_less_one(x) } else { 1.0 },
            |x| if x < 80.0 { libm::expm1(x) } else { 1.0 },
        );
    }
}
