//! Normalizations by moments of the elements themselves: `LayerNormalization`, `RMSNormalization`, `InstanceNormalization` and
//! `GroupNormalization`.

use pdk_sdk::error::Result;

use super::buffer::{Buffer, Operation, single};
use super::lanes::{Lanes, Work, dispatch};
use super::sums::sum;
use crate::operators::group_normalization::groups;
use crate::operators::normalization;
use crate::site::Site;

/// A normalization of blocks of elements that lie side by side.
pub struct Standardization {
    /// The elements of a block.
    block: usize,
    epsilon: f64,
    /// Whether the mean is subtracted.
    is_centred: bool,
    factors: Factors,
}

/// Which factor and which term belong to an element.
#[derive(Clone, Copy)]
enum Factors {
    /// Those at its place in the block.
    Elements,
    /// Those of its channel, or of as many neighbouring channels as share them.
    Channels { plane: usize, channels: usize, share: usize },
}

impl Standardization {
    /// The normalization of a node; nothing if it is another, its blocks are empty, or its factors are broadcast within a block.
    ///
    /// # Errors
    /// If the node contradicts itself.
    pub fn new(site: &Site<'_>) -> Result<Option<Self>> {
        let (name, shape) = (site.node.op_type.as_str(), site.shape(0)?);
        let of_channels = |channels: usize, share: usize| -> Result<_> {
            Ok(Factors::Channels { plane: shape[2..].iter().product(), channels, share })
        };
        let (block, factors) = match name {
            "LayerNormalization" | "RMSNormalization" => {
                let normalized = &shape[normalization::first_axis(site)?..];
                let places = 1..site.node.input.len();
                for place in places.filter(|place| site.optional(*place).is_some()) {
                    let of = site.shape(place)?;
                    let skipped = of.len().saturating_sub(normalized.len());
                    if of[skipped..] != *normalized || of[..skipped].iter().any(|&length| length != 1) {
                        return Ok(None);
                    }
                }
                (normalized.iter().product(), Factors::Elements)
            }
            "InstanceNormalization" => {
                normalization::by_channel(site, 2)?;
                (shape[2..].iter().product(), of_channels(shape[1], 1)?)
            }
            "GroupNormalization" => {
                let (count, share) = groups(site)?;
                let block = shape[1] / count * shape[2..].iter().product::<usize>();
                (block, of_channels(shape[1], share)?)
            }
            _ => return Ok(None),
        };
        if block == 0 {
            return Ok(None);
        }
        let (epsilon, is_centred) = (normalization::epsilon(site), name != "RMSNormalization");
        Ok(Some(Self { block, epsilon, is_centred, factors }))
    }
}

impl Operation for Standardization {
    fn run(&mut self, inputs: &[Option<&Buffer>], outputs: &mut [Buffer]) -> Result<()> {
        let terms = match inputs.get(2).copied().flatten() {
            Some(terms) => terms.single()?,
            None => &[],
        };
        let [into, moments @ ..] = outputs else { return Ok(()) };
        let [means, inverses] = match moments {
            [] => [&mut [][..], &mut []],
            [means] => [means.single_mut()?, &mut []],
            [means, inverses, ..] => [means.single_mut()?, inverses.single_mut()?],
        };
        let (input, into) = (single(inputs, 0)?, into.single_mut()?);
        dispatch(Blocks { of: self, input, factors: single(inputs, 1)?, terms, into, means, inverses });
        Ok(())
    }
}

struct Blocks<'a> {
    of: &'a Standardization,
    input: &'a [f32],
    factors: &'a [f32],
    /// Empty if nothing is added.
    terms: &'a [f32],
    into: &'a mut [f32],
    /// The mean and the inverse deviation of each block; empty if they are not wanted.
    means: &'a mut [f32],
    inverses: &'a mut [f32],
}

impl Work for Blocks<'_> {
    #[inline(always)]
    fn with<L: Lanes>(self) {
        let Self { of, input, factors, terms, into, means, inverses } = self;
        let length = of.block.max(1);
        for (number, (block, into)) in
            input.chunks_exact(length).zip(into.chunks_exact_mut(length)).enumerate()
        {
            let count = length as f64;
            let mean = if of.is_centred { sum(block, |x| x) / count } else { 0.0 };
            let variance = sum(block, |x| (x - mean) * (x - mean)) / count;
            let inverse = 1.0 / (variance + of.epsilon).sqrt();
            let standardized = |x: f32| (f64::from(x) - mean) * inverse;
            match of.factors {
                Factors::Elements if terms.is_empty() => {
                    for (into, (x, factor)) in into.iter_mut().zip(block.iter().zip(factors)) {
                        *into = (standardized(*x) * f64::from(*factor)) as f32;
                    }
                }
                Factors::Elements => {
                    let factors = block.iter().zip(factors.iter().zip(terms));
                    for (into, (x, (factor, term))) in into.iter_mut().zip(factors) {
                        *into = (standardized(*x) * f64::from(*factor) + f64::from(*term)) as f32;
                    }
                }
                Factors::Channels { plane, channels, share } => {
                    let first = number * (length / plane.max(1));
                    let planes = block.chunks_exact(plane.max(1)).zip(into.chunks_exact_mut(plane.max(1)));
                    for (channel, (plane, into)) in planes.enumerate() {
                        let place = (first + channel) % channels / share;
                        let [factor, term] = [factors, terms].map(|of| f64::from(of[place]));
                        for (into, x) in into.iter_mut().zip(plane) {
                            *into = (standardized(*x) * factor + term) as f32;
                        }
                    }
                }
            }
            if let Some(into) = means.get_mut(number) {
                *into = mean as f32;
            }
            if let Some(into) = inverses.get_mut(number) {
                *into = inverse as f32;
            }
        }
    }
}
