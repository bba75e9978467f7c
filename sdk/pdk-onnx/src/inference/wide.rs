//! Sums of products over rows of places with registers of sixteen lanes, for numbers of outputs that such registers do not divide well.
//!
//! The sums are those of [`product`](super::product), in the same order. With lanes as outputs, 36 outputs take three registers for
//! each place, of which a quarter is used for nothing; with lanes as places, a row of 47 takes three for each output.

use std::array;

use super::lanes::{LANES, Lanes, Number, Pair, Work, dispatch_wide, has_wide_lanes};
use super::planar::{Row, Rows};

/// The lanes of a register.
const WIDE: usize = 2 * LANES;

/// Outputs that are computed together: with four vectors of a row, 24 of 32 registers hold sums.
const TOGETHER: usize = 6;

/// The weights of all outputs.
#[derive(Debug, Clone)]
pub struct Weights<N = f32> {
    outputs: usize,
    /// By group of [`TOGETHER`] outputs, tap and output.
    weights: Vec<N>,
    start: Vec<N>,
}

impl<N: Number> Weights<N> {
    /// `weight` gives the weight of an output and a tap, `start` what the sum of an output begins with.
    pub fn new(
        outputs: usize,
        taps: usize,
        weight: impl Fn(usize, usize) -> N,
        start: impl Fn(usize) -> N,
    ) -> Self {
        let mut weights = Vec::with_capacity(outputs * taps);
        for first in (0..outputs).step_by(TOGETHER) {
            for tap in 0..taps {
                weights.extend((first..outputs.min(first + TOGETHER)).map(|output| weight(output, tap)));
            }
        }
        Self { outputs, weights, start: (0..outputs).map(start).collect() }
    }
}

/// Whether rows of this many places are computed faster this way on this processor than with lanes as outputs: if that takes a tenth fewer
/// registers, which pays for laying the input out by phases.
pub fn is_faster(outputs: usize, width: usize) -> bool {
    if outputs < LANES || width < WIDE || !has_wide_lanes() {
        return false;
    }
    // As `Packed` has them: half a register takes as long as a whole one.
    let vectors = outputs.div_ceil(LANES);
    let of_outputs = match vectors % 4 {
        3 => vectors / 4 * 2 + 2,
        left => vectors / 4 * 2 + left.min(1),
    };
    outputs * width.div_ceil(WIDE) * 10 <= of_outputs * width * 9
}

/// Computes rows of places. The outputs of a place lie `apart` from each other, those of neighbouring places side by side. If they are
/// `cut`, those below 0 become 0.
///
/// # Panics
/// If a row with a tap leaves the input, or an output the result.
pub fn sum<N: Number>(
    input: &[N],
    weights: &Weights<N>,
    taps: &[u32],
    rows: &Rows,
    apart: usize,
    cut: bool,
    into: &mut [N],
) {
    let last = rows.rows.iter().map(|row| row.from as usize).max().zip(taps.iter().max());
    let inside = |(row, tap): (usize, &u32)| row + *tap as usize + rows.width <= input.len();
    assert!(rows.width >= WIDE && last.is_none_or(inside), "a tap lies outside the input");
    assert!(rows.step == 1, "outputs of neighbouring places lie side by side");
    assert_eq!(weights.weights.len(), weights.outputs * taps.len(), "there is a weight for each tap");
    dispatch_wide(Sums { input, weights, taps, rows, apart, cut, into });
}

struct Sums<'a, N> {
    input: &'a [N],
    weights: &'a Weights<N>,
    taps: &'a [u32],
    rows: &'a Rows,
    apart: usize,
    cut: bool,
    into: &'a mut [N],
}

impl<N: Number> Sums<'_, N> {
    /// Some outputs of a row. Few vectors at a time would wait for each other, so that five are three and two, and six are three twice.
    #[inline(always)]
    fn row<L: Lanes<N>, const OUTPUTS: usize>(&mut self, first: usize, row: &Row) {
        let count = self.rows.width.div_ceil(WIDE);
        let mut done = 0;
        while done < count {
            done += match count - done {
                1 => self.tile::<L, OUTPUTS, 1>(first, row, done),
                2 => self.tile::<L, OUTPUTS, 2>(first, row, done),
                3 | 5 | 6 => self.tile::<L, OUTPUTS, 3>(first, row, done),
                _ => self.tile::<L, OUTPUTS, 4>(first, row, done),
            };
        }
    }

    /// `VECTORS` vectors of a row, for `OUTPUTS` outputs. Returns their number.
    #[inline(always)]
    fn tile<L: Lanes<N>, const OUTPUTS: usize, const VECTORS: usize>(
        &mut self,
        first: usize,
        row: &Row,
        done: usize,
    ) -> usize {
        let mut sums: [[L::Pair; VECTORS]; OUTPUTS] =
            array::from_fn(|output| [L::Pair::splat(self.weights.start[first + output]); VECTORS]);
        let (weights, _) = self.weights.weights[first * self.taps.len()..].as_chunks::<OUTPUTS>();
        // The last vector of a row may cover places that are done: they become the same again.
        let starts: [usize; VECTORS] =
            array::from_fn(|vector| ((done + vector) * WIDE).min(self.rows.width - WIDE));
        // Without taps, nothing is read, and a row may lie outside.
        let places = starts.map(|start| self.input.as_ptr().wrapping_add(row.from as usize + start));
        for (&tap, weights) in self.taps.iter().zip(weights) {
            // SAFETY: `sum` has seen that each row with each tap lies inside the input, and a vector ends where its row does at the latest.
            let values = places.map(|place| unsafe { L::Pair::load(place.add(tap as usize)) });
            for (sums, &weight) in sums.iter_mut().zip(weights) {
                let weight = L::Pair::splat(weight);
                for (sum, value) in sums.iter_mut().zip(values) {
                    *sum = value.multiply_add(weight, *sum);
                }
            }
        }
        for (output, sums) in sums.iter().enumerate() {
            let to = row.to as usize + (first + output) * self.apart;
            for (start, sum) in starts.iter().zip(sums) {
                let sums = if self.cut { sum.to_array().map(N::cut) } else { sum.to_array() };
                self.into[to + start..][..WIDE].copy_from_slice(&sums);
            }
        }
        VECTORS
    }
}

impl<N: Number> Work<N> for Sums<'_, N> {
    #[inline(always)]
    fn with<L: Lanes<N>>(mut self) {
        let rows = self.rows;
        for first in (0..self.weights.outputs).step_by(TOGETHER) {
            for row in &rows.rows {
                match self.weights.outputs - first {
                    1 => self.row::<L, 1>(first, row),
                    2 => self.row::<L, 2>(first, row),
                    3 => self.row::<L, 3>(first, row),
                    4 => self.row::<L, 4>(first, row),
                    5 => self.row::<L, 5>(first, row),
                    _ => self.row::<L, TOGETHER>(first, row),
                }
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::lanes::{Level, limited};
    use super::super::planar::tests::Drawn;
    use super::*;

    #[test]
    fn sums_are_those_of_the_definition_whatever_the_width_and_the_processor() {
        for (outputs, taps, width) in
            [(8, 0, 16), (9, 1, 17), (10, 9, 31), (11, 5, 33), (24, 7, 98), (28, 25, 47), (36, 11, 80)]
        {
            let Drawn { input, weights, start, taps: offsets, rows, apart, expected } =
                &Drawn::new(outputs, taps, width);
            let packed = Weights::new(outputs, taps, |o, t| weights[o * taps + t], |o| start[o]);
            for level in [Level::Portable, Level::Avx, Level::Avx512] {
                let mut found = vec![0.0; expected.len()];
                limited(level, || sum(input, &packed, offsets, rows, *apart, false, &mut found));
                assert_eq!(found, *expected, "{outputs} outputs, {taps} taps, {width} wide, {level:?}");
                limited(level, || sum(input, &packed, offsets, rows, *apart, true, &mut found));
                let cut: Vec<f32> = expected.iter().map(|sum| sum.max(0.0)).collect();
                assert_eq!(found, cut, "{outputs} outputs, {taps} taps, {width} wide, {level:?}, cut");
            }
        }
    }

    #[test]
    #[should_panic(expected = "a tap lies outside the input")]
    fn what_lies_outside_the_input_is_not_read() {
        let rows = Rows { rows: vec![Row { from: 0, to: 0 }], width: WIDE, step: 1 };
        let packed = Weights::new(1, 2, |_, _| 1.0, |_| 0.0);
        sum(&[1.0; WIDE + 1], &packed, &[0, 2], &rows, WIDE, false, &mut [0.0; WIDE]);
    }
}
