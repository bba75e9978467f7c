//! Operators on each element, and on pairs of elements whose shapes are broadcast, as far as they are one operation of 32-bit floats.
//!
//! Each of these gives the same bits as the same operation in 64 bits that is then rounded to 32: the sum, difference, product and quotient of
//! two 32-bit floats and the square root of one have this property (Figueroa, When is double rounding innocuous?, 1995).

use pdk_sdk::error::{Error, Result};

use super::broadcast::Broadcast;
use super::buffer::{Buffer, Operation, is_single, single};
use super::lanes::Number;
use crate::operators::functions;
use crate::site::Site;
use crate::tensor::Element;

/// A function of one number.
pub struct Unary(Function);

#[derive(Clone, Copy)]
enum Function {
    Relu,
    LeakyRelu(f32),
    Clip(f32, f32),
    Neg,
    Abs,
    Sqrt,
    Round,
    Floor,
    Ceil,
    Reciprocal,
    Same,
}

impl Unary {
    /// The function of a node; nothing if it is not one of these.
    ///
    /// # Errors
    /// If the node contradicts itself.
    pub fn new(site: &Site<'_>) -> Result<Option<Self>> {
        Ok(Some(Self(match site.node.op_type.as_str() {
            "Relu" => Function::Relu,
            "LeakyRelu" => Function::LeakyRelu(site.float("alpha", 0.01) as f32),
            "Clip" => match functions::bounds(site) {
                Ok([low, high]) => Function::Clip(
                    low.map_or(f32::NEG_INFINITY, |low| low as f32),
                    high.map_or(f32::INFINITY, |high| high as f32),
                ),
                // Bounds that are computed.
                Err(_) => return Ok(None),
            },
            "Neg" => Function::Neg,
            "Abs" => Function::Abs,
            "Sqrt" => Function::Sqrt,
            "Round" => Function::Round,
            "Floor" => Function::Floor,
            "Ceil" => Function::Ceil,
            "Reciprocal" => Function::Reciprocal,
            // Every type of at most 16 bits is contained in 32-bit floats.
            "Cast" if site.fact_of_output()?.element == Element::FLOAT => Function::Same,
            _ => return Ok(None),
        })))
    }
}

impl Operation for Unary {
    fn run(&mut self, inputs: &[Option<&Buffer>], outputs: &mut [Buffer]) -> Result<()> {
        fn each(input: &[f32], into: &mut [f32], f: impl Fn(f32) -> f32) {
            into.iter_mut().zip(input).for_each(|(into, &x)| *into = f(x));
        }
        let (input, into) = (single(inputs, 0)?, outputs[0].single_mut()?);
        match self.0 {
            Function::Relu => each(input, into, f32::cut),
            Function::LeakyRelu(slope) => each(input, into, |x| if x < 0.0 { slope * x } else { x }),
            Function::Clip(low, high) => each(input, into, |x| {
                let x = if x < low { low } else { x };
                if x > high { high } else { x }
            }),
            Function::Neg => each(input, into, |x| -x),
            Function::Abs => each(input, into, f32::abs),
            Function::Sqrt => each(input, into, f32::sqrt),
            Function::Round => each(input, into, round),
            Function::Floor => each(input, into, |x| if round(x) > x { round(x) - 1.0 } else { round(x) }),
            Function::Ceil => {
                each(input, into, |x| if round(x) < x { (round(x) + 1.0).copysign(x) } else { round(x) })
            }
            Function::Reciprocal => each(input, into, |x| 1.0 / x),
            Function::Same => into.copy_from_slice(input),
        }
        Ok(())
    }
}

/// `Cast` from a type of more than 32 bits, or of as many that are an integer, to 32-bit floats.
pub struct Narrowing;

impl Narrowing {
    /// The node, if it is one.
    ///
    /// # Errors
    /// If the node contradicts itself.
    pub fn new(site: &Site<'_>) -> Result<Option<Self>> {
        let is_one = site.node.op_type == "Cast"
            && site.fact_of_output()?.element == Element::FLOAT
            && !is_single(site.fact(0)?.element);
        Ok(is_one.then_some(Self))
    }
}

impl Operation for Narrowing {
    fn run(&mut self, inputs: &[Option<&Buffer>], outputs: &mut [Buffer]) -> Result<()> {
        let into = outputs[0].single_mut()?;
        match inputs.first().copied().flatten() {
            Some(Buffer::Double(values)) => {
                into.iter_mut().zip(values).for_each(|(into, value)| *into = *value as f32);
                Ok(())
            }
            _ => Err(Error::new("a value has 32 bits, which is a defect in pdk")),
        }
    }
}

/// The nearest whole number, the even one of two that are as near. Processors without an instruction for that call a function, and this is
/// faster: from 2^23 on, a 32-bit float has no digits behind the point.
fn round(x: f32) -> f32 {
    const WHOLE: f32 = 8_388_608.0;
    if x.abs() < WHOLE { ((x.abs() + WHOLE) - WHOLE).copysign(x) } else { x }
}

/// A function of two numbers.
pub struct Binary {
    pair: Pair,
    way: Broadcast<2>,
}

#[derive(Clone, Copy)]
enum Pair {
    Add,
    Sub,
    Mul,
    Div,
    Max,
    Min,
    Greater,
    GreaterOrEqual,
    Less,
    LessOrEqual,
    Equal,
    Slope,
    Pow,
}

impl Binary {
    /// The function of a node; nothing if it is not one of these.
    ///
    /// # Errors
    /// If the shapes do not go together.
    pub fn new(site: &Site<'_>) -> Result<Option<Self>> {
        let name = match (site.node.op_type.as_str(), site.node.input.len()) {
            ("Add", _) | ("Sum", 2) => Pair::Add,
            ("Sub", _) => Pair::Sub,
            ("Mul", _) => Pair::Mul,
            ("Div", _) => Pair::Div,
            ("Max", 2) => Pair::Max,
            ("Min", 2) => Pair::Min,
            ("Greater", _) => Pair::Greater,
            ("GreaterOrEqual", _) => Pair::GreaterOrEqual,
            ("Less", _) => Pair::Less,
            ("LessOrEqual", _) => Pair::LessOrEqual,
            ("Equal", _) => Pair::Equal,
            ("PRelu", _) => Pair::Slope,
            ("Pow", _) if site.fact(0)?.element.is_float() => Pair::Pow,
            _ => return Ok(None),
        };
        Ok(Some(Self { pair: name, way: Broadcast::new([site.shape(0)?, site.shape(1)?])? }))
    }

    fn apply(&mut self, left: &[f32], right: &[f32], into: &mut [f32], f: impl Fn(f32, f32) -> f32) {
        let steps = self.way.steps();
        self.way.rows(into, |row, [a, b]| {
            let length = row.len();
            match steps {
                [1, 1] => {
                    let pairs = left[a..a + length].iter().zip(&right[b..b + length]);
                    row.iter_mut().zip(pairs).for_each(|(into, (a, b))| *into = f(*a, *b));
                }
                [1, 0] => {
                    let b = right[b];
                    row.iter_mut().zip(&left[a..a + length]).for_each(|(into, a)| *into = f(*a, b));
                }
                [0, 1] => {
                    let a = left[a];
                    row.iter_mut().zip(&right[b..b + length]).for_each(|(into, b)| *into = f(a, *b));
                }
                [of_left, of_right] => {
                    for (place, into) in row.iter_mut().enumerate() {
                        *into = f(left[a + place * of_left], right[b + place * of_right]);
                    }
                }
            }
        });
    }
}

/// 1 if something holds, else 0. Compilers use vectors for a choice, and not for a conversion.
#[inline(always)]
fn truth(holds: bool) -> f32 {
    if holds { 1.0 } else { 0.0 }
}

impl Operation for Binary {
    fn run(&mut self, inputs: &[Option<&Buffer>], outputs: &mut [Buffer]) -> Result<()> {
        let (left, right, into) = (single(inputs, 0)?, single(inputs, 1)?, outputs[0].single_mut()?);
        match self.pair {
            Pair::Add => self.apply(left, right, into, |a, b| a + b),
            Pair::Sub => self.apply(left, right, into, |a, b| a - b),
            Pair::Mul => self.apply(left, right, into, |a, b| a * b),
            Pair::Div => self.apply(left, right, into, |a, b| a / b),
            Pair::Max => self.apply(left, right, into, |a, b| if b > a || b.is_nan() { b } else { a }),
            Pair::Min => self.apply(left, right, into, |a, b| if b < a || b.is_nan() { b } else { a }),
            Pair::Greater => self.apply(left, right, into, |a, b| truth(a > b)),
            Pair::GreaterOrEqual => self.apply(left, right, into, |a, b| truth(a >= b)),
            Pair::Less => self.apply(left, right, into, |a, b| truth(a < b)),
            Pair::LessOrEqual => self.apply(left, right, into, |a, b| truth(a <= b)),
            Pair::Equal => self.apply(left, right, into, |a, b| truth(a == b)),
            Pair::Slope => self.apply(left, right, into, |x, slope| if x < 0.0 { slope * x } else { x }),
            // Not one operation, but no faster than by `libm`.
            Pair::Pow => {
                self.apply(left, right, into, |a, b| libm::pow(f64::from(a), f64::from(b)) as f32);
            }
        }
        Ok(())
    }
}
