//! `Resize` and `Upsample`, axis by axis, in 64-bit floats.

use pdk_sdk::error::Result;

use super::buffer::{Buffer, Operation, single};
use crate::operators::resize;
use crate::site::Site;

/// A resize.
pub struct Resize {
    axes: Vec<Axis>,
    /// What is between two axes.
    images: [Vec<f64>; 2],
}

/// An axis that changes.
struct Axis {
    /// The elements of what lies behind it.
    inner: usize,
    length: usize,
    /// For each element of the result those of the input that it consists of, with their weights.
    rows: Vec<Vec<(usize, f64)>>,
}

impl Resize {
    /// The resize of a node.
    ///
    /// # Errors
    /// If the node contradicts itself.
    pub fn new(site: &Site<'_>) -> Result<Self> {
        let mut shape = site.shape(0)?.to_vec();
        let axes = resize::matrices(site)?.into_iter().map(|(axis, matrix)| {
            let (inner, length) = (shape[axis + 1..].iter().product(), shape[axis]);
            shape[axis] = matrix.len();
            let weights = |row: Vec<f64>| row.into_iter().enumerate().filter(|(_, weight)| *weight != 0.0).collect();
            Axis { inner, length, rows: matrix.into_iter().map(weights).collect() }
        });
        Ok(Self { axes: axes.collect(), images: [Vec::new(), Vec::new()] })
    }
}

impl Operation for Resize {
    fn run(&mut self, inputs: &[Option<&Buffer>], outputs: &mut [Buffer]) -> Result<()> {
        let (input, into) = (single(inputs, 0)?, outputs[0].single_mut()?);
        let [image, next] = &mut self.images;
        image.clear();
        image.extend(input.iter().map(|&value| f64::from(value)));
        for axis in &self.axes {
            next.clear();
            for block in image.chunks_exact((axis.length * axis.inner).max(1)) {
                for row in &axis.rows {
                    match row[..] {
                        [(place, weight)] => next.extend(block[place * axis.inner..][..axis.inner].iter().map(|v| weight * v)),
                        [(first, a), (second, b)] => {
                            let (first, second) = (&block[first * axis.inner..], &block[second * axis.inner..]);
                            next.extend(first.iter().zip(second).take(axis.inner).map(|(x, y)| a * x + b * y));
                        }
                        _ => next.extend((0..axis.inner).map(|at| {
                            row.iter().map(|(place, weight)| weight * block[place * axis.inner + at]).sum::<f64>()
                        })),
                    }
                }
            }
            std::mem::swap(image, next);
        }
        into.iter_mut().zip(image).for_each(|(into, value)| *into = *value as f32);
        Ok(())
    }
}
