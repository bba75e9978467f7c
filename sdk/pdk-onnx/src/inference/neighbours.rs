//! `LRN`: elements divided by a power of what their neighbours in other channels hold, in 64-bit floats.

use pdk_sdk::error::Result;

use super::buffer::{Buffer, Operation, single};
use super::lanes::{Lanes, Work, dispatch};
use crate::operators::lrn;
use crate::site::Site;

/// A normalization by neighbours.
pub struct Neighbours {
    channels: usize,
    /// The elements of a channel.
    plane: usize,
    /// The channels that are summed before and behind.
    around: [usize; 2],
    factor: f64,
    bias: f64,
    exponent: f64,
    sums: Vec<f64>,
}

impl Neighbours {
    /// The node's.
    ///
    /// # Errors
    /// If it contradicts itself.
    pub fn new(site: &Site<'_>) -> Result<Self> {
        let (shape, size) = (site.shape(0)?, lrn::size(site)?);
        let plane = shape[2..].iter().product();
        Ok(Self {
            channels: shape[1],
            plane,
            around: [(size - 1) / 2, size / 2],
            factor: site.float("alpha", 1e-4) / size as f64,
            bias: site.float("bias", 1.0),
            exponent: site.float("beta", 0.75),
            sums: vec![0.0; plane],
        })
    }
}

impl Operation for Neighbours {
    fn run(&mut self, inputs: &[Option<&Buffer>], outputs: &mut [Buffer]) -> Result<()> {
        dispatch(Images { of: self, input: single(inputs, 0)?, into: outputs[0].single_mut()? });
        Ok(())
    }
}

struct Images<'a> {
    of: &'a mut Neighbours,
    input: &'a [f32],
    into: &'a mut [f32],
}

impl Work for Images<'_> {
    #[inline(always)]
    fn with<L: Lanes>(self) {
        match self.of.exponent {
            // The most frequent exponent needs no logarithm.
            0.75 => self.all(|x| x.sqrt() * x.sqrt().sqrt()),
            exponent => self.all(|x| libm::pow(x, exponent)),
        }
    }
}

impl Images<'_> {
    #[inline(always)]
    fn all(self, power: impl Fn(f64) -> f64) {
        let Neighbours { channels, plane, around: [before, behind], factor, bias, ref mut sums, .. } =
            *self.of;
        let (image, plane) = ((channels * plane).max(1), plane.max(1));
        for (input, into) in self.input.chunks_exact(image).zip(self.into.chunks_exact_mut(image)) {
            for (channel, into) in into.chunks_exact_mut(plane).enumerate() {
                let first = channel.saturating_sub(before);
                let last = channel.saturating_add(behind + 1).min(channels);
                sums.fill(0.0);
                for source in input[first * plane..last * plane].chunks_exact(plane) {
                    for (sum, x) in sums.iter_mut().zip(source) {
                        *sum += f64::from(*x) * f64::from(*x);
                    }
                }
                let source = &input[channel * plane..][..plane];
                for (into, (x, sum)) in into.iter_mut().zip(source.iter().zip(sums.iter())) {
                    *into = (f64::from(*x) / power(bias + factor * sum)) as f32;
                }
            }
        }
    }
}
