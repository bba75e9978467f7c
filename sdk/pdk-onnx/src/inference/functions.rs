//! Functions of each element that are computed in 64-bit floats, many elements at a time, and rounded to 32 bits, most of which need an exponential.
//!
//! They consist of additions, multiplications and divisions in one order, none of them fused, so that every processor gives the same bits.
//! The functions of `libm` are as exact, and several times slower.

use pdk_sdk::error::Result;

use super::buffer::{Buffer, Operation, single};
use super::error_function::{erf, normal_share};
use super::exponential::{exp, exp_less_one};
use super::lanes::{Lanes, Work, dispatch_wide};
use super::logarithm::{log, mish, softplus};
use crate::operators::{gelu, rectifiers};
use crate::order::{cut, further};
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
    /// The error function.
    Erf,
    /// `x` times the share of a normal distribution below `x`.
    Gelu,
    /// The same approximately, by a hyperbolic tangent.
    GeluByTanh,
    /// `x / (1 + e^(-alpha x))`.
    Swish(f64),
    /// `gamma x`, and `gamma alpha (e^x - 1)` below 0.
    Selu(f64, f64),
    /// `x`, and `alpha (e^(x / alpha) - 1)` below 0.
    Celu(f64),
    /// The natural logarithm.
    Log,
    /// `log(1 + e^x)`.
    Softplus,
    /// `x tanh(log(1 + e^x))`.
    Mish,
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
            "Erf" => Some(Self::Erf),
            "Gelu" if gelu::approximate(site) => Some(Self::GeluByTanh),
            "Gelu" => Some(Self::Gelu),
            "Swish" => Some(Self::Swish(site.float("alpha", 1.0))),
            "Selu" => {
                let (alpha, gamma) = rectifiers::of_selu(site);
                Some(Self::Selu(alpha, gamma))
            }
            "Celu" => rectifiers::alpha_of_celu(site).ok().map(Self::Celu),
            "Log" => Some(Self::Log),
            "Softplus" => Some(Self::Softplus),
            "Mish" => Some(Self::Mish),
            _ => None,
        }
    }
}

impl Operation for Smooth {
    fn run(&mut self, inputs: &[Option<&Buffer>], outputs: &mut [Buffer]) -> Result<()> {
        dispatch_wide(Each { function: *self, input: single(inputs, 0)?, into: outputs[0].single_mut()? });
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
        // Not `for_each`, whose code a compiler keeps apart if it is long, for any processor then.
        for (into, x) in self.into.iter_mut().zip(self.input) {
            *into = f(f64::from(*x)) as f32;
        }
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
            Smooth::Erf => self.all(erf),
            Smooth::Gelu => self.all(gelu),
            Smooth::GeluByTanh => self.all(gelu_by_tanh),
            Smooth::Swish(alpha) => self.all(|x| x * logistic(alpha * x)),
            Smooth::Selu(alpha, gamma) => {
                self.all(|x| gamma * if x > 0.0 { x } else { alpha * exp_less_one(x) });
            }
            Smooth::Celu(alpha) => {
                self.all(|x| cut(x) + further(0.0, alpha * exp_less_one(x / alpha), -1.0));
            }
            Smooth::Log => self.all(log),
            Smooth::Softplus => self.all(softplus),
            Smooth::Mish => self.all(mish),
        }
    }
}

/// A number from 0 to 1.
#[inline(always)]
fn share(x: f64) -> f64 {
    let x = if x < 0.0 { 0.0 } else { x };
    if x > 1.0 { 1.0 } else { x }
}

/// The hyperbolic tangent.
#[inline(always)]
fn tanh(x: f64) -> f64 {
    let twice = exp_less_one(2.0 * x.abs());
    (twice / (twice + 2.0)).copysign(x)
}

/// `x` times the share of a normal distribution below `x`.
#[inline(always)]
fn gelu(x: f64) -> f64 {
    x * normal_share(x)
}

/// `1 / (1 + e^-x)`, and exactly 0 far below 0.
#[inline(always)]
fn logistic(x: f64) -> f64 {
    let share = 1.0 / (1.0 + exp(-x));
    if x < -150.0 { 0.0 } else { share }
}

/// `x (1 + tanh u) / 2` with `u = sqrt(2 / pi) (x + c x^3)`, which is `x / (1 + e^-2u)`.
#[inline(always)]
fn gelu_by_tanh(x: f64) -> f64 {
    // The square root of 8 / pi.
    const FACTOR: f64 = 1.595_769_121_605_730_7;
    x * logistic(FACTOR * (x + gelu::CUBE * x * x * x))
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
        compare("erf", erf, libm::erf);
        // Where 1 - erf has lost its digits, this has not.
        compare("gelu", gelu, |x| x * (0.5 * libm::erfc(-x * std::f64::consts::FRAC_1_SQRT_2)));
        compare("log", log, libm::log);
        compare("softplus", softplus, |x| libm::log1p(libm::exp(-x.abs())) + if x > 0.0 { x } else { 0.0 });
        // Below -30, the sum with 1 keeps none of the exponential.
        compare("mish", mish, |x| {
            x * if x < -30.0 { libm::exp(x) } else { libm::tanh(libm::log1p(libm::exp(x))) }
        });
        let factor = libm::sqrt(8.0 / std::f64::consts::PI);
        compare("gelu by tanh", gelu_by_tanh, |x| {
            x / (1.0 + libm::exp(-factor * (x + gelu::CUBE * x * x * x)))
        });
    }
}
