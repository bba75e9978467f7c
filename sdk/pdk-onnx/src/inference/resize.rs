//! `Resize` and `Upsample`, axis by axis: in 64-bit floats, or by copying if each element of the result is one of the input.

use pdk_sdk::error::Result;

use super::buffer::{Buffer, Operation, single};
use crate::operators::resize;
use crate::site::Site;

/// A resize.
pub struct Resize {
    axes: Vec<Axis>,
    /// What is between two axes.
    images: [Vec<f64>; 2],
    copies: [Vec<f32>; 2],
    only_copies: bool,
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
            let weights =
                |row: Vec<f64>| row.into_iter().enumerate().filter(|(_, weight)| *weight != 0.0).collect();
            Axis { inner, length, rows: matrix.into_iter().map(weights).collect() }
        });
        let axes: Vec<Axis> = axes.collect();
        let only_copies = axes.iter().flat_map(|axis| &axis.rows).all(|row| matches!(row[..], [(_, 1.0)]));
        Ok(Self { axes, images: [Vec::new(), Vec::new()], copies: [Vec::new(), Vec::new()], only_copies })
    }
}

impl Resize {
    fn copy(&mut self, input: &[f32], into: &mut [f32]) {
        let [image, next] = &mut self.copies;
        image.clear();
        image.extend_from_slice(input);
        for axis in &self.axes {
            next.clear();
            for block in image.chunks_exact((axis.length * axis.inner).max(1)) {
                let places = axis.rows.iter().flatten().map(|(place, _)| *place);
                match axis.inner {
                    1 => next.extend(places.map(|place| block[place])),
                    inner => {
                        places.for_each(|place| next.extend_from_slice(&block[place * inner..][..inner]))
                    }
                }
            }
            std::mem::swap(image, next);
        }
        into.copy_from_slice(image);
    }
}

impl Operation for Resize {
    fn run(&mut self, inputs: &[Option<&Buffer>], outputs: &mut [Buffer]) -> Result<()> {
        let (input, into) = (single(inputs, 0)?, outputs[0].single_mut()?);
        if self.only_copies {
            self.copy(input, into);
            return Ok(());
        }
        let [image, next] = &mut self.images;
        image.clear();
        image.extend(input.iter().map(|&value| f64::from(value)));
        for axis in &self.axes {
            next.clear();
            for block in image.chunks_exact((axis.length * axis.inner).max(1)) {
                for row in &axis.rows {
                    match row[..] {
                        [(place, weight)] => {
                            next.extend(block[place * axis.inner..][..axis.inner].iter().map(|v| weight * v))
                        }
                        [(first, a), (second, b)] => {
                            let (first, second) =
                                (&block[first * axis.inner..], &block[second * axis.inner..]);
                            next.extend(
                                first.iter().zip(second).take(axis.inner).map(|(x, y)| a * x + b * y),
                            );
                        }
                        _ => next.extend((0..axis.inner).map(|at| {
                            row.iter()
                                .map(|(place, weight)| weight * block[place * axis.inner + at])
                                .sum::<f64>()
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
