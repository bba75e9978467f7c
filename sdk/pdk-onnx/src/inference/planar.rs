//! Sums of products for few outputs over wide rows: lanes are neighbouring places of a row.
//!
//! The sums are those of [`product`](super::product), in the same order. There, lanes are outputs, of which a depthwise convolution has one
//! for each input.

use std::array;

use super::lanes::{LANES, Lanes, Number, Work, dispatch};

/// A row of places: the tap of one lies one element after that of the place before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Row {
    /// The first place.
    pub from: u32,
    /// Where the first output of the first place goes.
    pub to: u32,
}

/// How the rows of a sum lie.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Rows {
    /// The rows.
    pub rows: Vec<Row>,
    /// The places of each, at least as many as there are lanes.
    pub width: usize,
    /// How far apart the outputs of neighbouring places are.
    pub step: usize,
}

/// The weights of all outputs.
#[derive(Debug, Clone, Default)]
pub struct Weights<N = f32> {
    outputs: usize,
    /// By group of [`TOGETHER`] outputs, tap and output.
    weights: Vec<N>,
    start: Vec<N>,
}

/// Outputs that are computed together.
const TOGETHER: usize = 4;

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

/// Computes rows of places. The outputs of a place lie `apart` from each other. If they are `cut`, those below 0 become 0.
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
    assert!(rows.width >= LANES && last.is_none_or(inside), "a tap lies outside the input");
    assert_eq!(weights.weights.len(), weights.outputs * taps.len(), "there is a weight for each tap");
    dispatch(Sums { input, weights, taps, rows, apart, cut, into });
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
    #[inline(always)]
    fn rows<L: Lanes<N>, const OUTPUTS: usize, const VECTORS: usize>(&mut self, first: usize) {
        let width = self.rows.width;
        for row in &self.rows.rows {
            let mut at = 0;
            while at + VECTORS * LANES <= width {
                self.tile::<L, OUTPUTS, VECTORS>(first, row, at);
                at += VECTORS * LANES;
            }
            while at < width {
                // The last vector may cover places that are done: they become the same again.
                at = at.min(width - LANES);
                self.tile::<L, OUTPUTS, 1>(first, row, at);
                at += LANES;
            }
        }
    }

    /// `VECTORS` vectors of a row from a place on, for `OUTPUTS` outputs.
    #[inline(always)]
    fn tile<L: Lanes<N>, const OUTPUTS: usize, const VECTORS: usize>(
        &mut self,
        first: usize,
        row: &Row,
        at: usize,
    ) {
        let mut sums: [[L; VECTORS]; OUTPUTS] =
            array::from_fn(|output| [L::splat(self.weights.start[first + output]); VECTORS]);
        let weights = self.weights.weights[first * self.taps.len()..].chunks_exact(OUTPUTS);
        // Without taps, nothing is read, and a row may lie outside.
        let place = self.input.as_ptr().wrapping_add(row.from as usize + at);
        for (&tap, weights) in self.taps.iter().zip(weights) {
            // SAFETY: `sum` has seen that each row with each tap lies inside the input.
            let values: [L; VECTORS] =
                array::from_fn(|vector| unsafe { L::load(place.add(tap as usize + vector * LANES)) });
            for (sums, &weight) in sums.iter_mut().zip(weights) {
                let weight = L::splat(weight);
                for (sum, value) in sums.iter_mut().zip(values) {
                    *sum = value.multiply_add(weight, *sum);
                }
            }
        }
        for (output, sums) in sums.iter().enumerate() {
            let step = self.rows.step;
            let to = row.to as usize + (first + output) * self.apart + at * step;
            for (vector, sum) in sums.iter().enumerate() {
                let into = &mut self.into[to + vector * LANES * step..][..(LANES - 1) * step + 1];
                let sums = if self.cut { sum.to_array().map(N::cut) } else { sum.to_array() };
                match step {
                    1 => into.copy_from_slice(&sums),
                    _ => into.iter_mut().step_by(step).zip(sums).for_each(|(into, value)| *into = value),
                }
            }
        }
    }
}

impl<N: Number> Work<N> for Sums<'_, N> {
    #[inline(always)]
    fn with<L: Lanes<N>>(mut self) {
        for first in (0..self.weights.outputs).step_by(TOGETHER) {
            match self.weights.outputs - first {
                1 => self.rows::<L, 1, 4>(first),
                2 => self.rows::<L, 2, 4>(first),
                3 => self.rows::<L, 3, 3>(first),
                _ => self.rows::<L, TOGETHER, 3>(first),
            }
        }
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::super::lanes::{Portable, multiply_add};
    use super::*;
    use crate::testing::numbers;

    /// Three rows of drawn numbers, weights, and what the definition says of them.
    pub struct Drawn {
        pub input: Vec<f32>,
        pub weights: Vec<f32>,
        pub start: Vec<f32>,
        pub taps: Vec<u32>,
        pub rows: Rows,
        /// How far apart the outputs of a place lie.
        pub apart: usize,
        pub expected: Vec<f32>,
    }

    impl Drawn {
        pub fn new(outputs: usize, taps: usize, width: usize) -> Self {
            let draw = |seed, count| -> Vec<f32> {
                numbers(seed, count).iter().map(|&value| value as f32).collect()
            };
            let (height, length) = (3, width + taps);
            let input = draw(1, height * length);
            let (weights, start) = (draw(2, outputs * taps), draw(3, outputs));
            let row = |row: usize| Row { from: (row * length) as u32, to: (row * width) as u32 };
            let rows = Rows { rows: (0..height).map(row).collect(), width, step: 1 };
            let mut expected = vec![0.0; outputs * height * width];
            for (output, plane) in expected.chunks_mut(height * width).enumerate() {
                for (at, value) in plane.iter_mut().enumerate() {
                    let from = at / width * length + at % width;
                    let products = weights[output * taps..][..taps].iter().enumerate();
                    *value = products.fold(start[output], |sum, (tap, weight)| {
                        multiply_add(input[from + tap], *weight, sum)
                    });
                }
            }
            let offsets = (0..taps as u32).collect();
            Self { input, weights, start, taps: offsets, rows, apart: height * width, expected }
        }
    }

    #[test]
    fn sums_are_those_of_the_definition_whatever_the_width() {
        for (outputs, taps, width) in [(1, 9, 8), (2, 9, 37), (3, 5, 100), (4, 7, 33), (7, 25, 47)] {
            let Drawn { input, weights, start, taps: offsets, rows, apart, expected } =
                &Drawn::new(outputs, taps, width);
            let packed = Weights::new(outputs, taps, |o, t| weights[o * taps + t], |o| start[o]);
            let mut found = vec![0.0; expected.len()];
            for cut in [false, true] {
                let expected: Vec<f32> =
                    expected.iter().map(|sum| if cut { sum.max(0.0) } else { *sum }).collect();
                sum(input, &packed, offsets, rows, *apart, cut, &mut found);
                assert_eq!(found, expected, "{outputs} outputs, {taps} taps, {width} wide, {cut}");
                found.fill(0.0);
                let (weights, apart) = (&packed, *apart);
                Sums { input, weights, taps: offsets, rows, apart, cut, into: &mut found }.with::<Portable>();
                assert_eq!(found, expected, "{outputs} outputs, {taps} taps, {width} wide, {cut}, portable");
            }
        }
    }
}
