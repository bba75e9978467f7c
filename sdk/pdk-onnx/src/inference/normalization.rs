//! `BatchNormalization` with constant factors.

use pdk_sdk::error::Result;

use super::buffer::{Buffer, Constants, Operation, single};
use crate::operators::normalization;
use crate::site::Site;

/// A normalization by channel.
pub struct Normalization {
    /// The elements of a channel.
    plane: usize,
    /// Factor and addend of each channel, into which mean and deviation have been put.
    channels: Vec<[f64; 2]>,
}

impl Normalization {
    /// The normalization of a node with these inputs; nothing if one of them is not constant.
    ///
    /// # Errors
    /// If the node contradicts itself.
    pub fn new(site: &Site<'_>, constants: &Constants) -> Result<Option<Self>> {
        normalization::by_channel(site, 4)?;
        let [_, Some(scale), Some(bias), Some(mean), Some(variance)] = constants else { return Ok(None) };
        let count = scale.values.len();
        if site.node.output.len() != 1
            || [bias, mean, variance].iter().any(|values| values.values.len() != count)
        {
            return Ok(None);
        }
        let epsilon = normalization::epsilon(site);
        let channel = |at: usize| {
            let factor = scale.values[at] / libm::sqrt(variance.values[at] + epsilon);
            [factor, bias.values[at] - mean.values[at] * factor]
        };
        let plane = site.shape(0)?[2..].iter().product();
        Ok(Some(Self { plane, channels: (0..count).map(channel).collect() }))
    }
}

impl Operation for Normalization {
    fn run(&mut self, inputs: &[Option<&Buffer>], outputs: &mut [Buffer]) -> Result<()> {
        let (input, into) = (single(inputs, 0)?, outputs[0].single_mut()?);
        let planes = input.chunks_exact(self.plane.max(1)).zip(into.chunks_exact_mut(self.plane.max(1)));
        for ((plane, into), [factor, addend]) in planes.zip(self.channels.iter().cycle()) {
            into.iter_mut().zip(plane).for_each(|(into, x)| *into = (f64::from(*x) * factor + addend) as f32);
        }
        Ok(())
    }
}
