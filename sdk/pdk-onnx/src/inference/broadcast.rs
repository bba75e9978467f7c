//! Walks through operands whose shapes are broadcast to one.

use pdk_sdk::error::Result;

use crate::tensor::broadcast;

/// A way through the elements of several operands, in the order of the result's.
pub struct Broadcast<const OPERANDS: usize> {
    /// The axes of the result but the last, each with its length and how far apart its elements are in each operand.
    outer: Vec<(usize, [usize; OPERANDS])>,
    /// The same of the last.
    last: (usize, [usize; OPERANDS]),
    /// The position on the outer axes.
    at: Vec<usize>,
}

impl<const OPERANDS: usize> Broadcast<OPERANDS> {
    /// The way through operands of these shapes.
    ///
    /// # Errors
    /// If the shapes do not go together.
    pub fn new(shapes: [&[usize]; OPERANDS]) -> Result<Self> {
        let shape = broadcast(&shapes)?;
        let all = shapes.map(|of| {
            let mut step = 1;
            let mut steps = vec![0; shape.len()];
            for (axis, &length) in of.iter().enumerate().rev() {
                if length > 1 {
                    steps[shape.len() - of.len() + axis] = step;
                }
                step *= length;
            }
            steps
        });
        let mut axes: Vec<(usize, [usize; OPERANDS])> = Vec::new();
        for axis in (0..shape.len()).filter(|&axis| shape[axis] != 1) {
            let (length, steps) = (shape[axis], all.each_ref().map(|steps| steps[axis]));
            match axes.last_mut() {
                // Two axes are one if all operands go through them in one stride.
                Some((before, of)) if of.iter().zip(&steps).all(|(of, step)| *of == step * length) => {
                    *before *= length;
                    *of = steps;
                }
                _ => axes.push((length, steps)),
            }
        }
        let last = axes.pop().unwrap_or((1, [0; OPERANDS]));
        Ok(Self { at: vec![0; axes.len()], outer: axes, last })
    }

    /// How far apart elements of a row are in each operand.
    pub fn steps(&self) -> [usize; OPERANDS] {
        self.last.1
    }

    /// Calls `row` with each row of the result, and where the row of each operand begins.
    #[inline(always)]
    pub fn rows<T>(&mut self, into: &mut [T], mut row: impl FnMut(&mut [T], [usize; OPERANDS])) {
        self.at.fill(0);
        let mut starts = [0; OPERANDS];
        for into in into.chunks_exact_mut(self.last.0.max(1)) {
            row(into, starts);
            for (at, (length, steps)) in self.at.iter_mut().zip(&self.outer).rev() {
                *at += 1;
                starts.iter_mut().zip(steps).for_each(|(start, step)| *start += step);
                if *at < *length {
                    break;
                }
                starts.iter_mut().zip(steps).for_each(|(start, step)| *start -= step * length);
                *at = 0;
            }
        }
    }
}
