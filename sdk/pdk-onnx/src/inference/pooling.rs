//! `MaxPool` and `AveragePool`.

use pdk_sdk::error::Result;

use super::buffer::{Buffer, Operation, single};
use crate::operators::{average_pool, max_pool};
use crate::site::Site;

/// A pool.
pub struct Pool {
    /// The elements of a channel of the input.
    input: usize,
    /// For each element of the kernel the elements of a channel that it joins, as those of the output and of the input.
    pairs: Vec<(u32, u32)>,
    /// By how much the sum at each place is divided; none for the greatest.
    divisors: Option<Vec<f64>>,
    sums: Vec<f64>,
}

impl Pool {
    /// The pool of a node; nothing if it is another, or also asks for the places of the greatest.
    ///
    /// # Errors
    /// If the node contradicts itself.
    pub fn new(site: &Site<'_>) -> Result<Option<Self>> {
        let average = match site.node.op_type.as_str() {
            "AveragePool" => true,
            "MaxPool" if site.node.output.len() == 1 => false,
            _ => return Ok(None),
        };
        let window = max_pool::window(site)?;
        let divisors = average.then(|| average_pool::divisors(site, &window));
        let output = window.output.iter().product();
        Ok(Some(Self {
            input: window.input.iter().product(),
            pairs: window.pairs().iter().flatten().map(|&(to, from)| (to as u32, from as u32)).collect(),
            sums: vec![0.0; if average { output } else { 0 }],
            divisors,
        }))
    }
}

impl Operation for Pool {
    fn run(&mut self, inputs: &[Option<&Buffer>], outputs: &mut [Buffer]) -> Result<()> {
        let (image, result) = (single(inputs, 0)?, outputs[0].single_mut()?);
        let channels = (image.len() / self.input.max(1)).max(1);
        let planes = result.chunks_exact_mut((result.len() / channels).max(1));
        for (plane, source) in planes.zip(image.chunks_exact(self.input.max(1))) {
            let Some(divisors) = &self.divisors else {
                plane.fill(f32::NEG_INFINITY);
                for &(to, from) in &self.pairs {
                    let (greatest, value) = (&mut plane[to as usize], source[from as usize]);
                    *greatest = if value > *greatest { value } else { *greatest };
                }
                continue;
            };
            self.sums.fill(0.0);
            for &(to, from) in &self.pairs {
                self.sums[to as usize] += f64::from(source[from as usize]);
            }
            for ((into, sum), divisor) in plane.iter_mut().zip(&self.sums).zip(divisors) {
                *into = (sum / divisor) as f32;
            }
        }
        Ok(())
    }
}
