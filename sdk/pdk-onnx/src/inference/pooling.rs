//! `MaxPool` and `AveragePool`.

use pdk_sdk::error::Result;

use super::buffer::{Buffer, Operation, single};
use crate::operators::{average_pool, max_pool};
use crate::site::Site;

/// A pool.
pub struct Pool {
    /// The elements of a channel of the input.
    input: usize,
    /// For each element of the kernel the elements of a channel that it joins.
    runs: Vec<Run>,
    /// How far apart the elements of the input are that belong to neighbouring places.
    step: usize,
    /// By how much the sum at each place is divided; none for the greatest.
    divisors: Option<Vec<f64>>,
    sums: Vec<f64>,
}

/// Neighbouring places of the output, and the elements of the input that an element of the kernel joins with them.
struct Run {
    to: usize,
    from: usize,
    count: usize,
}

impl Run {
    /// Calls `join` with each place of a plane and its element.
    fn each<T>(&self, plane: &mut [T], source: &[f32], step: usize, join: impl Fn(&mut T, f32)) {
        let values = source[self.from..].iter().step_by(step);
        plane[self.to..][..self.count].iter_mut().zip(values).for_each(|(into, value)| join(into, *value));
    }
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
        let step = window.strides.last().copied().unwrap_or(1);
        let mut runs: Vec<Run> = Vec::new();
        for &(to, from) in window.pairs().iter().flatten() {
            match runs.last_mut() {
                Some(run) if to == run.to + run.count && from == run.from + run.count * step => {
                    run.count += 1
                }
                _ => runs.push(Run { to, from, count: 1 }),
            }
        }
        Ok(Some(Self {
            runs,
            step,
            input: window.input.iter().product(),
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
                for run in &self.runs {
                    run.each(plane, source, self.step, |greatest, value| {
                        *greatest = if value > *greatest { value } else { *greatest };
                    });
                }
                continue;
            };
            self.sums.fill(0.0);
            for run in &self.runs {
                run.each(&mut self.sums, source, self.step, |sum, value| *sum += f64::from(value));
            }
            for ((into, sum), divisor) in plane.iter_mut().zip(&self.sums).zip(divisors) {
                *into = (sum / divisor) as f32;
            }
        }
        Ok(())
    }
}
