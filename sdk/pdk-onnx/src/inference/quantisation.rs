//! `QuantizeLinear`, `DequantizeLinear` and `DynamicQuantizeLinear`: floats as integers of 8 and 16 bits, and back.

use pdk_sdk::error::Result;

use super::buffer::{Buffer, Constants, Operation, WHOLE, single, singles};
use super::lanes::{Lanes, Work, dispatch_wide};
use crate::operators::quantize::Factors;
use crate::site::Site;
use crate::tensor::Element;

/// The integers that floats become: those of a range, whose zero point stands for 0.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Range {
    /// The least and the greatest integer.
    pub bounds: [f32; 2],
    /// The integer that 0 becomes.
    pub zero: f32,
}

impl Range {
    /// Those of a type of at most 16 bits.
    pub fn of(element: Element, zero: f32) -> Option<Self> {
        let (low, high) = element.range().filter(|(low, high)| high - low <= 0xffff)?;
        Some(Self { bounds: [low as f32, high as f32], zero })
    }

    /// The nearest integer of the range to a number of steps from the zero point, of two the even number of steps; the integer 0 for what is
    /// not a number.
    #[inline(always)]
    pub fn nearest(self, steps: f32) -> f32 {
        let [low, high] = self.bounds.map(|bound| bound - self.zero);
        let within = if steps > low { steps } else { low };
        let within = if within > high { high } else { within };
        // Adding the zero point turns -0 into 0.
        let whole = (within + WHOLE) - WHOLE + self.zero;
        if steps.is_nan() { 0.0 } else { whole }
    }
}

/// A node that quantises, or the reverse.
pub struct Quantisation {
    is_reverse: bool,
    /// How many neighbouring elements share a factor.
    length: usize,
    scales: Vec<f32>,
    ranges: Vec<Range>,
}

impl Quantisation {
    /// The node, if its factors and zero points are constant and belong to its input as a whole or to places along an axis.
    ///
    /// # Errors
    /// If it contradicts itself.
    pub fn new(site: &Site<'_>, constants: &Constants) -> Result<Option<Self>> {
        let is_reverse = match site.node.op_type.as_str() {
            "QuantizeLinear" => false,
            "DequantizeLinear" => true,
            _ => return Ok(None),
        };
        let (input, output) = (site.fact(0)?, site.fact_of_output()?);
        let (float, integer) = if is_reverse { (output, input) } else { (input, output) };
        let known = |place: usize| constants.get(place).and_then(Option::as_deref);
        let (Some(scales), Element::FLOAT) = (known(1), float.element) else { return Ok(None) };
        if scales.element != Element::FLOAT || site.optional(2).is_some() != known(2).is_some() {
            return Ok(None);
        }
        let length: usize = match Factors::of(site, &input.shape, &scales.shape)? {
            Factors::One => input.shape.iter().product(),
            Factors::Along(axis) => input.shape[axis + 1..].iter().product(),
            Factors::Blocks { .. } => return Ok(None),
        };
        let zeros = known(2).map_or_else(|| vec![0.0; scales.values.len()], singles);
        let ranges = zeros.iter().map(|zero| Range::of(integer.element, *zero));
        let Some(ranges) = ranges.collect::<Option<Vec<_>>>() else { return Ok(None) };
        if ranges.len() != scales.values.len() {
            return Ok(None);
        }
        Ok(Some(Self { is_reverse, length: length.max(1), scales: singles(scales), ranges }))
    }
}

impl Operation for Quantisation {
    fn is_rounded(&self) -> bool {
        true
    }

    fn run(&mut self, inputs: &[Option<&Buffer>], outputs: &mut [Buffer]) -> Result<()> {
        dispatch_wide(Elements { of: self, input: single(inputs, 0)?, into: outputs[0].single_mut()? });
        Ok(())
    }
}

/// The elements of an input, and where the results go.
struct Elements<'a> {
    of: &'a Quantisation,
    input: &'a [f32],
    into: &'a mut [f32],
}

impl Work for Elements<'_> {
    #[inline(always)]
    fn with<L: Lanes>(self) {
        let Quantisation { is_reverse, length, scales, ranges } = self.of;
        let factors = scales.iter().zip(ranges).cycle();
        let rows = self.into.chunks_mut(*length).zip(self.input.chunks(*length));
        for ((into, input), (&scale, &range)) in rows.zip(factors) {
            if *is_reverse {
                into.iter_mut().zip(input).for_each(|(into, x)| *into = (x - range.zero) * scale);
            } else {
                Bytes { input, scale, range, into }.with::<L>();
            }
        }
    }
}

/// `DynamicQuantizeLinear`: floats as bytes, with a scale and a zero point by their extremes.
pub struct Dynamic;

impl Dynamic {
    /// The node, if it is one.
    ///
    /// # Errors
    /// If its input is missing.
    pub fn new(site: &Site<'_>) -> Result<Option<Self>> {
        let is_float = || site.fact(0).map(|fact| fact.element == Element::FLOAT);
        Ok((site.node.op_type == "DynamicQuantizeLinear" && is_float()?).then_some(Self))
    }
}

impl Operation for Dynamic {
    fn is_rounded(&self) -> bool {
        true
    }

    fn run(&mut self, inputs: &[Option<&Buffer>], outputs: &mut [Buffer]) -> Result<()> {
        let input = single(inputs, 0)?;
        let mut extremes = [0.0; 2];
        dispatch_wide(Extremes { input, into: &mut extremes });
        let [least, greatest] = extremes;
        let scale = (greatest - least) / 255.0;
        let mut range = Range { bounds: [0.0, 255.0], zero: 0.0 };
        range.zero = range.nearest(-least / scale);
        // Outputs that the graph has no use for may be left out.
        for (output, number) in outputs.iter_mut().skip(1).zip([scale, range.zero]) {
            output.single_mut()?.iter_mut().for_each(|into| *into = number);
        }
        dispatch_wide(Bytes { input, scale, range, into: outputs[0].single_mut()? });
        Ok(())
    }
}

/// The least and the greatest of numbers and 0. What is not a number is left out.
struct Extremes<'a> {
    input: &'a [f32],
    into: &'a mut [f32; 2],
}

impl Work for Extremes<'_> {
    #[inline(always)]
    fn with<L: Lanes>(self) {
        const TOGETHER: usize = 64;
        let (mut least, mut greatest) = ([0.0f32; TOGETHER], [0.0f32; TOGETHER]);
        for some in self.input.chunks(TOGETHER) {
            for ((least, greatest), &x) in least.iter_mut().zip(&mut greatest).zip(some) {
                *least = if x < *least { x } else { *least };
                *greatest = if x > *greatest { x } else { *greatest };
            }
        }
        let further = |a: f32, b: f32, is_further: bool| if is_further { b } else { a };
        *self.into = [
            least.iter().fold(0.0, |a, &b| further(a, b, b < a)),
            greatest.iter().fold(0.0, |a, &b| further(a, b, b > a)),
        ];
    }
}

/// Floats as integers of one range.
struct Bytes<'a> {
    input: &'a [f32],
    scale: f32,
    range: Range,
    into: &'a mut [f32],
}

impl Work for Bytes<'_> {
    #[inline(always)]
    fn with<L: Lanes>(self) {
        let Self { input, scale, range, into } = self;
        into.iter_mut().zip(input).for_each(|(into, x)| *into = range.nearest(x / scale));
    }
}
