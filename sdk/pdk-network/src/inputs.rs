//! The values of all inputs, from frame to frame.

use std::collections::VecDeque;

use pdk_sdk::error::{Error, Result};

use crate::plan::{Fill, Plan};
use crate::waypoints;

/// The values of a network's inputs.
#[derive(Debug, Clone)]
pub struct Inputs {
    values: Vec<Vec<f32>>,
    fills: Vec<Fill>,
    names: Vec<String>,
    image: usize,
    /// What the network gave before, the oldest first.
    controls: VecDeque<[f32; 2]>,
    most_controls: usize,
}

impl Inputs {
    /// The values before the first frame: zeros, and constants.
    pub fn new(plan: &Plan) -> Self {
        let values = plan.inputs.iter().map(|input| {
            let count = input.shape.iter().product();
            match &input.fill {
                Fill::Constant(list) if list.len() == count => list.clone(),
                Fill::Constant(list) => vec![list.first().copied().unwrap_or(0.0); count],
                _ => vec![0.0; count],
            }
        });
        let values: Vec<Vec<f32>> = values.collect();
        let fills: Vec<Fill> = plan.inputs.iter().map(|input| input.fill.clone()).collect();
        let controls = fills.iter().zip(&values).filter(|(fill, _)| **fill == Fill::Controls);
        Self {
            most_controls: controls.map(|(_, values)| values.len() / 2).max().unwrap_or(0),
            values,
            fills,
            names: plan.inputs.iter().map(|input| input.name.clone()).collect(),
            image: plan.image.place,
            controls: VecDeque::new(),
        }
    }

    /// The values of each input, in their order.
    pub fn values(&self) -> &[Vec<f32>] {
        &self.values
    }

    /// The numbers of the image.
    pub fn image(&mut self) -> &mut [f32] {
        &mut self.values[self.image]
    }

    /// Sets the speed in metres per second, if an input takes it; not a number if it is not known.
    ///
    /// # Errors
    /// If it is not known, and nothing is assumed for it.
    pub fn move_at(&mut self, speed: f64) -> Result<()> {
        for ((fill, values), name) in self.fills.iter().zip(&mut self.values).zip(&self.names) {
            let Fill::Speed(taken) = fill else { continue };
            let known = Some(speed).filter(|speed| speed.is_finite()).or(taken.assumed);
            let known = known.ok_or_else(|| match name.as_str() {
                waypoints::SPEED => Error::new(
                    "the controller of its waypoints takes the vehicle's speed, which is not known here, because the recording does not have it; set `assumed` in \
                     `waypoints` to one in m/s that stands for it",
                ),
                name => Error::new(format!(
                    "its input `{name}` takes the vehicle's speed, which is not known here, because the recording does not have it; describe one that stands \
                     for it, as in inputs = {{ {name} = {{ value = \"speed\", assumed = 8 }} }}"
                )),
            })?;
            values.fill(taken.number(known));
        }
        Ok(())
    }

    /// Forgets all frames.
    pub fn forget(&mut self) {
        self.controls.clear();
        for (fill, values) in self.fills.iter().zip(&mut self.values) {
            if matches!(fill, Fill::State(_) | Fill::Controls) {
                values.fill(0.0);
            }
        }
    }

    /// Takes what is to be remembered from these outputs, which have as many numbers as the inputs that get them, and from the control
    /// that they became.
    pub fn remember(&mut self, outputs: &[Vec<f32>], control: [f64; 2]) {
        if self.most_controls > 0 {
            self.controls.push_back(control.map(|number| number as f32));
            if self.controls.len() > self.most_controls {
                self.controls.pop_front();
            }
        }
        for (fill, values) in self.fills.iter().zip(&mut self.values) {
            match fill {
                Fill::State(output) => values.copy_from_slice(&outputs[*output]),
                Fill::Controls => {
                    // Zeros stand for what was before the first frame.
                    let pairs = values.rchunks_exact_mut(2).zip(self.controls.iter().rev());
                    pairs.for_each(|(values, control)| values.copy_from_slice(control));
                }
                _ => {}
            }
        }
    }

    /// Checks that the outputs that are remembered fit their inputs, by the number of values of each.
    ///
    /// # Errors
    /// Names the first that does not.
    pub fn check_states(&self, outputs: &[String], sizes: &[usize]) -> Result<()> {
        for ((fill, values), name) in self.fills.iter().zip(&self.values).zip(&self.names) {
            let Fill::State(output) = fill else { continue };
            if sizes[*output] != values.len() {
                return Err(Error::new(format!(
                    "its output `{}` has {} values, but the input `{name}` that gets them with the next frame has {}; correct `state`",
                    outputs[*output],
                    sizes[*output],
                    values.len()
                )));
            }
        }
        Ok(())
    }
}
