//! `Softmax`, in 64-bit floats.

use pdk_sdk::error::Result;

use super::buffer::{Buffer, Operation, single};
use super::functions::exp;
use super::lanes::{Lanes, Work, dispatch_wide};
use super::sums::{PARTS, beyond, extreme, joined};
use crate::operators::softmax;
use crate::site::Site;

/// Columns that are computed together if the elements of a group do not lie side by side.
const COLUMNS: usize = 32;

/// Shares that sum to one.
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
        Ok(Self { length, apart, powers: vec![0.0; length * apart.clamp(1, COLUMNS)] })
    }
}

impl Operation for Softmax {
    fn run(&mut self, inputs: &[Option<&Buffer>], outputs: &mut [Buffer]) -> Result<()> {
        let (input, into) = (single(inputs, 0)?, outputs[0].single_mut()?);
        dispatch_wide(Groups {
            length: self.length,
            apart: self.apart,
            powers: &mut self.powers,
            input,
            into,
        });
        Ok(())
    }
}

struct Groups<'a> {
    length: usize,
    apart: usize,
    powers: &'a mut [f64],
    input: &'a [f32],
    into: &'a mut [f32],
}

impl Work for Groups<'_> {
    #[inline(always)]
    fn with<L: Lanes>(self) {
        let block = (self.length * self.apart).max(1);
        for (input, into) in self.input.chunks_exact(block).zip(self.into.chunks_exact_mut(block)) {
            if self.apart == 1 {
                side_by_side(input, into, self.powers);
                continue;
            }
            for first in (0..self.apart).step_by(COLUMNS) {
                columns(&input[first..], &mut into[first..], self.apart, self.apart - first, self.powers);
            }
        }
    }
}

/// One group whose elements lie side by side.
#[inline(always)]
fn side_by_side(input: &[f32], into: &mut [f32], powers: &mut [f64]) {
    let greatest = f64::from(extreme::<true>(f32::NEG_INFINITY, input));
    for (power, value) in powers.iter_mut().zip(input) {
        *power = exp(f64::from(*value) - greatest);
    }
    let mut parts = [0.0; PARTS];
    let (rows, rest) = powers.as_chunks::<PARTS>();
    for row in rows {
        parts.iter_mut().zip(row).for_each(|(part, power)| *part += power);
    }
    parts.iter_mut().zip(rest).for_each(|(part, power)| *part += power);
    let sum = joined(parts);
    for (into, power) in into.iter_mut().zip(powers) {
        *into = (*power / sum) as f32;
    }
}

/// Up to 32 groups, of which the first elements lie side by side, as do the next ones some way behind.
#[inline(always)]
fn columns(input: &[f32], into: &mut [f32], apart: usize, count: usize, powers: &mut [f64]) {
    let mut greatest = [f32::NEG_INFINITY; COLUMNS];
    let count = count.min(COLUMNS);
    for row in input.chunks(apart) {
        for (far, value) in greatest.iter_mut().zip(&row[..count]) {
            *far = beyond::<true>(*far, *value);
        }
    }
    let width = COLUMNS.min(apart);
    let mut sums = [0.0; COLUMNS];
    for (row, powers) in input.chunks(apart).zip(powers.chunks_exact_mut(width)) {
        for (power, (value, greatest)) in powers.iter_mut().zip(row[..count].iter().zip(&greatest)) {
            *power = exp(f64::from(*value) - f64::from(*greatest));
        }
        for (sum, power) in sums.iter_mut().zip(&powers[..count]) {
            *sum += power;
        }
    }
    for (row, powers) in into.chunks_mut(apart).zip(powers.chunks_exact(width)) {
        for (into, (power, sum)) in row[..count].iter_mut().zip(powers.iter().zip(&sums)) {
            *into = (power / sum) as f32;
        }
    }
}
