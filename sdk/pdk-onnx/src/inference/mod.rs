//! Runs graphs in 32-bit floats. The same graph and inputs give the same bits on every processor.
//!
//! [`Program::new`] decides for each node how it is computed, once. Convolutions and products of matrices, which are nearly all of the
//! work, become sums of products over lists of offsets ([`product`], [`planar`], [`wide`]), whose order is fixed and whose multiply-add rounds once
//! ([`lanes`]). What only moves elements becomes a list of moves. Everything else is
//! exact up to one rounding, or is computed in 64-bit floats and rounded to its type: frequent operators by code of their own, the others by their
//! rules ([`plain`]). None of that depends on the processor, the number of threads or the system's mathematical library.

mod broadcast;
mod buffer;
mod choice;
#[cfg(test)]
mod comparisons;
mod convolution;
#[cfg(test)]
mod convolution_tests;
mod declared;
mod elementwise;
mod error_function;
mod exponential;
mod extremes;
mod functions;
mod fusion;
mod integers;
mod lanes;
mod logarithm;
mod matrix;
mod movement;
mod neighbours;
mod normalization;
mod plain;
mod plan;
mod planar;
mod pooling;
mod power;
mod product;
mod quantisation;
mod quantised;
#[cfg(test)]
mod quantised_tests;
mod reduction;
mod resize;
mod several;
mod softmax;
#[cfg(test)]
mod speed;
mod standardization;
mod sums;
#[cfg(test)]
mod tests;
mod users;
mod wide;

use pdk_sdk::error::{Error, Result};

use crate::graph::Graph;
use crate::tensor::Element;
use buffer::{Buffer, Operation};

/// A graph that is ready to run.
pub struct Program {
    steps: Vec<Step>,
    buffers: Vec<Buffer>,
    constants: Vec<Buffer>,
    /// For each input of the graph its buffer, its type and its number of elements.
    inputs: Vec<(usize, Element, usize)>,
    outputs: Vec<Operand>,
}

/// Something that a node computes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Operand {
    Constant(usize),
    Computed(usize),
}

/// A node that is computed while the graph runs.
struct Step {
    operation: Box<dyn Operation>,
    inputs: Vec<Option<Operand>>,
    /// The buffers of its outputs, with their types and numbers of elements.
    outputs: Vec<(usize, Element, usize)>,
    /// Here the outputs are while the step runs.
    results: Vec<Buffer>,
}

impl Program {
    /// Prepares the outputs of a graph.
    ///
    /// # Errors
    /// If an operator or a shape is not known here, or a node contradicts itself.
    pub fn new(graph: Graph) -> Result<Self> {
        plan::program(graph)
    }

    /// Computes the outputs of the graph, or the first of them, from its inputs, in the graph's order. Numbers of every type are 32-bit
    /// floats here.
    ///
    /// # Errors
    /// If the inputs are not those of the graph, or a node cannot be computed.
    pub fn run(&mut self, inputs: &[Vec<f32>], outputs: &mut [Vec<f32>]) -> Result<()> {
        if inputs.len() != self.inputs.len() || outputs.len() > self.outputs.len() {
            return Err(Error::new(format!(
                "the network has {} inputs and {} outputs, but {} and {} are given",
                self.inputs.len(),
                self.outputs.len(),
                inputs.len(),
                outputs.len()
            )));
        }
        for (&(buffer, element, count), values) in self.inputs.iter().zip(inputs) {
            if values.len() != count {
                return Err(Error::new(format!(
                    "an input has {count} numbers, but {} are given",
                    values.len()
                )));
            }
            let buffer = &mut self.buffers[buffer];
            buffer.resize(count);
            match buffer {
                Buffer::Single(into) => into.copy_from_slice(values),
                Buffer::Double(into) => {
                    into.iter_mut().zip(values).for_each(|(into, value)| *into = f64::from(*value));
                }
            }
            buffer.round(element);
        }
        for step in &mut self.steps {
            step.run(&mut self.buffers, &self.constants)?;
        }
        for (operand, into) in self.outputs.iter().zip(outputs) {
            into.clear();
            match operand.of(&self.buffers, &self.constants) {
                Buffer::Single(values) => into.extend(values.iter().copied().map(plain_nan)),
                Buffer::Double(values) => into.extend(values.iter().map(|&value| plain_nan(value as f32))),
            }
        }
        Ok(())
    }
}

/// The same number; of what is not a number, always the same bits, which otherwise depend on the processor.
fn plain_nan(value: f32) -> f32 {
    if value.is_nan() { f32::NAN } else { value }
}

impl Operand {
    fn of<'a>(self, buffers: &'a [Buffer], constants: &'a [Buffer]) -> &'a Buffer {
        match self {
            Self::Constant(place) => &constants[place],
            Self::Computed(place) => &buffers[place],
        }
    }
}

impl Step {
    fn run(&mut self, buffers: &mut [Buffer], constants: &[Buffer]) -> Result<()> {
        for (result, &(place, _, count)) in self.results.iter_mut().zip(&self.outputs) {
            std::mem::swap(result, &mut buffers[place]);
            result.resize(count);
        }
        let done = {
            let of = |operand: &Option<Operand>| operand.map(|operand| operand.of(buffers, constants));
            // Nearly all operators have few inputs, for which no list is allocated.
            let mut few = [None; 8];
            match few.get_mut(..self.inputs.len()) {
                Some(few) => {
                    few.iter_mut().zip(&self.inputs).for_each(|(into, operand)| *into = of(operand));
                    self.operation.run(few, &mut self.results)
                }
                None => {
                    let many: Vec<_> = self.inputs.iter().map(of).collect();
                    self.operation.run(&many, &mut self.results)
                }
            }
        };
        let is_rounded = self.operation.is_rounded();
        for (result, &(place, element, _)) in self.results.iter_mut().zip(&self.outputs) {
            if !is_rounded {
                result.round(element);
            }
            std::mem::swap(result, &mut buffers[place]);
        }
        done
    }
}
