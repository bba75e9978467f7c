//! `Gelu`: exact, or as its approximation by a hyperbolic tangent.

use std::f64::consts::{FRAC_1_SQRT_2, PI};

use pdk_sdk::error::Result;

use super::functions::{each, times};
use super::operator::{Operator, Parts, Rule, same};
use crate::builder::Builder;
use crate::site::Site;
use crate::tensor::Tensor;

pub const OPERATORS: &[Operator] = &[Operator::new("Gelu", same, evaluate, Rule::First(gradient))];

/// The factor of the cube in the approximation.
pub const CUBE: f64 = 0.044715;

/// Whether a node asks for the approximation.
pub fn approximate(site: &Site<'_>) -> bool {
    site.text("approximate", "none") == "tanh"
}

fn evaluate(site: &Site<'_>, inputs: &[Option<&Tensor>]) -> Result<Vec<Tensor>> {
    if approximate(site) {
        return each(inputs, |x| 0.5 * x * (1.0 + libm::tanh((2.0 / PI).sqrt() * (x + CUBE * x * x * x))));
    }
    each(inputs, |x| 0.5 * x * (1.0 + libm::erf(x * FRAC_1_SQRT_2)))
}

fn gradient(site: &Site<'_>, b: &mut Builder, g: &str) -> Result<Parts> {
    let x = site.input(0)?;
    let square = b.mul(x, x)?;
    let (step, steepness) = if approximate(site) {
        // With u = sqrt(2 / pi) (x + c x^3) the slope is (1 + tanh u) / 2 + x (1 - tanh^2 u) u' / 2.
        let root = (2.0 / PI).sqrt();
        let cubic = b.scale(&square, CUBE)?;
        let cubic = b.offset(&cubic, 1.0)?;
        let u = b.mul(x, &cubic)?;
        let u = b.scale(&u, root)?;
        let tanh = b.unary("Tanh", &u)?;
        let tanh_square = b.mul(&tanh, &tanh)?;
        let rest = b.complement(&tanh_square)?;
        let inner = b.scale(&square, 3.0 * CUBE * root)?;
        let inner = b.offset(&inner, root)?;
        (tanh, b.mul(&rest, &inner)?)
    } else {
        // The slope is (1 + erf(x / sqrt 2)) / 2 + x exp(-x^2 / 2) / sqrt(2 pi).
        let scaled = b.scale(x, FRAC_1_SQRT_2)?;
        let falling = b.scale(&square, -0.5)?;
        let bell = b.unary("Exp", &falling)?;
        (b.unary("Erf", &scaled)?, b.scale(&bell, (2.0 / PI).sqrt())?)
    };
    let step = b.offset(&step, 1.0)?;
    let rise = b.mul(x, &steepness)?;
    let twice = b.binary("Add", &step, &rise)?;
    let slope = b.scale(&twice, 0.5)?;
    times(b, g, &slope)
}

#[cfg(test)]
mod tests {
    use crate::testing::check;

    #[test]
    fn both_forms_have_their_own_gradient() {
        check("gelu");
        check("gelu/tanh");
    }
}
