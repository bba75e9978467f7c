//! `Softmax` and `LogSoftmax`, in 64-bit floats.

use pdk_sdk::error::Result;

use super::buffer::{Buffer, Operation, single};
use super::exponential::exp;
use super::lanes::{Lanes, Work, dispatch_wide};
use super::logarithm::log;
use super::sums::{PARTS, beyond, extreme, joined};
use crate::operators::softmax;
use crate::site::Site;

/// Columns that are computed together if the elements of a group do not lie side by side.
const COLUMNS: usize = 32;

/// Shares that sum to one, or their logarithms.
pub struct Softmax {
    is_log: bool,
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
        let is_log = site.node.op_type == "LogSoftmax";
        Ok(Self { is_log, length, apart, powers: vec![0.0; length * apart.clamp(1, COLUMNS)] })
    }
}

impl Operation for Softmax {
    fn run(&mut self, inputs: &[Option<&Buffer>], outputs: &mut [Buffer]) -> Result<()> {
        let Self { is_log, length, apart, powers } = self;
        let (input, into) = (single(inputs, 0)?, outputs[0].single_mut()?);
        let groups = Groups { length: *length, apart: *apart, powers, input, into };
        match is_log {
            true => dispatch_wide(Logarithms(groups)),
            false => dispatch_wide(groups),
        }
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
        self.all(|power, _, sum| power / sum, |sum| sum);
    }
}

/// The same for the logarithms of shares.
struct Logarithms<'a>(Groups<'a>);

impl Work for Logarithms<'_> {
    #[inline(always)]
    fn with<L: Lanes>(self) {
        self.0.all(|_, less, log| less - log, log);
    }
}

impl Groups<'_> {
    /// Computes each element by `finish`, from its power, from what it is less the greatest of its group, and from what `of_sum` makes of the
    /// sum of the group's powers.
    #[inline(always)]
    fn all(self, finish: impl Fn(f64, f64, f64) -> f64 + Copy, of_sum: impl Fn(f64) -> f64 + Copy) {
        let Self { length, apart, powers, input, into } = self;
        let block = (length * apart).max(1);
        for (input, into) in input.chunks_exact(block).zip(into.chunks_exact_mut(block)) {
            if apart == 1 {
                side_by_side(input, into, powers, finish, of_sum);
                continue;
            }
            for first in (0..apart).step_by(COLUMNS) {
                let (input, into) = (&input[first..], &mut into[first..]);
                columns(input, into, [apart, apart - first], powers, finish, of_sum);
            }
        }
    }
}

/// One group whose elements lie side by side.
#[inline(always)]
fn side_by_side(
    input: &[f32],
    into: &mut [f32],
    powers: &mut [f64],
    finish: impl Fn(f64, f64, f64) -> f64,
    of_sum: impl Fn(f64) -> f64,
) {
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
    let sum = of_sum(joined(parts));
    for (into, (power, value)) in into.iter_mut().zip(powers.iter().zip(input)) {
        *into = finish(*power, f64::from(*value) - greatest, sum) as f32;
    }
}

/// Up to 32 groups, of which the first elements lie side by side, as do the next ones some way behind.
#[inline(always)]
fn columns(
    input: &[f32],
    into: &mut [f32],
    [apart, count]: [usize; 2],
    powers: &mut [f64],
    finish: impl Fn(f64, f64, f64) -> f64,
    of_sum: impl Fn(f64) -> f64,
) {
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
    for sum in &mut sums {
        *sum = of_sum(*sum);
    }
    let rows = input.chunks(apart).zip(powers.chunks_exact(width));
    for (into, (row, powers)) in into.chunks_mut(apart).zip(rows) {
        let groups = row[..count].iter().zip(&greatest).zip(powers.iter().zip(&sums));
        for (into, ((value, greatest), (power, sum))) in into.iter_mut().zip(groups) {
            *into = finish(*power, f64::from(*value) - f64::from(*greatest), *sum) as f32;
        }
    }
}
