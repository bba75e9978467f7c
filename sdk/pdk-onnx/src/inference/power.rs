//! `Pow` with one exponent.

use pdk_sdk::error::Result;

use super::buffer::{Buffer, Constants, Operation, single};
use super::exponential::exp;
use super::lanes::{Lanes, Work, dispatch_wide};
use super::logarithm::log;
use crate::site::Site;

/// Powers with one exponent.
#[derive(Debug, Clone, Copy)]
pub enum Power {
    /// 2.
    Square,
    /// 3.
    Cube,
    /// 1 / 2.
    Root,
    /// -1 / 2.
    InverseRoot,
    /// -1.
    Inverse,
    /// -2.
    InverseSquare,
    /// 4.
    Fourth,
    /// Any other.
    Other(f64),
}

impl Power {
    /// The powers of a node with these inputs; nothing if it is another, or has several exponents.
    pub fn new(site: &Site<'_>, constants: &Constants) -> Option<Self> {
        let [_, Some(exponent)] = constants else { return None };
        let &[exponent] = exponent.values.as_slice() else { return None };
        let all = [
            (2.0, Self::Square),
            (3.0, Self::Cube),
            (0.5, Self::Root),
            (-0.5, Self::InverseRoot),
            (-1.0, Self::Inverse),
            (-2.0, Self::InverseSquare),
            (4.0, Self::Fourth),
        ];
        let found = all.into_iter().find(|(of, _)| *of == exponent).map(|(_, power)| power);
        (site.node.op_type == "Pow").then(|| found.unwrap_or(Self::Other(exponent)))
    }
}

impl Operation for Power {
    fn run(&mut self, inputs: &[Option<&Buffer>], outputs: &mut [Buffer]) -> Result<()> {
        dispatch_wide(Each { power: *self, input: single(inputs, 0)?, into: outputs[0].single_mut()? });
        Ok(())
    }
}

struct Each<'a> {
    power: Power,
    input: &'a [f32],
    into: &'a mut [f32],
}

impl Each<'_> {
    #[inline(always)]
    fn all(self, f: impl Fn(f32) -> f32) {
        for (into, x) in self.into.iter_mut().zip(self.input) {
            *into = f(*x);
        }
    }

    #[inline(always)]
    fn wide(self, f: impl Fn(f64) -> f64) {
        self.all(|x| f(f64::from(x)) as f32);
    }

    /// By a logarithm. What has none, and exponents that multiply its error, are left to `libm`.
    #[inline(always)]
    fn other(self, exponent: f64) {
        let is_small = exponent.abs() < 64.0;
        let is_plain = |x: f32| is_small & (x > 0.0) & (x < f32::INFINITY);
        let mut are_plain = true;
        for (into, x) in self.into.iter_mut().zip(self.input) {
            *into = exp(exponent * log(f64::from(*x))) as f32;
            are_plain &= is_plain(*x);
        }
        if are_plain {
            return;
        }
        for (into, x) in self.into.iter_mut().zip(self.input).filter(|(_, x)| !is_plain(**x)) {
            *into = libm::pow(f64::from(*x), exponent) as f32;
        }
    }
}

impl Work for Each<'_> {
    #[inline(always)]
    fn with<L: Lanes>(self) {
        match self.power {
            Power::Square => self.all(|x| x * x),
            Power::Inverse => self.all(|x| 1.0 / x),
            Power::Cube => self.wide(|x| x * x * x),
            Power::Fourth => self.wide(|x| (x * x) * (x * x)),
            Power::InverseSquare => self.wide(|x| 1.0 / (x * x)),
            Power::Root => self.all(root),
            Power::Other(exponent) => self.other(exponent),
            Power::InverseRoot => self.all(|x| (1.0 / f64::from(positive(x)).sqrt()) as f32),
        }
    }
}

/// The power 1 / 2.
#[inline(always)]
fn root(x: f32) -> f32 {
    positive(x).sqrt()
}

/// A number whose root is the power 1 / 2: those of -0 and the negative infinity are not their square roots.
#[inline(always)]
fn positive(x: f32) -> f32 {
    if x == f32::NEG_INFINITY { f32::INFINITY } else { x + 0.0 }
}
